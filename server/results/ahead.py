"""The results of large studies are counted once the server has started, before anybody asks for them."""

import asyncio
import logging
from contextlib import AbstractAsyncContextManager

from server.accounts.identity import OPERATOR
from server.db import Database
from server.results import counting, repository
from server.results.cache import ResultsCache, Revision
from server.results.schemas import AnyResults
from server.studies.lookup import find_study
from server.watching import Stopped, watched

LOG = logging.getLogger(__name__)
FIRST_LOOK_S = 1.0
"""Who came for the start has been answered by then."""
MANY_ANSWERS = 20_000
"""Fewer are counted while a page loads."""


def results_counted_ahead(
    database: Database, cache: ResultsCache, first_look_s: float = FIRST_LOOK_S
) -> AbstractAsyncContextManager[None]:
    """Count, once, what the results pages of open studies with many answers will show."""
    return watched(lambda stopped: _count(database, cache, first_look_s, stopped))


async def _count(database: Database, cache: ResultsCache, first_look_s: float, stopped: Stopped) -> None:
    await asyncio.sleep(first_look_s)
    try:
        await asyncio.to_thread(count_ahead, database, cache, stopped)
    except Exception:  # a page that asks counts by itself, and says what is wrong
        LOG.exception("results ahead")


def count_ahead(database: Database, cache: ResultsCache, stopped: Stopped) -> None:
    """Bring the results of every open study's origins with many answers into this worker's memory."""
    with database.read() as session:
        origins = repository.large_origins(session, MANY_ANSWERS)
    for name, origin in origins:
        if not stopped():
            _keep(database, cache, name, origin)


def _keep(database: Database, cache: ResultsCache, name: str, origin: str) -> None:
    def count() -> tuple[Revision, AnyResults]:
        with database.read() as session:
            return counting.counted(session, find_study(session, name, OPERATOR, "view"), origin, None, None)

    with database.read() as session:
        study = find_study(session, name, OPERATOR, "view")
        pool, _, revision = counting.pool_and_revision(session, study, origin, None, None)
    cache.get(pool, revision, count)
