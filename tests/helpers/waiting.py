"""Waiting for what another process or thread does."""

import time
from collections.abc import Callable


def until(holds: Callable[[], object], limit_s: float = 60.0) -> None:
    """Return once something holds; fail after the limit, so that no run waits for ever."""
    limit = time.monotonic() + limit_s
    while not holds():
        assert time.monotonic() < limit, f"still not so after {limit_s:g} s"
        time.sleep(0.02)
