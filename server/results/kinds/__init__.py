"""What the results page shows of each kind of trial: a file of its name here, with `summarise`.

Nothing else joins them: the name in the declaration finds the file. Of a kind without one
the numbers that its answers count as are shown by cell.
"""

from collections import Counter, defaultdict
from collections.abc import Callable, Mapping
from importlib import import_module

from sqlalchemy.orm import Session

from server.models import Study, StudyVersion
from server.participation.tally_pools import PooledTally, pooled_tally
from server.results.repository import Pool, cells_of
from server.results.schemas import AnsweredCell, AnyResults, OtherResults
from server.results.service import common_results
from server.studies.lookup import definition_of

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
    """Of a kind without a file here: what its `counted` (`server.participation.kinds`) counts, by cell."""
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
