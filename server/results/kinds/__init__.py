"""What the results page shows of each kind of trial: a file of its name here, with `summarise`.

Nothing else joins them: the name in the declaration finds the file. Of a kind without one
the numbers that its answers count as are shown by cell.
"""

import asyncio
import logging
from collections import Counter, defaultdict
from collections.abc import Callable, Mapping
from contextlib import AbstractAsyncContextManager
from importlib import import_module

from sqlalchemy.orm import Session

from server.accounts.identity import OPERATOR
from server.core.changes import Stopped, background_task
from server.core.db import Database
from server.models import Study, StudyVersion
from server.participation.tally_pools import PooledTally, pooled_tally
from server.results import repository, service
from server.results.cache import ResultsCache, Revision
from server.results.repository import Pool, cells_of
from server.results.schemas import AnsweredCell, AnyResults, OtherResults
from server.results.service import common_results
from server.studies.lookup import definition_of, find_study
from server.studies.series import version_of_series

# What the results page shows of each kind of trial: a file of its name here, with `summarise`.

Summarise = Callable[[Session, Study, StudyVersion, Pool], AnyResults]
"""The results of a pool of answers, which is of the data series of this version."""


def summary_of(kind: str) -> Summarise:
    """How the answers to trials of this kind are summed up."""
    module = f"server.results.kinds.{kind}"
    try:
        summarise: Summarise = import_module(module).summarise
    except ModuleNotFoundError as error:
        if error.name != module:
            raise
        return _summarise_unknown
    return summarise


def _summarise_unknown(session: Session, study: Study, version: StudyVersion, of: Pool) -> OtherResults:
    """Results of a kind without a file: what its `counted` (`server.participation.kinds`) counts, by cell."""
    kind = definition_of(version).trial.kind
    tally = pooled_tally(session, of.runs(), "", ())
    return OtherResults(
        **common_results(study, version, of, tally),
        ratings=tally.answers.total(),
        note=f"Answers of {kind.replace('_', ' ')} trials as numbers, by cell; the Data page exports them.",
        cells=answered_cells(tally, cells_of(session, of)),
    )


def answered_cells(tally: PooledTally, cells: Mapping[int, str]) -> list[AnsweredCell]:
    """How often each cell, or two cells in their order, was answered, and with which mean."""
    numbers: dict[tuple[str, str | None], Counter[float]] = defaultdict(Counter)
    for (clip, second, value), times in tally.answers.items():
        numbers[cells[clip], None if second is None else cells[second]][value] += times
    return [
        AnsweredCell(
            cell=cell,
            second=second,
            n=values.total(),
            mean=sum(value * times for value, times in values.items()) / values.total(),
        )
        for (cell, second), values in sorted(numbers.items(), key=lambda item: (item[0][0], item[0][1] or ""))
    ]


# Results of a pool together with what they depend on.


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
"""Requests that came at the start have been answered by then."""
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
