"""One decorator for numeric kernels: numba, cached on disk, without the interpreter lock."""

from collections.abc import Callable
from typing import TypeVar, cast

import numba

SAFE_FAST = {"nsz", "arcp", "contract", "afn", "reassoc"}
Kernel = TypeVar("Kernel", bound=Callable[..., object])


def compiled(kernel: Kernel) -> Kernel:
    """Compile `kernel` with numba; kernels that call one another live in one file.

    Sums may be reordered, but NaN and infinity keep their meaning.
    The cache on disk notices an edit only in the file that holds the caller.
    """
    return cast(Kernel, numba.njit(cache=True, nogil=True, fastmath=SAFE_FAST)(kernel))
