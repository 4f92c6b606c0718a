"""Figures of continuous ratings: a panel a cell with its blinks marked, and the correlation by lag."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from analysis.report.contents import Picture
from analysis.report.numbers import fixed
from analysis.report.pictures import COLOURS, in_both_formats, new_figure, write_note
from analysis.traces import LagResult, MeanTrace

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
    note = f"Mean over people with 95% intervals, drawn {fixed(earlier_s)} s earlier than recorded. "
    write_note(figure, note + "Marks: blinks, one row per clip.", synthetic, "answers")
    alt = f"Mean rating over time in {len(traces)} cells, with blinks marked"
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
