"""The process that converts uploaded videos: `python -m server.transcoding.worker FOLDER`."""

import os
import select
import signal
import sys
import time
from collections import deque
from collections.abc import Container, Iterable
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from server.transcoding.records import BEGUN, CLIPS, asked_rate, sender, uploads_in, waiting_in, write_record
from video_conversion.prepare import prepare
from video_conversion.prepared import Prepared
from video_conversion.video_file import READ_AGAIN, NotAClip

# Whose video is next: accounts take turns, one file of each at a time, whatever folders they use.

LOOK_S = 1.0
LOOK_SHARE = 20
"""The folders are read again after at least 20 times as long as reading them took."""

MAX_A_PROCESS = 64
"""A process converts at most this many files, one after the other."""

Video = tuple[Path, Path]
"""The folder of an upload, and one of its files."""


@dataclass
class Turns:
    """The videos that wait, in one queue per account; the account served longest ago is next.

    Attributes
    ----------
    root : Path
        Folder of uploads.
    """

    root: Path
    _queues: dict[str, deque[Video]] = field(default_factory=dict)
    _served: dict[str, int] = field(default_factory=dict)
    _put_back: dict[Video, int] = field(default_factory=dict)
    _count: int = 0
    _look_at: float = 0.0

    def refresh(self, started: Iterable[Video] = (), *, now: bool = False) -> None:
        """Read which videos wait, except those that are started, at most every second."""
        begun = time.monotonic()
        if begun < self._look_at and not now:
            return
        queues: dict[str, deque[Video]] = {}
        taken = set(started)
        for folder in uploads_in(self.root):
            try:
                waiting = waiting_in(folder)
            except FileNotFoundError:  # discarded meanwhile
                continue
            if videos := [(folder, path) for path in waiting if (folder, path) not in taken]:
                queues.setdefault(sender(folder) or "", deque()).extend(videos)
        self._queues = {
            account: deque(sorted(queue, key=lambda video: self._put_back.get(video, 0)))
            for account, queue in queues.items()
        }
        ended = time.monotonic()
        self._look_at = ended + max(LOOK_S, LOOK_SHARE * (ended - begun))

    def accounts(self) -> list[str]:
        """The accounts that have a video waiting, those served longest ago first."""
        return self.in_order([account for account, queue in self._queues.items() if queue])

    def take(self, account: str) -> Video:
        """The next video of an account."""
        return self._queues[account].popleft()

    def take_further(self, account: str, folder: Path, but: Container[Video]) -> list[Video]:
        """The next videos of the same upload up to the first of `but`, as many as a process does."""
        queue = self._queues[account]
        further: list[Video] = []
        while queue and queue[0][0] == folder and queue[0] not in but and len(further) + 1 < MAX_A_PROCESS:
            further.append(queue.popleft())
        return further

    def put_first(self, account: str, videos: Iterable[Video]) -> None:
        """Let videos that were taken be the next ones of their account again, in their order."""
        self._queues.setdefault(account, deque()).extendleft(reversed(list(videos)))

    def put_last(self, account: str, video: Video) -> None:
        """Let a video wait behind the others of its account."""
        self._put_back[video] = self._put_back.get(video, 0) + 1
        self._queues.setdefault(account, deque()).append(video)

    def serve(self, account: str) -> None:
        """Note that the account has had its turn."""
        self._count += 1
        self._served[account] = self._count

    def in_order(self, accounts: list[str]) -> list[str]:
        """These accounts, those served longest ago first."""
        return sorted(accounts, key=lambda account: self._served.get(account, 0))


# What a process that decodes strangers' files may take of the machine.

MAX_ADDRESS_BYTES = 12 << 30
SHARE = 2
"""All of them together get the machine's memory divided by this."""
ROOM_FOR_ONE_BYTES = 2 << 30
"""A clip of 4096 x 4096 pixels takes 1.3 GB of addresses (measured)."""
MAX_STARTED = 4
NICENESS = 10
CGROUP_LIMITS = ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory/memory.limit_in_bytes")
_SIGNAL_AT_PARENTS_END = 1  # PR_SET_PDEATHSIG of Linux


def memory_of_machine() -> int | None:
    """Bytes of memory of the machine, or of its container where that has less; None if unknown."""
    known = []
    with suppress(ValueError, OSError, AttributeError):  # absent on Windows
        known.append(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    for limit in CGROUP_LIMITS:
        with suppress(OSError, ValueError):  # "max" where there is no limit
            known.append(int(Path(limit).read_text(encoding="ascii")))
    return min((size for size in known if size > 0), default=None)


def address_limit(machine_bytes: int | None) -> int:
    """Bytes of addresses of all processes together: half of the machine's memory, at most 12 GiB."""
    return MAX_ADDRESS_BYTES if machine_bytes is None else min(MAX_ADDRESS_BYTES, machine_bytes // SHARE)


def started_at_most(limit_bytes: int) -> int:
    """How many files may be begun at a time, at least one, so that each has room for large pictures."""
    return max(1, min(MAX_STARTED, limit_bytes // ROOM_FOR_ONE_BYTES))


def stand_back() -> None:
    """Let ratings go first, and let the system end this process first where memory runs out."""
    with suppress(OSError):  # Linux
        Path("/proc/self/oom_score_adj").write_text("1000", encoding="ascii")
    if hasattr(os, "nice"):
        os.nice(NICENESS)


def bound_memory(limit_bytes: int) -> None:
    """Take no more addresses than this, nor more than this process may take already."""
    try:
        import resource  # absent on Windows
    except ImportError:
        return
    _, most = resource.getrlimit(resource.RLIMIT_AS)
    if most != resource.RLIM_INFINITY:
        limit_bytes = min(limit_bytes, most)
    resource.setrlimit(resource.RLIMIT_AS, (limit_bytes, limit_bytes))


def end_with_parent(parent: int) -> None:
    """End this process, stopped or not, as soon as the one that started it has ended."""
    # A group whose parent ends is sent SIGHUP and SIGCONT where a member is stopped (POSIX).
    os.setpgid(0, 0)
    if sys.platform == "linux":
        import ctypes

        with suppress(OSError, AttributeError):
            ctypes.CDLL(None).prctl(_SIGNAL_AT_PARENTS_END, signal.SIGKILL)
        if os.getppid() != parent:
            os._exit(1)


# The process that looks into uploaded videos and converts them: `python -m server.transcoding.worker FOLDER`.
#
# A decoder reads what strangers may have made, in a process for one account's files. While no other account
# waits, it does short files one after the other until its turn is over, since a process for each takes longer
# than a tiny file. Accounts take turns: a file that takes longer than one turn is stopped while a file of
# another account has its turn, and goes on afterwards. A file that ends its process is tried once more and
# then refused; the files after it are done by a fresh process. So is a file that seems unusable after others:
# they may have used up the process's memory, or damaged it. Nothing is refused for what another file did.

MAX_S_A_FILE = 900
MAX_TRIES = 2
TURN_S = 2.0
FIRST_BUDGET_S = 10.0
LONGEST_BUDGET_S = 30.0
"""No file keeps other accounts waiting for longer; one that needs more ends once nobody else waits."""
"""Where memory allows no further file, a file that took longer begins again later, with twice the budget."""
LOOK_AGAIN_S = 0.25
TRY_AFRESH = 3
"""Status of a process that leaves its file to a fresh one."""
FORKS = hasattr(os, "fork") and hasattr(signal, "SIGSTOP")


@dataclass
class _Conversion:
    """A file that a process is at, running or stopped, and those that the process does afterwards."""

    account: str
    folder: Path
    videos: deque[Video]
    process: int
    end: int
    """Handle from which a byte can be read for each file that is done, and the end of the process."""
    used_s: float = 0.0
    """What the present file took so far."""

    @property
    def video(self) -> Video:
        """The file that the process is at."""
        return self.videos[0]


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
        self._started: dict[str, _Conversion] = {}
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
        taken = (video for started in self._started.values() for video in started.videos)
        self._turns.refresh(taken, now=now)

    def _start(self, account: str) -> _Conversion | None:
        """Start the next files of an account; None where the first has gone, or there is no room for it."""
        if len(self._started) >= self._most and not self._make_room():
            return None
        folder, path = video = self._turns.take(account)
        if not path.exists():
            return None
        videos = [video]
        if not self._is_awaited(account):
            videos += self._turns.take_further(account, folder, self._failures)
        self._started[account] = _Conversion(account, folder, deque(videos), *self._fork(videos))
        return self._started[account]

    def _is_awaited(self, account: str) -> bool:
        """Whether another account waits for this one's turn to end."""
        return bool({*self._turns.accounts(), *self._started} - {account})

    def _make_room(self) -> bool:
        """Give up the file that has taken longest, if it is over its budget: it begins again later."""
        longest = max(self._started.values(), key=lambda started: started.used_s)
        budget = self._budget_s.get(longest.video, FIRST_BUDGET_S)
        if longest.used_s < budget:
            return False
        self._budget_s[longest.video] = min(2 * budget, LONGEST_BUDGET_S)
        self._end(longest)
        self._turns.put_last(longest.account, longest.videos.popleft())
        self._turns.put_first(longest.account, longest.videos)
        return True

    def _fork(self, videos: list[Video]) -> tuple[int, int]:
        """Number of the process for these files, and the handle that says how far it is."""
        parent = os.getpid()
        end, done = os.pipe()
        process = os.fork()
        if process:
            os.close(done)
            return process, end
        try:
            signal.signal(signal.SIGTERM, signal.SIG_DFL)
            end_with_parent(parent)
            os.close(self._lock)
            bound_memory(self._limit_each)
            os._exit(_prepare_several(videos, done))
        finally:  # of an error, or of a signal: nothing of the parent's is run here
            os._exit(1)

    def _run(self, started: _Conversion) -> None:
        """Let a process have its turn, and go on for as long as no other account waits."""
        begun = now = time.monotonic()
        turn_ends = begun + TURN_S
        os.kill(started.process, signal.SIGCONT)
        while now < turn_ends:
            if select.select([started.end], [], [], turn_ends - now)[0]:
                done = len(os.read(started.end, MAX_A_PROCESS))
                if not done:
                    self._take_result(started)
                    return
                for _ in range(done):
                    self._note_done(started.videos.popleft())
                if not started.videos:
                    # The last file is done and the process is about to end: it holds no place until then.
                    self._take_result(started)
                    return
                started.used_s, begun = 0.0, time.monotonic()
            now = time.monotonic()
            if started.used_s + now - begun > MAX_S_A_FILE:
                self._end(started)
                _refuse(*started.videos.popleft())
                self._turns.put_first(started.account, started.videos)
                return
            if now >= turn_ends:
                self._refresh()
                if not self._is_awaited(started.account):
                    turn_ends = now + LOOK_AGAIN_S
        os.kill(started.process, signal.SIGSTOP)
        started.used_s += now - begun

    def _note_done(self, video: Video) -> None:
        self._budget_s.pop(video, None)
        self._failures.pop(video, None)

    def _take_result(self, started: _Conversion) -> None:
        """Note that a process has ended; a file at which it ended by an error is tried once more."""
        status = self._end(started, kill=False)
        if started.videos and os.waitstatus_to_exitcode(status) not in (0, TRY_AFRESH):
            self._note_failure(started.account, started.videos.popleft())
        self._turns.put_first(started.account, started.videos)

    def _note_failure(self, account: str, video: Video) -> None:
        failures = self._failures[video] = self._failures.get(video, 0) + 1
        self._budget_s.pop(video, None)
        if failures < MAX_TRIES:
            self._turns.put_last(account, video)
        else:
            _refuse(*video)

    def _end(self, started: _Conversion, *, kill: bool = True) -> int:
        """Clear up after a process, which is ended first unless it ends; return its status."""
        del self._started[started.account]
        if kill:
            os.kill(started.process, signal.SIGKILL)
        _, status = os.waitpid(started.process, 0)
        os.close(started.end)
        (started.folder / BEGUN).unlink(missing_ok=True)
        _remove_half_made(started.folder / CLIPS)
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
        _prepare_one(folder, path, may_refuse=True)


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


def _prepare_several(videos: Iterable[Video], done: int) -> int:
    """Prepare files until the turn is over, with a byte to `done` for each; return the process's status."""
    ends = time.monotonic() + TURN_S
    for number, (folder, path) in enumerate(videos):
        if number and time.monotonic() >= ends:
            break
        if not _prepare_one(folder, path, may_refuse=number == 0):
            return TRY_AFRESH
        os.write(done, b".")
    return 0


def _prepare_one(folder: Path, path: Path, *, may_refuse: bool) -> bool:
    """Prepare one file and write what became of it; false where it was unusable and may not be refused."""
    with suppress(FileNotFoundError):  # the upload was discarded
        with (folder / BEGUN).open("a", encoding="utf-8") as stream:
            stream.write(f"{path.name}\n")
        record = _record_of(folder, path, asked_rate(folder))
        if record.problem is not None and not may_refuse:
            return False
        write_record(folder, record)
        (folder / BEGUN).unlink()
    return True


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


if __name__ == "__main__":
    main()
