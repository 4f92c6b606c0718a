"""Continuous ratings: the mean trace of each cell, with the moments at which its clips blink."""

from collections.abc import Mapping, Sequence

from sqlalchemy.orm import Session

from experiments import design
from experiments.declaration.continuous_rating import continuous_rating_of
from server.models import Study, StudyVersion
from server.participation.tally_pools import pooled_tally
from server.results.repository import Pool, blinks_of_cells, traces_of
from server.results.schemas import TraceCell, TraceResults
from server.results.service import common_results
from server.results.summary import Trace, cell_trace
from server.studies.lookup import definition_of


def summarise(session: Session, study: Study, version: StudyVersion, of: Pool) -> TraceResults:
    """The traces of one pool, which is of the data series of `version`."""
    definition = definition_of(version)
    declared, tally = continuous_rating_of(definition), pooled_tally(session, of.runs(), "", ())
    order = ["/".join(level for _, level in cell) for cell in design.cells(definition)]
    return TraceResults(
        **common_results(study, version, of, tally),
        ratings=tally.answers.total(),
        minimum=declared.minimum,
        maximum=declared.maximum,
        cells=trace_cells(order, traces_of(session, of, "continuous_rating"), blinks_of_cells(session, of)),
    )


def trace_cells(
    order: Sequence[str], traces: Sequence[Trace], blinks: Mapping[str, Sequence[Sequence[float]]]
) -> list[TraceCell]:
    """The cells that have traces, in declared order; `blinks` are those of each clip of a cell."""
    cells = []
    for name in order:
        mine = [trace for trace in traces if trace.cell == name]
        if not mine:
            continue
        values = vars(cell_trace(mine))
        end_s = values["times_s"][-1]
        shown = [[time_s for time_s in clip if time_s <= end_s] for clip in blinks.get(name, ())]
        cells.append(TraceCell(blinks_s=shown, **values))
    return cells
