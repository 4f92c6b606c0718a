"""The memory that libx264 takes for a clip: zero when it is taken, and kept by the process for the next."""

import ctypes
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache

M_TRIM_THRESHOLD, M_MMAP_THRESHOLD, M_PERTURB = -1, -3, -6
"""Of glibc's mallopt (malloc.h)."""
ZEROES = 255
"""Every block of memory is filled with the complement of this byte when it is taken."""
KEPT_BYTES = 1 << 28
"""Free memory at the heap's end beyond which it goes back to the system: an encoder takes some 45 MB at
960 x 360 px."""
LARGEST_BLOCK_BYTES = 1 << 25
"""The largest that glibc keeps: greater ones, as a character's levels, go back to the system when freed."""


@contextmanager
def encoder_memory() -> Iterator[None]:
    """Memory is zero when it is taken: vector code of libx264's macroblock tree reads some that it never set.

    In a fresh process that memory is zero nearly always, so that bytes differed in one clip of some hundreds.
    What a clip's encoder frees stays with the process, also after the block: to get it anew page by page took
    28 to 41 ms of a clip's 360 to 430. Other C libraries than glibc have no such switches.
    """
    library = _glibc()
    if library is None:
        yield
        return
    mallopt = library.mallopt
    mallopt(M_MMAP_THRESHOLD, LARGEST_BLOCK_BYTES)
    mallopt(M_TRIM_THRESHOLD, KEPT_BYTES)
    mallopt(M_PERTURB, ZEROES)
    try:
        yield
    finally:
        mallopt(M_PERTURB, 0)


def give_back() -> None:
    """Return the memory that was kept to the system, before something large is read."""
    library = _glibc()
    if library is not None:
        library.malloc_trim(0)


@lru_cache(maxsize=1)
def _glibc() -> ctypes.CDLL | None:
    library = ctypes.CDLL(None) if sys.platform == "linux" else None
    return library if library is not None and hasattr(library, "mallopt") else None
