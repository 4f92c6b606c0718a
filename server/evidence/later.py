"""Digests that wait for the clip store are judged while the server runs, once the store answers again."""

import asyncio
import logging
from contextlib import AbstractAsyncContextManager

from server.db import Database
from server.evidence.intake import Intake
from server.evidence.waiting import judge_later
from server.watching import Stopped, watched

LOG = logging.getLogger(__name__)
LOOK_EVERY_S, MAX_WAIT_S = 60.0, 600.0
"""Between two looks; twice as long after each that could judge nothing, up to the latter."""


def digests_judged_later(
    database: Database, intake: Intake, look_every_s: float = LOOK_EVERY_S
) -> AbstractAsyncContextManager[None]:
    """Judge what waits from before the server started, and whatever answer it had to take unchecked."""
    return watched(lambda stopped: _watch(database, intake, look_every_s, stopped))


async def _watch(database: Database, intake: Intake, look_every_s: float, stopped: Stopped) -> None:
    wait_s, left = look_every_s, 0
    while True:
        await asyncio.sleep(wait_s)
        if not intake.unchecked.is_set() and not left:
            continue
        wait_s = look_every_s if intake.unchecked.is_set() else min(2 * wait_s, MAX_WAIT_S)
        intake.unchecked.clear()
        try:
            before, left = left, await asyncio.to_thread(judge_later, database, intake.clips, stopped)
        except Exception:  # the next look comes, whatever went wrong with this one
            LOG.exception("digests of clips")
            intake.unchecked.set()
            continue
        if left < before:
            wait_s = look_every_s
