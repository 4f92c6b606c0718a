"""The report of a study of continuous ratings: levels, the lag behind blinks, and the traces."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from analysis.plans.plan import Prepared
from analysis.plans.result import labels_of
from analysis.report.contents import Contents, Part, Picture, caption
from analysis.report.formats import Table
from analysis.report.json_output import exclusions_data, left_out
from analysis.report.numbers import apa_p, fixed, interval, p_value
from analysis.report.pictures import COLOURS, in_both_formats, new_figure, write_note
from analysis.traces import LagResult, MeanTrace

METHODS = (
    "Ratings were sampled at frames of the clips. Each person's traces of a cell's clips were averaged, then "
    "people; intervals are 95% t intervals over people, sample by sample. The lag is where the change of the "
    "ratings correlates most with the onsets of blinks: circular cross-correlations, averaged over a "
    "person's clips and then over people, up to the declared longest lag. Its interval is a bootstrap over "
    "people; p compares the greatest correlation with those of 999 random circular shifts of each clip's "
    "blinks. In the figure the traces are drawn earlier by this lag."
)
SIGNIFICANCE = 0.05


def contents_of(
    prepared: Prepared, traces: Sequence[MeanTrace], lag: LagResult | None, clips: int
) -> Contents:
    """What the report says."""
    experiment, synthetic = prepared.experiment, prepared.synthetic
    people = prepared.rows["participant"].astype(str).nunique()
    return Contents(
        name=experiment.name,
        title=experiment.title,
        lead=f"{people} participants, {len(prepared.rows)} traces of {clips} clips",
        source=prepared.source,
        synthetic=synthetic,
        n_participants=people,
        left_out=left_out(prepared.exclusions),
        decisions=prepared.decisions,
        parts=(
            Part(
                tables(prepared, traces, lag),
                sentences(lag),
                draw=lambda: tuple(pictures(prepared, traces, lag)),
            ),
        ),
        methods=METHODS,
        numbers=numbers(prepared, traces, lag, people),
    )


def cell_label(prepared: Prepared, cell: str) -> str:
    """The labels of a cell's levels."""
    labels, factors = labels_of(prepared.experiment), prepared.experiment.factors
    return ", ".join(
        labels.level(factor.name, level) for factor, level in zip(factors, cell.split("/"), strict=True)
    )


def tables(prepared: Prepared, traces: Sequence[MeanTrace], lag: LagResult | None) -> tuple[Table, ...]:
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
            fixed(lag.r, 3),
            p_value(lag.p),
        )
        title = caption("Ratings behind blinks", name, synthetic)
        made.append(Table("trace-lag", title, ("People", "Lag in s", "95% CI", "r", "p"), (row,), 0))
    return tuple(made)


def sentences(lag: LagResult | None) -> tuple[str, ...]:
    """Whether ratings answer blinks, and after how long."""
    if lag is None:
        return ("Clips without blinks, or one person: no lag can be told.",)
    if lag.p >= SIGNIFICANCE:
        return (
            f"Ratings did not follow blinks: the greatest correlation of their change with blinks, "
            f"{fixed(lag.r, 3)} at {fixed(lag.lag_s)} s, is no greater than among random shifts of them "
            f"({apa_p(lag.p)}).",
        )
    return (
        f"Ratings changed {fixed(lag.lag_s)} s after blinks, 95% CI [{fixed(lag.lag_low_s)}, "
        f"{fixed(lag.lag_high_s)}]; their change then correlates {fixed(lag.r, 3)} with blinks, more than "
        f"among random shifts of them ({apa_p(lag.p)}).",
    )


def numbers(
    prepared: Prepared, traces: Sequence[MeanTrace], lag: LagResult | None, people: int
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


def pictures(prepared: Prepared, traces: Sequence[MeanTrace], lag: LagResult | None) -> list[Picture]:
    """The traces, moved earlier by the lag, and the correlation by lag."""
    # matplotlib takes a second to import, which commands that draw nothing need not pay
    import matplotlib as mpl

    from analysis.report.pictures import STYLE

    earlier_s = lag.lag_s if lag is not None and lag.p < SIGNIFICANCE else 0.0
    labels = [cell_label(prepared, trace.cell) for trace in traces]
    with mpl.rc_context(STYLE):
        made = [traces_figure(traces, labels, earlier_s, prepared.synthetic)]
        return made if lag is None else [*made, lag_figure(lag, prepared.synthetic)]


# Figures of continuous ratings: a panel a cell with its blinks marked, and the correlation by lag.

COLUMNS = 2
PANEL_INCHES = 1.9
MARKS_SHARE = 0.12
"""Height of the marks of blinks below the ratings, as a share of theirs."""


def traces_figure(
    traces: Sequence[MeanTrace], labels: Sequence[str], earlier_s: float, synthetic: bool
) -> Picture:
    """A panel a cell: mean and interval, drawn `earlier_s` earlier than given; a row of marks a clip."""
    columns = min(COLUMNS, len(traces))
    rows = -(-len(traces) // columns)
    figure = new_figure(height=PANEL_INCHES * rows + 0.9)
    panels = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).ravel()
    low, high = _extent(traces)
    for panel, trace, label, colour in zip(panels, traces, labels, _colours(traces), strict=False):
        times = trace.times_s - earlier_s
        panel.plot(times, trace.mean, color=colour)
        panel.fill_between(times, trace.ci_low, trace.ci_high, color=colour, alpha=0.2, linewidth=0)
        _mark_events(panel, trace, low, MARKS_SHARE * (high - low))
        panel.set_title(label, fontsize=9)
    for panel in panels[len(traces) :]:
        panel.set_visible(False)
    panels[0].set_ylim(low - (MARKS_SHARE + 0.04) * (high - low), high)
    for panel in panels[::columns]:
        panel.set_ylabel("Rating")
    for panel in panels[max(0, len(traces) - columns) : len(traces)]:
        panel.set_xlabel("Time in the clip in s" + (", less the lag" if earlier_s else ""))
        panel.tick_params(labelbottom=True)
    note = f"Mean over people with 95% intervals, drawn {fixed(earlier_s)} s earlier than given. "
    write_note(figure, note + "Marks: blinks, a row a clip.", synthetic, "answers")
    alt = f"Mean rating over time in {len(traces)} cells, with the blinks of their clips"
    return _picture(figure, "figure-traces", "Mean traces", alt)


def lag_figure(lag: LagResult, synthetic: bool) -> Picture:
    """Correlation of the ratings' change with blinks, by lag."""
    figure = new_figure(height=3.4)
    axes = figure.add_subplot()
    axes.plot(lag.lags_s, lag.mean, color=COLOURS[0])
    axes.fill_between(lag.lags_s, lag.ci_low, lag.ci_high, color=COLOURS[0], alpha=0.18, linewidth=0)
    axes.axvline(lag.lag_s, color=COLOURS[1], linewidth=0.8, linestyle=":")
    axes.axhline(0, color="#888888", linewidth=0.6)
    axes.set_xlabel("Time after a blink in s")
    axes.set_ylabel("Correlation with the rating's change")
    write_note(figure, f"N = {lag.people}. Dotted: the lag.", synthetic, "answers")
    alt = f"Correlation of ratings with blinks, greatest at {fixed(lag.lag_s)} s"
    return _picture(figure, "figure-lag", "Lag", alt)


def _colours(traces: Sequence[MeanTrace]) -> list[str]:
    return [COLOURS[position % len(COLOURS)] for position in range(len(traces))]


def _extent(traces: Sequence[MeanTrace]) -> tuple[float, float]:
    """Lowest and highest value drawn; intervals of one person are not numbers, and not drawn."""
    values = [
        float(value)
        for trace in traces
        for curve in (trace.mean, trace.ci_low, trace.ci_high)
        for value in curve[np.isfinite(curve)]
    ]
    low, high = min(values), max(values)
    return (low, high) if high > low else (low - 0.5, high + 0.5)


def _mark_events(panel: Any, trace: MeanTrace, below: float, height: float) -> None:
    clips = [events for events in trace.events_s if events]
    row = height / max(1, len(clips))
    for position, events in enumerate(clips):
        top = below - position * row
        panel.vlines(events, top - 0.7 * row, top, color="#444444", linewidth=0.9)


def _picture(figure: Any, key: str, title: str, alt: str) -> Picture:
    return Picture(key, title, alt, *in_both_formats(figure))
