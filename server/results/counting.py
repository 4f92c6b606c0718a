"""Results of a pool together with what they depend on."""

import asyncio
import logging
from contextlib import AbstractAsyncContextManager

from sqlalchemy.orm import Session

from server.accounts.identity import OPERATOR
from server.core.changes import Stopped, background_task
from server.core.db import Database
from server.models import Study, StudyVersion
from server.results import repository, service
from server.results.cache import ResultsCache, Revision
from server.results.kinds import summary_of
from server.results.repository import Pool
from server.results.schemas import AnyResults
from server.studies.lookup import definition_of, find_study
from server.studies.series import version_of_series


def pool_and_revision(
    session: Session, study: Study, origin: str, series: int | None, scale: str | None
) -> tuple[Pool, StudyVersion, Revision]:
    """What results are asked of, with a version of it, and what they depend on at this moment."""
    version = version_of_series(session, study, series)
    pool = service.pool(study, version, origin, scale)
    return pool, version, repository.revision(session, study, pool)


def counted_results(
    session: Session, study: Study, origin: str, series: int | None, scale: str | None
) -> tuple[Revision, AnyResults]:
    """The results with the revision they are of."""
    # The revision is read first: a rating that comes in between is counted again, never left out.
    pool, version, revision = pool_and_revision(session, study, origin, series, scale)
    summarise = summary_of(definition_of(version).trial.kind)
    return revision, summarise(session, study, version, pool)


# The results of large studies are counted once the server has started, before anybody asks for them.

LOG = logging.getLogger(__name__)
FIRST_LOOK_S = 1.0
"""Who came for the start has been answered by then."""
MANY_ANSWERS = 20_000
"""Fewer are counted while a page loads."""


def results_counted_ahead(
    database: Database, cache: ResultsCache, first_look_s: float = FIRST_LOOK_S
) -> AbstractAsyncContextManager[None]:
    """Count, once, what the results pages of open studies with many answers will show."""
    return background_task(lambda stopped: _count(database, cache, first_look_s, stopped))


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
            _count_ahead(database, cache, name, origin)


def _count_ahead(database: Database, cache: ResultsCache, name: str, origin: str) -> None:
    def count() -> tuple[Revision, AnyResults]:
        with database.read() as session:
            return counted_results(session, find_study(session, name, OPERATOR, "view"), origin, None, None)

    with database.read() as session:
        study = find_study(session, name, OPERATOR, "view")
        pool, _, revision = pool_and_revision(session, study, origin, None, None)
    cache.get(pool, revision, count)
