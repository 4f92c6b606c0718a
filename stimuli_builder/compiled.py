"""One decorator for numeric kernels: numba, cached on disk, without the interpreter lock."""

from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import TypeVar, cast

import numba

SAFE_FAST = {"nsz", "arcp", "contract", "afn", "reassoc"}
Kernel = TypeVar("Kernel", bound=Callable[..., object])


def compiled(kernel: Kernel) -> Kernel:
    """Compile `kernel` with numba; one with kernels or numbers of other files takes `compiled_over`.

    Sums may be reordered, but NaN and infinity keep their meaning.
    The cache on disk notices an edit only in the file that holds the caller.
    """
    return cast(Kernel, numba.njit(cache=True, nogil=True, fastmath=SAFE_FAST)(kernel))


def compiled_over(*called: ModuleType) -> Callable[[Kernel], Kernel]:
    """Compile a kernel that holds kernels or numbers of other files: compiled again if one of them is edited.

    numba stamps a cache with the time and size of the caller's file; theirs are added.
    """

    def compile_kernel(kernel: Kernel) -> Kernel:
        dispatcher = compiled(kernel)
        cache = getattr(getattr(dispatcher, "_cache", None), "_cache_file", None)
        if cache is not None:  # there is none where numba is switched off
            cache._source_stamp = (cache._source_stamp, *(_stamp(module) for module in called))
        return dispatcher

    return compile_kernel


def _stamp(module: ModuleType) -> tuple[int, int]:
    """Time in nanoseconds and size in bytes of a module's file."""
    state = Path(str(module.__file__)).stat()
    return state.st_mtime_ns, state.st_size
