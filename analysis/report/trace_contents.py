"""The report of a study of continuous ratings: levels, the lag behind blinks, and the traces."""

from collections.abc import Sequence
from typing import Any

from analysis.plans.prepare import Prepared
from analysis.plans.result import labels_of
from analysis.report.captions import caption
from analysis.report.contents import Contents, Part, Picture
from analysis.report.formats import Table
from analysis.report.json_output import exclusions_data
from analysis.report.left_out import left_out
from analysis.report.numbers import apa_p, fixed, interval, p_value
from analysis.traces.lag import LagResult, MeanTrace

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
            f"Ratings did not follow blinks: the greatest correlation of their change with blinks, r = "
            f"{fixed(lag.r, 3)} at {fixed(lag.lag_s)} s, is no greater than chance ({apa_p(lag.p)}).",
        )
    return (
        f"Ratings changed {fixed(lag.lag_s)} s after blinks, 95% CI [{fixed(lag.lag_low_s)}, "
        f"{fixed(lag.lag_high_s)}], r = {fixed(lag.r, 3)}, {apa_p(lag.p)}.",
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

    from analysis.report.pictures import BESIDE, COLOURS, STYLE, as_bytes, new_figure, write_note

    earlier_s = lag.lag_s if lag is not None and lag.p < SIGNIFICANCE else 0.0
    made = []
    with mpl.rc_context(STYLE):
        figure = new_figure()
        axes = figure.add_subplot()
        for place, trace in enumerate(traces):
            colour, times = COLOURS[place % len(COLOURS)], trace.times_s - earlier_s
            axes.plot(times, trace.mean, color=colour, label=cell_label(prepared, trace.cell))
            axes.fill_between(times, trace.ci_low, trace.ci_high, color=colour, alpha=0.18, linewidth=0)
        axes.set_xlabel("Time in the clip in s" + (", less the lag" if earlier_s else ""))
        axes.set_ylabel("Rating")
        axes.legend(frameon=False, fontsize=8, **BESIDE)
        note = f"Mean over people with 95% intervals; drawn {fixed(earlier_s)} s earlier than given."
        write_note(figure, note, prepared.synthetic, "answers")
        alt = f"Mean rating over time in {len(traces)} cells"
        made.append(
            Picture("figure-traces", "Mean traces", alt, as_bytes(figure, "svg"), as_bytes(figure, "png"))
        )
        if lag is not None:
            figure = new_figure(height=3.4)
            axes = figure.add_subplot()
            axes.plot(lag.lags_s, lag.mean, color=COLOURS[0])
            axes.fill_between(lag.lags_s, lag.ci_low, lag.ci_high, color=COLOURS[0], alpha=0.18, linewidth=0)
            axes.axvline(lag.lag_s, color=COLOURS[1], linewidth=0.8, linestyle=":")
            axes.axhline(0, color="#888888", linewidth=0.6)
            axes.set_xlabel("Time after a blink in s")
            axes.set_ylabel("Correlation with the rating's change")
            write_note(figure, f"N = {lag.people}. Dotted: the lag.", prepared.synthetic, "answers")
            alt = f"Correlation of ratings with blinks, greatest at {fixed(lag.lag_s)} s"
            made.append(Picture("figure-lag", "Lag", alt, as_bytes(figure, "svg"), as_bytes(figure, "png")))
    return made
