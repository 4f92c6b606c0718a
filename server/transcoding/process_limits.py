"""What a process that decodes strangers' files may take of the machine."""

import os
import signal
import sys
from contextlib import suppress
from pathlib import Path

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
