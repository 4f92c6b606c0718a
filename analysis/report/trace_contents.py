"""The report of a study of continuous ratings: levels, the lag behind blinks, and the traces."""

from collections.abc import Sequence
from typing import Any

from analysis.plans.plan import PlanRows
from analysis.plans.result import labels_of
from analysis.report.contents import Contents, Part, Picture, caption
from analysis.report.formats import Table
from analysis.report.json_output import exclusions_data, left_out
from analysis.report.numbers import apa_p, fixed, interval, p_value, share
from analysis.traces import LagResult, MeanTrace
from table_files import counted

METHODS = (
    "Ratings were sampled at the clips' frames. Traces were averaged over the clips of a cell within each "
    "person, and then over people. "
)
INTERVALS = "Intervals are 95% t intervals over people at each sample. "
LAG = (
    "The lag is where the change in ratings correlates most with blink onsets. It is found by circular "
    "cross-correlation up to the declared longest lag, averaged over clips and then over people. Its "
    "interval is a bootstrap over people. The p value compares the greatest correlation with those of 999 "
    "random circular shifts of each clip's blinks. "
)
EARLIER = "The figure draws the traces earlier by this lag. "
SIGNIFICANCE = 0.05


def contents_of(
    prepared: PlanRows, traces: Sequence[MeanTrace], lag: LagResult | None, clips: int
) -> Contents:
    """What the report says."""
    experiment, synthetic = prepared.experiment, prepared.synthetic
    people = prepared.rows["participant"].astype(str).nunique()
    return Contents(
        name=experiment.name,
        title=experiment.title,
        lead=(
            f"{counted(people, 'participant')}, {counted(len(prepared.rows), 'trace')} of "
            f"{counted(clips, 'clip')}"
        ),
        source=prepared.source,
        synthetic=synthetic,
        n_participants=people,
        left_out=left_out(prepared.exclusions),
        decisions=prepared.decisions,
        parts=(
            Part(
                tables(prepared, traces, lag),
                sentences(lag, traces),
                draw=lambda: tuple(pictures(prepared, traces, lag)),
            ),
        ),
        methods=methods_of(traces, lag),
        numbers=numbers(prepared, traces, lag, people),
    )


def cell_label(prepared: PlanRows, cell: str) -> str:
    """The labels of a cell's levels."""
    labels, factors = labels_of(prepared.experiment), prepared.experiment.factors
    return ", ".join(
        labels.level(factor.name, level) for factor, level in zip(factors, cell.split("/"), strict=True)
    )


def tables(prepared: PlanRows, traces: Sequence[MeanTrace], lag: LagResult | None) -> tuple[Table, ...]:
    """The level of each cell, and the lag."""
    name, synthetic = prepared.experiment.name, prepared.synthetic
    rows = tuple(
        (
            cell_label(prepared, trace.cell),
            str(trace.people),
            fixed(trace.level),
            interval((trace.level_low, trace.level_high)),
        )
        for trace in traces
    )
    title = caption("Mean of the traces", name, synthetic)
    made = [Table("trace-levels", title, ("Cell", "People", "Mean", "95% CI"), rows)]
    if lag is not None:
        row = (
            str(lag.people),
            fixed(lag.lag_s),
            interval((lag.lag_low_s, lag.lag_high_s)),
            share(lag.r),
            p_value(lag.p),
        )
        title = caption("Lag of ratings after blinks", name, synthetic)
        made.append(Table("trace-lag", title, ("People", "Lag in s", "95% CI", "r", "p"), (row,), 0))
    return tuple(made)


def methods_of(traces: Sequence[MeanTrace], lag: LagResult | None) -> str:
    """How the numbers came about, of what was computed."""
    said = METHODS + (INTERVALS if any(trace.people > 1 for trace in traces) else "")
    said += "" if lag is None else LAG
    return (said + (EARLIER if lag is not None and lag.p < SIGNIFICANCE else "")).strip()


def sentences(lag: LagResult | None, traces: Sequence[MeanTrace]) -> tuple[str, ...]:
    """Whether ratings answer blinks, and after how long."""
    if lag is None:
        blinks = any(events for trace in traces for events in trace.events_s)
        why = "fewer than two people rated clips with blinks" if blinks else "the clips have no blinks"
        return (f"The lag cannot be estimated: {why}.",)
    if lag.p >= SIGNIFICANCE:
        return (
            "Ratings did not follow blinks: the greatest correlation of their change with blinks, "
            f"r = {share(lag.r, 2)} at {fixed(lag.lag_s)} s, did not exceed that of random shifts "
            f"({apa_p(lag.p)}).",
        )
    return (
        f"Ratings changed {fixed(lag.lag_s)} s after blinks, 95% CI [{fixed(lag.lag_low_s)}, "
        f"{fixed(lag.lag_high_s)}]; at this lag, their change correlated with blinks, "
        f"r = {share(lag.r, 2)}, more than for random shifts ({apa_p(lag.p)}).",
    )


def numbers(
    prepared: PlanRows, traces: Sequence[MeanTrace], lag: LagResult | None, people: int
) -> dict[str, Any]:
    """The JSON document."""
    return {
        "name": prepared.experiment.name,
        "title": prepared.experiment.title,
        "kind": prepared.experiment.trial.kind,
        "source": prepared.source,
        "synthetic": prepared.synthetic,
        "n_participants": people,
        "n_trials": len(prepared.rows),
        "cells": [_lists(trace) for trace in traces],
        "lag": None if lag is None else _lists(lag),
        "decisions": list(prepared.decisions),
        "exclusions": exclusions_data(prepared.exclusions),
    }


def _lists(result: MeanTrace | LagResult) -> dict[str, Any]:
    return {
        name: value.tolist() if hasattr(value, "tolist") else value for name, value in vars(result).items()
    }


def pictures(prepared: PlanRows, traces: Sequence[MeanTrace], lag: LagResult | None) -> list[Picture]:
    """The traces, moved earlier by the lag, and the correlation by lag."""
    # matplotlib takes a second to import, which commands that draw nothing need not pay
    import matplotlib as mpl

    from analysis.report.figures import lag_figure, traces_figure
    from analysis.report.pictures import STYLE

    earlier_s = lag.lag_s if lag is not None and lag.p < SIGNIFICANCE else 0.0
    labels = [cell_label(prepared, trace.cell) for trace in traces]
    with mpl.rc_context(STYLE):
        made = [traces_figure(traces, labels, earlier_s, prepared.synthetic)]
        return made if lag is None else [*made, lag_figure(lag, prepared.synthetic)]
