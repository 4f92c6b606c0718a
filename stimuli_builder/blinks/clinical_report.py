"""The report of a recording's blinks as one page: rates, phases, speeds, both eyes, quality, figures."""

import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from jinja2 import Environment, PackageLoader, StrictUndefined

from experiments.errors import counted
from stimuli_builder.blinks.both_eyes import asymmetry_lines
from stimuli_builder.blinks.columns import eye_pair
from stimuli_builder.blinks.extract import EyeBlinks
from stimuli_builder.blinks.plots import sequence_figure, series_figure
from stimuli_builder.blinks.profile import Array
from stimuli_builder.blinks.units import Scale, closure_course

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NEARLY_CLOSED = 0.8
"""Closure from which time counts into the closure ratio (PERCLOS: 80% closed)."""


@dataclass(frozen=True)
class Row:
    """One line of a table: what it is, and one value per eye."""

    name: str
    values: tuple[str, ...]


def report_text(
    source: Path,
    eyes: Sequence[EyeBlinks],
    frame: pd.DataFrame,
    scale: Scale | None,
    doubts: Sequence[str],
) -> str:
    """Return the page (HTML); it needs nothing from elsewhere.

    Parameters
    ----------
    frame : DataFrame
        The blinks table, reviewed.
    doubts : sequence of str
        Lines about the recording's quality in addition to those that are counted here.
    """
    # Rejected blinks are marked in the figure, but count nowhere.
    accepted = frame[frame["accepted"]]
    environment = Environment(
        loader=PackageLoader("stimuli_builder.blinks", "templates"),
        # Names of files and columns are text of others and may hold HTML.
        autoescape=True,
        undefined=StrictUndefined,
    )
    return environment.get_template("report.html.j2").render(
        source=source.name,
        columns=[eye.series.column for eye in eyes],
        blinks=blink_rows(eyes, accepted, scale),
        quality=quality_rows(eyes),
        pairs=[*pair_lines(eyes, accepted), *asymmetry_lines(eyes, _rejected(frame))],
        doubts=list(doubts),
        scale=None if scale is None else f"{scale.mm_per_px:.4f} mm per pixel: {scale.rule}",
        nearly_closed=f"{NEARLY_CLOSED:.0%}",
        figures=[_svg(series_figure(eyes, _rejected(frame))), _svg(sequence_figure(accepted))],
    )


def _rejected(frame: pd.DataFrame) -> set[tuple[str, int]]:
    rows = frame[~frame["accepted"]]
    return {(str(column), int(number)) for column, number in zip(rows["column"], rows["number"], strict=True)}


def blink_rows(eyes: Sequence[EyeBlinks], accepted: pd.DataFrame, scale: Scale | None) -> list[Row]:
    """Lines of the table of blinks, one value per eye; medians with the quartiles."""
    parts = [accepted[accepted["column"] == eye.series.column] for eye in eyes]
    rates = tuple(f"{len(part) / eye.seconds * 60:.1f}" for part, eye in zip(parts, eyes, strict=True))
    # From minimum to minimum, in the order of time.
    pauses = [pd.Series(np.diff(np.sort(part["minimum_s"]))) for part in parts]
    return [
        Row("blinks", tuple(str(len(part)) for part in parts)),
        Row("blinks per minute", rates),
        Row("complete / partial", tuple(_complete(part) for part in parts)),
        *_phase_rows(parts),
        *_speed_rows(parts, scale, is_px=eyes[0].series.is_px),
        Row("interval, s", tuple(_quartiles(part, 2) for part in pauses)),
        Row("time nearly closed (closure ratio)", tuple(_closure_ratio(eye) for eye in eyes)),
    ]


def _phase_rows(parts: Sequence[pd.DataFrame]) -> list[Row]:
    """How long blinks and their phases last, and how far lids close."""
    # The table has both moments in s, but durations in ms.
    closed = [(part["closed_to_s"] - part["closed_from_s"]) * 1000 for part in parts]
    return [
        _spread_row("duration, ms", parts, "duration_ms"),
        _spread_row("closing, ms", parts, "down_ms"),
        Row("closed phase, ms", tuple(_quartiles(part) for part in closed)),
        _spread_row("opening, ms", parts, "up_ms"),
        _spread_row("greatest closure", parts, "closure", 2),
    ]


def _speed_rows(parts: Sequence[pd.DataFrame], scale: Scale | None, *, is_px: bool) -> list[Row]:
    """Amplitudes and speeds, in mm where there is a scale."""
    # Columns of other programs may be ratios, whose unit nobody knows.
    unit, factor = ("px" if is_px else "units", 1.0) if scale is None else ("mm", scale.mm_per_px)
    return [
        _spread_row(f"amplitude, {unit}", parts, "amplitude", 2, factor),
        _spread_row(f"peak closing speed, {unit}/s", parts, "peak_closing_velocity", 1, factor),
        _spread_row(f"peak opening speed, {unit}/s", parts, "peak_opening_velocity", 1, factor),
        Row(
            "main sequence: closing speed over amplitude, 1/s", tuple(_main_sequence(part) for part in parts)
        ),
    ]


def _spread_row(
    name: str, parts: Sequence[pd.DataFrame], column: str, digits: int = 0, factor: float = 1.0
) -> Row:
    return Row(name, tuple(_quartiles(part[column] * factor, digits) for part in parts))


def _complete(part: pd.DataFrame) -> str:
    count = int(part["complete"].sum())
    return f"{count} / {len(part) - count}"


def _quartiles(values: "pd.Series[float]", digits: int = 0) -> str:
    known = values.dropna()
    # No blinks, or none with this measure.
    if known.empty:
        return "-"
    # Quartiles: durations of blinks are skewed.
    low, middle, high = np.percentile(known, [25, 50, 75])
    # The z writes a small negative number as 0, not as -0.
    return f"{middle:z.{digits}f} ({low:z.{digits}f} to {high:z.{digits}f})"


def _main_sequence(part: pd.DataFrame) -> str:
    """Slope through the origin of peak closing speed on amplitude, and their correlation."""
    amplitude, speed = part["amplitude"].to_numpy(), part["peak_closing_velocity"].to_numpy()
    # A line through fewer points, or through equal amplitudes, has no meaning.
    if len(part) < 3 or float(np.ptp(amplitude)) == 0:
        return "-"
    # Through the origin: a blink of no amplitude has no speed.
    slope = float(amplitude @ speed / (amplitude @ amplitude))
    return f"{slope:.1f} (r = {np.corrcoef(amplitude, speed)[0, 1]:.2f})"


def _closure_ratio(eye: EyeBlinks) -> str:
    # Without a blink it is not known where the closed eye is.
    if not eye.blinks:
        return "-"
    closure = closure_course(eye.series, eye.blinks[0].closed_distance)
    # Frames without a value count neither as open nor as closed.
    known: Array = closure[np.isfinite(closure)]
    return f"{(known >= NEARLY_CLOSED).mean():.1%}"


def quality_rows(eyes: Sequence[EyeBlinks]) -> list[Row]:
    """What the recording is worth: length, rate, gaps, and blinks that could not be measured."""
    return [
        Row("frames", tuple(f"{e.series.distance.size:,}" for e in eyes)),
        Row("frames per second", tuple(f"{e.series.fps:g}" for e in eyes)),
        Row("frames without a value", tuple(f"{e.series.missing_frames:,}" for e in eyes)),
        Row("frames in filled gaps", tuple(f"{e.series.bridged_frames:,}" for e in eyes)),
        Row("blinks that could not be measured", tuple(str(len(e.refused)) for e in eyes)),
        Row("squints, gaze shifts, closed eyes", tuple(_others(e) for e in eyes)),
    ]


def _others(eye: EyeBlinks) -> str:
    kinds = [event.kind for event in eye.events]
    return ", ".join(str(kinds.count(kind)) for kind in ("squint", "gaze_shift", "closed_eye"))


def pair_lines(eyes: Sequence[EyeBlinks], accepted: pd.DataFrame) -> list[str]:
    """How both eyes go together, in words; empty for one eye."""
    columns = [eye.series.column for eye in eyes]
    pair = eye_pair(columns)
    if pair is None:
        if len(columns) != 2:
            return []
        return [
            "the column names do not identify left and right (such as EAR_left, EAR_right): blinks are not "
            "paired"
        ]
    # In the order of the table; `pair` has the left eye first.
    columns = [columns[k] for k in sorted(pair)]
    pairs = accepted.dropna(subset=["partner"])
    # A pair is in both rows; the first eye alone counts each pair once.
    first = pairs[pairs["column"] == columns[0]]
    alone = [int((accepted["column"] == c).sum() - (pairs["column"] == c).sum()) for c in columns]
    lines = [
        f"{counted(len(first), 'blink')} in both eyes; {alone[0]} only in {columns[0]}, {alone[1]} only in "
        f"{columns[1]}"
    ]
    if len(first):
        lines.append(
            f"onset of {columns[0]} minus {columns[1]}: {_quartiles(first['partner_lag_ms'])} ms; "
            f"greatest closure: {_quartiles(first['partner_closure'], 2)}"
        )
    return lines


def _svg(figure: "Figure") -> str:
    """A figure as an SVG element, without the XML head and the clock."""
    stream = io.StringIO()
    # Without a date, so that the same recording gives the same bytes.
    figure.savefig(stream, format="svg", metadata={"Date": None})
    text = stream.getvalue()
    # An SVG inside a page has no XML declaration.
    return text[text.index("<svg") :]
