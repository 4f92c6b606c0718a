"""The hourly erasure that the server makes by itself."""

import asyncio
import logging
from contextlib import AbstractAsyncContextManager, suppress

from server.db import Database
from server.locks import Locks
from server.locks_repository import LockTaken
from server.retention.service import carry_out, names
from server.settings import Settings
from server.watching import Stopped, watched

LOG = logging.getLogger(__name__)
FIRST_LOOK_S, LOOK_EVERY_S = 120.0, 3600.0


def hourly_retention(
    database: Database, settings: Settings, locks: Locks, first_look_s: float = FIRST_LOOK_S
) -> AbstractAsyncContextManager[None]:
    """Carry out the periods of every study each hour while the server runs; one process at a time."""
    return watched(lambda stopped: _watch(database, settings, locks, first_look_s, stopped))


async def _watch(
    database: Database, settings: Settings, locks: Locks, first_look_s: float, stopped: Stopped
) -> None:
    await asyncio.sleep(first_look_s)
    while True:
        try:
            await asyncio.to_thread(alone, database, settings, locks, stopped)
        except Exception:  # the next look comes, whatever went wrong with this one
            LOG.exception("retention")
        await asyncio.sleep(LOOK_EVERY_S)


def alone(database: Database, settings: Settings, locks: Locks, stopped: Stopped) -> None:
    """Carry out what is due unless another process is at it."""
    with suppress(LockTaken), locks.held("retention"):
        every_study(database, settings, stopped)


def every_study(database: Database, settings: Settings, stopped: Stopped) -> None:
    """Erase what is due of each study that declares a period, and log it.

    Parameters
    ----------
    stopped : callable
        Asked between two transactions; once true no further one begins.
    """
    with database.read() as session:
        studies = names(session)
    for study in studies:
        try:
            done = carry_out(database, settings, study, stopped)
        except Exception:  # the other studies keep to what they declare, whatever went wrong with this one
            LOG.exception("retention of %s", study)
            continue
        if done.identifiers or done.visits:
            LOG.info(
                "retention of %s: identifiers of %d visits, %d visits erased",
                study,
                done.identifiers,
                done.visits,
            )
