"""Waiting for what another process, thread or event loop does."""

import asyncio
import time
from collections.abc import Callable, Coroutine
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar

Result = TypeVar("Result")


def until(holds: Callable[[], object], limit_s: float = 60.0) -> None:
    """Return once something holds; fail after the limit, so that no run waits for ever."""
    limit = time.monotonic() + limit_s
    while not holds():
        assert time.monotonic() < limit, f"still not so after {limit_s:g} s"
        time.sleep(0.02)


def run_in_own_loop(work: Coroutine[Any, Any, Result]) -> Result:
    """Run a coroutine in a separate thread with its own event loop.

    `asyncio.run` fails in a test that comes after a browser test: Playwright's loop still runs in that
    thread.
    """
    with ThreadPoolExecutor(max_workers=1) as pool:
        return pool.submit(asyncio.run, work).result()
