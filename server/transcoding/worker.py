"""The process that looks into uploaded videos and converts them: `python -m server.transcoding FOLDER`.

A decoder reads what strangers may have made; where one ends the process, the file at which it did is known,
refused, and left out by the next one.
"""

import os
import signal
import sys
from contextlib import suppress
from pathlib import Path

from server.transcoding.records import BEGUN, CLIPS, asked_rate, uploads_in, waiting_in, write_record
from video_conversion.prepare import prepare
from video_conversion.prepared import Prepared
from video_conversion.video_file import READ_AGAIN, NotAClip

MAX_S_A_FILE = 900
MAX_TRIES = 2
MAX_ADDRESS_BYTES = 12 << 30
NICENESS = 10


def work(root: Path) -> None:
    """Prepare the videos of every upload in `root` until none waits; nothing where another process does."""
    lock = _lock(root)
    if lock is None:
        return
    _refuse_what_ended_the_last(root)
    while waiting := [(folder, path) for folder in uploads_in(root) for path in waiting_in(folder)]:
        for folder, path in waiting:
            if path.exists():  # an upload may be discarded meanwhile
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


def _refuse_what_ended_the_last(root: Path) -> None:
    """A file at which the process ended twice: once may have been the machine's end."""
    for folder in uploads_in(root):
        begun = folder / BEGUN
        tries = begun.read_text(encoding="utf-8").splitlines() if begun.exists() else []
        if tries and tries.count(tries[-1]) >= MAX_TRIES:
            problem = f"it stopped the decoder, or took more than {MAX_S_A_FILE // 60} minutes; {READ_AGAIN}"
            write_record(folder, Prepared(name=tries[-1], asked_fps=asked_rate(folder), problem=problem))
            begun.unlink()


def _prepare_one(folder: Path, path: Path) -> None:
    begun, asked = folder / BEGUN, asked_rate(folder)
    try:
        with begun.open("a", encoding="utf-8") as stream:
            stream.write(f"{path.name}\n")
        _alarm(MAX_S_A_FILE)
        record = _record_of(folder, path, asked)
        _alarm(0)
        write_record(folder, record)
        begun.unlink()
    except FileNotFoundError:
        return  # the upload was discarded
    except SystemExit:
        begun.unlink(missing_ok=True)  # the server ends: this file is not to blame
        raise


def _record_of(folder: Path, path: Path, asked_fps: float | None) -> Prepared:
    try:
        return prepare(path, folder / CLIPS, asked_fps)
    except NotAClip as error:
        problem = str(error)
    except MemoryError:
        problem = "its pictures need more memory than there is; scale it down"
    return Prepared(name=path.name, asked_fps=asked_fps, problem=problem)


def _alarm(seconds: int) -> None:
    if hasattr(signal, "alarm"):
        signal.alarm(seconds)


def _bounded() -> None:
    """Stand back behind ratings, take no more memory than a machine can spare, and be the first to go."""
    with suppress(OSError):  # Linux: where memory runs out all the same, this process ends and not the server
        Path("/proc/self/oom_score_adj").write_text("1000", encoding="ascii")
    if hasattr(os, "nice"):
        os.nice(NICENESS)
    try:
        import resource  # absent on Windows
    except ImportError:
        return
    resource.setrlimit(resource.RLIMIT_AS, (MAX_ADDRESS_BYTES, MAX_ADDRESS_BYTES))


def main() -> None:
    """Work on the folder of uploads that is named."""
    _bounded()
    signal.signal(signal.SIGTERM, lambda _number, _frame: sys.exit(0))
    work(Path(sys.argv[1]))
