"""The process that looks into uploaded videos and converts them: `python -m server.transcoding FOLDER`.

A decoder reads what strangers may have made. Each file gets a process, and accounts take turns: a file that
takes longer than one turn is stopped while a file of another account has its turn, and goes on afterwards. A
file that ends its process is tried once more and then refused.
"""

import os
import select
import signal
import sys
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from server.transcoding.process_limits import (
    address_limit,
    bound_memory,
    end_with_parent,
    memory_of_machine,
    stand_back,
    started_at_most,
)
from server.transcoding.records import BEGUN, CLIPS, asked_rate, uploads_in, write_record
from server.transcoding.turns import Turns, Video
from video_conversion.prepare import prepare
from video_conversion.prepared import Prepared
from video_conversion.video_file import READ_AGAIN, NotAClip

MAX_S_A_FILE = 900
MAX_TRIES = 2
TURN_S = 2.0
FIRST_BUDGET_S = 10.0
LONGEST_BUDGET_S = 30.0
"""No file keeps other accounts waiting for longer; one that needs more ends once nobody else waits."""
"""Where memory allows no further file, a file that took longer begins again later, with twice the budget."""
LOOK_S = 0.25
FORKS = hasattr(os, "fork") and hasattr(signal, "SIGSTOP")


@dataclass
class _Started:
    """A file that a process is at, running or stopped."""

    account: str
    video: Video
    process: int
    end: int
    """Handle that can be read from once the process has ended."""
    used_s: float = 0.0


class Worker:
    """Prepares the videos of every upload in a folder, by turns between accounts.

    Parameters
    ----------
    root : Path
        Folder of uploads.
    lock : int
        Handle of the lock, which processes for files do not keep.
    """

    def __init__(self, root: Path, lock: int) -> None:
        self._lock, self._turns = lock, Turns(root)
        limit = address_limit(memory_of_machine())
        self._most = started_at_most(limit)
        self._limit_each = limit // self._most
        self._started: dict[str, _Started] = {}
        self._budget_s: dict[Video, float] = {}
        self._failures: dict[Video, int] = {}

    def work(self) -> None:
        """Work until no video waits."""
        try:
            while self._next_turn():
                pass
        finally:
            for started in list(self._started.values()):
                self._end(started)  # these files are not to blame

    def _next_turn(self) -> bool:
        self._refresh(now=not self._turns.accounts() and not self._started)
        candidates = self._turns.in_order([*dict.fromkeys([*self._started, *self._turns.accounts()])])
        for account in candidates:
            started = self._started.get(account) or self._start(account)
            if started is not None:
                self._turns.serve(account)
                self._run(started)
                return True
        return bool(candidates)

    def _refresh(self, *, now: bool = False) -> None:
        self._turns.refresh((started.video for started in self._started.values()), now=now)

    def _start(self, account: str) -> _Started | None:
        """Start the next file of an account; None where it has gone, or there is no room for it."""
        if len(self._started) >= self._most and not self._make_room():
            return None
        folder, path = video = self._turns.take(account)
        if not path.exists():
            return None
        try:
            with (folder / BEGUN).open("a", encoding="utf-8") as stream:
                stream.write(f"{path.name}\n")
        except FileNotFoundError:
            return None  # the upload was discarded
        self._started[account] = _Started(account, video, *self._fork(folder, path))
        return self._started[account]

    def _make_room(self) -> bool:
        """Give up the file that has taken longest, if it is over its budget: it begins again later."""
        longest = max(self._started.values(), key=lambda started: started.used_s)
        budget = self._budget_s.get(longest.video, FIRST_BUDGET_S)
        if longest.used_s < budget:
            return False
        self._budget_s[longest.video] = min(2 * budget, LONGEST_BUDGET_S)
        self._end(longest)
        self._turns.put_last(longest.account, longest.video)
        return True

    def _fork(self, folder: Path, path: Path) -> tuple[int, int]:
        """Number of the process for a file, and the handle that can be read from once it has ended."""
        parent = os.getpid()
        end, held = os.pipe()
        process = os.fork()
        if process:
            os.close(held)
            return process, end
        try:
            signal.signal(signal.SIGTERM, signal.SIG_DFL)
            end_with_parent(parent)
            os.close(self._lock)
            bound_memory(self._limit_each)
            _prepare_one(folder, path)
            os._exit(0)
        finally:  # of an error, or of a signal: nothing of the parent's is run here
            os._exit(1)

    def _run(self, started: _Started) -> None:
        """Let a file have its turn, and go on for as long as no other account waits."""
        begun = now = time.monotonic()
        turn_ends = begun + TURN_S
        os.kill(started.process, signal.SIGCONT)
        while now < turn_ends:
            if select.select([started.end], [], [], turn_ends - now)[0]:
                self._take_result(started)
                return
            now = time.monotonic()
            if started.used_s + now - begun > MAX_S_A_FILE:
                self._end(started)
                _refuse(*started.video)
                return
            if now >= turn_ends:
                self._refresh()
                if not {*self._turns.accounts(), *self._started} - {started.account}:
                    turn_ends = now + LOOK_S
        os.kill(started.process, signal.SIGSTOP)
        started.used_s += now - begun

    def _take_result(self, started: _Started) -> None:
        """Note that a process has ended; a file at which it ended by an error is tried once more."""
        was_error = self._end(started, kill=False) != 0
        self._budget_s.pop(started.video, None)
        if not was_error:
            self._failures.pop(started.video, None)
            return
        failures = self._failures[started.video] = self._failures.get(started.video, 0) + 1
        if failures < MAX_TRIES:
            self._turns.put_last(started.account, started.video)
        else:
            _refuse(*started.video)

    def _end(self, started: _Started, *, kill: bool = True) -> int:
        """Clear up after the process of a file, which is ended first unless it ends; return its status."""
        del self._started[started.account]
        if kill:
            os.kill(started.process, signal.SIGKILL)
        _, status = os.waitpid(started.process, 0)
        os.close(started.end)
        folder = started.video[0]
        (folder / BEGUN).unlink(missing_ok=True)
        _remove_half_made(folder / CLIPS)
        return status


def work(root: Path) -> None:
    """Prepare the videos of every upload in `root` until none waits; nothing where another process does."""
    lock = _lock(root)
    if lock is None:
        return
    for folder in uploads_in(root):
        _refuse_what_ended_twice(folder)
    if FORKS:
        Worker(root, lock).work()
    else:
        _work_in_turn(root)


def _work_in_turn(root: Path) -> None:
    """Where processes can be neither copied nor stopped (Windows): one whole file of each account in turn."""
    turns = Turns(root)
    while True:
        turns.refresh(now=not turns.accounts())
        if not (accounts := turns.accounts()):
            return
        folder, path = turns.take(accounts[0])
        turns.serve(accounts[0])
        if not path.exists():
            continue
        with suppress(FileNotFoundError), (folder / BEGUN).open("a", encoding="utf-8") as stream:
            stream.write(f"{path.name}\n")
        _prepare_one(folder, path)


def _lock(root: Path) -> int | None:
    """A lock that ends with this process; None where another holds it."""
    handle = os.open(root / ".worker", os.O_RDWR | os.O_CREAT, 0o600)
    try:
        import fcntl  # absent on Windows, where one server process is all there is
    except ImportError:
        return handle
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(handle)
        return None
    return handle


def _refuse_what_ended_twice(folder: Path) -> None:
    """A file at which the process ended twice: once may have been the machine's end."""
    begun = folder / BEGUN
    try:
        tries = begun.read_text(encoding="utf-8").splitlines()
    except FileNotFoundError:
        return
    if tries and tries.count(tries[-1]) >= MAX_TRIES:
        _refuse(folder, folder / tries[-1])


def _refuse(folder: Path, path: Path) -> None:
    problem = f"it stopped the decoder, or took more than {MAX_S_A_FILE // 60} minutes; {READ_AGAIN}"
    with suppress(FileNotFoundError):  # the upload was discarded
        write_record(folder, Prepared(name=path.name, asked_fps=asked_rate(folder), problem=problem))
    (folder / BEGUN).unlink(missing_ok=True)


def _prepare_one(folder: Path, path: Path) -> None:
    """Prepare one file, and write what became of it."""
    with suppress(FileNotFoundError):  # the upload was discarded
        write_record(folder, _record_of(folder, path, asked_rate(folder)))
        (folder / BEGUN).unlink()


def _remove_half_made(clips: Path) -> None:
    """Remove what an ended process was writing; whole clips are named by their hash."""
    with suppress(FileNotFoundError, NotADirectoryError):  # none yet, or the upload was discarded
        for path in clips.iterdir():
            if path.name.startswith("."):
                path.unlink(missing_ok=True)


def _record_of(folder: Path, path: Path, asked_fps: float | None) -> Prepared:
    try:
        return prepare(path, folder / CLIPS, asked_fps)
    except NotAClip as error:
        problem = str(error)
    except MemoryError:
        problem = "its pictures need more memory than there is; scale it down"
    return Prepared(name=path.name, asked_fps=asked_fps, problem=problem)


def main() -> None:
    """Work on the folder of uploads that is named."""
    stand_back()
    signal.signal(signal.SIGTERM, lambda _number, _frame: sys.exit(0))
    work(Path(sys.argv[1]))
