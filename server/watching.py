"""Work that the server looks for by itself while it runs."""

import asyncio
import threading
from collections.abc import AsyncIterator, Callable, Coroutine
from contextlib import asynccontextmanager, suppress
from typing import Any

Stopped = Callable[[], bool]
"""True once the server stops: asked by threads, which nobody can cancel."""


@asynccontextmanager
async def watched(watch: Callable[[Stopped], Coroutine[Any, Any, None]]) -> AsyncIterator[None]:
    """Run a watch that never ends by itself beside what is within; its thread ends with its current piece.

    Parameters
    ----------
    watch : callable
        Gets what tells it that the server stops; cancelled then.
    """
    stopped = threading.Event()
    watching = asyncio.create_task(watch(stopped.is_set))
    try:
        yield
    finally:
        stopped.set()
        watching.cancel()
        with suppress(asyncio.CancelledError):
            await watching
