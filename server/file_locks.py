"""A lock file, held by one process at a time."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def locked(path: Path, *, wait: bool = True) -> Iterator[None]:
    """Hold the lock of a file, which is made where it is missing; it ends with the process at the latest.

    Raises
    ------
    BlockingIOError
        Another process holds it, and `wait` is false.
    """
    import fcntl  # not on every system that the rest of the server runs on

    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a") as lock:
        path.chmod(0o600)
        fcntl.flock(lock, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
        yield


def is_left(path: Path) -> bool:
    """Whether a lock file is there and no process holds it: its process ended before its work."""
    try:
        lock = path.open("rb")
    except FileNotFoundError:
        return False
    import fcntl

    with lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
    return True
