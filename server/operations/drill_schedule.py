"""The weekly drill that the server makes by itself, in a process of its own at the lowest priority."""

import asyncio
import logging
import sys
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress

from server.clock import now
from server.operations.drill import is_due, sweep
from server.operations.watched_backups import last_drill
from server.settings import Settings
from server.watching import watched

LOG = logging.getLogger(__name__)
FIRST_LOOK_S, LOOK_EVERY_S, STOP_S = 300.0, 3600.0, 10.0


@asynccontextmanager
async def weekly_drill(settings: Settings, first_look_s: float = FIRST_LOOK_S) -> AsyncIterator[None]:
    """Look every hour whether a drill is due while the server runs; nothing where no folder is known."""
    if not settings.backup_folder:
        yield
        return
    await asyncio.to_thread(sweep, settings)
    async with watched(lambda _: _watch(settings, first_look_s)):
        yield


async def _watch(settings: Settings, first_look_s: float) -> None:
    await asyncio.sleep(first_look_s)
    while True:
        try:
            if is_due(last_drill(settings), now()):
                await _drill()
        except Exception:  # the next look comes, whatever went wrong with this one
            LOG.exception("restore drill")
        await asyncio.sleep(LOOK_EVERY_S)


async def _drill() -> None:
    """Run the command: whatever happens in it, the server goes on."""
    process = await asyncio.create_subprocess_exec(
        sys.executable,
        *("-m", "server", "drill", "--when-due"),
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.STDOUT,
    )
    try:
        said, _ = await process.communicate()
    except asyncio.CancelledError:
        with suppress(ProcessLookupError):
            process.terminate()  # it removes its copy
        with suppress(TimeoutError):
            await asyncio.wait_for(process.communicate(), STOP_S)
            raise
        with suppress(ProcessLookupError):
            process.kill()
        await process.communicate()
        raise
    level = logging.INFO if process.returncode == 0 else logging.ERROR
    LOG.log(level, "restore drill: %s", said.decode("utf-8", "replace").strip())
