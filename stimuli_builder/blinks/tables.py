"""The blinks table (one row per blink) and the summary of a recording."""

import json
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table
from rich.text import Text

from experiments.errors import counted
from experiments.files import whole_file, whole_text
from stimuli_builder.blinks.csv_table import write_table
from stimuli_builder.blinks.extract import EyeBlinks
from stimuli_builder.blinks.measure import MeasuredBlink
from stimuli_builder.blinks.profile import Array, BlinkProfile
from stimuli_builder.blinks.review import Review

BLINK_COLUMNS = {
    "number": "number of the blink in its column, from 1",
    "column": "column of the series; left and right of a track are sides of the picture",
    "onset_frame": "frame at which the eye begins to close",
    "minimum_frame": "frame of the smallest inter-eyelid distance",
    "end_frame": "frame at which the eye is at rest again",
    "onset_s": "onset in seconds from the first frame",
    "minimum_s": "minimum in seconds",
    "end_s": "end in seconds",
    "down_frames": "length of the closing phase in frames of the series",
    "up_frames": "length of the opening phase in frames",
    "down_ms": "length of the closing phase in ms",
    "up_ms": "length of the opening phase in ms",
    "duration_ms": "onset to end in ms",
    "open_distance": "open level at the minimum, interpolated between the resting levels before and after it",
    "minimum_distance": "filtered distance at the minimum",
    "closed_distance": "distance used as lid contact in this column",
    "amplitude": "fall from the open level to the minimum, of the fitted curve if there is one",
    "closure": "greatest closure, 0 open to 1 closed",
    "complete": "true if the closure reaches the limit for a complete blink",
    "peak_closing_velocity": "greatest speed of closing, in the unit of the series per second",
    "peak_opening_velocity": "greatest speed of opening, in the unit of the series per second",
    "rest_before": "closure of the resting eye before the blink, relative to the wider of before and after",
    "rest_after": "closure of the resting eye after the blink, likewise",
    "touches_neighbour": "true if the eye does not come to rest before the neighboring blink",
    "probability": "the classifier's probability that it is a blink; empty with the paper's rule",
    "closed_from_s": "start of the closed phase (95% of the amplitude reached), in seconds; likewise",
    "closed_to_s": "end of the closed phase",
    "down_error_ms": "standard error of down_ms from the fit of the phases; empty with the paper's rule",
    "up_error_ms": "standard error of up_ms; likewise",
    "duration_error_ms": "standard error of duration_ms; likewise",
    "plausible": "false if the phases are implausible or too uncertain; not in medians and spreads",
    "partner": "number of the other eye's simultaneous blink; empty if only one eye blinked",
    "partner_lag_ms": "onset of this blink minus its partner's",
    "partner_closure": "greatest closure of this blink minus its partner's",
    "accepted": "false if a review rejected the blink",
    "reason": "reason given in the review",
}
# One frame at 30 fps, in which the paper gives durations.
DURATION_BIN_MS = 1000 / 30
AMPLITUDE_BINS = 10


EVENT_COLUMNS = {
    "column": "column of the series",
    "kind": "blink, squint, gaze_shift or closed_eye",
    "probability": "the classifier's probability of this kind",
    "frame": "deepest frame",
    "onset_s": "begin of closing in seconds from the first frame",
    "closed_from_s": "start of the deepest phase",
    "minimum_s": "deepest moment",
    "closed_to_s": "end of the deepest phase",
    "end_s": "end of reopening",
    "depth": "greatest depth, as a fraction of the opening",
}


def blinks_frame(
    blinks: Sequence[MeasuredBlink],
    decided: Mapping[tuple[str, int], Review],
    pairs: Sequence[tuple[MeasuredBlink, MeasuredBlink]] = (),
) -> pd.DataFrame:
    """Return the blinks table, columns as in `BLINK_COLUMNS`; `pairs` are the blinks of both eyes."""
    # Both directions: each eye's row names the other's.
    partners = {(one.column, one.number): other for pair in pairs for one, other in (pair, pair[::-1])}
    rows = []
    for blink in blinks:
        review = decided.get((blink.column, blink.number))
        other = partners.get((blink.column, blink.number))
        row = asdict(blink) | {
            "partner": None if other is None else other.number,
            "partner_lag_ms": None if other is None else (blink.onset_s - other.onset_s) * 1000,
            "partner_closure": None if other is None else blink.closure - other.closure,
            # Without a review a blink counts.
            "accepted": review is None or review.decision == "accept",
            "reason": "" if review is None else review.reason,
        }
        rows.append(row)
    frame = pd.DataFrame(rows, columns=list(BLINK_COLUMNS))
    # Rounded below, so that other computers write the same digits.
    numbers = [field.name for field in fields(MeasuredBlink) if field.type in (float, "float")]
    numbers += ["partner_lag_ms", "partner_closure"]
    # Nullable, so that numbers stay whole where a partner is missing.
    frame["partner"] = frame["partner"].astype("Int64")
    truths = ["complete", "plausible", "accepted"]
    frame[truths] = frame[truths].astype(bool)  # of no rows too
    frame[numbers] = frame[numbers].astype(float).round(6)
    return frame


def write_blinks(path: Path, frame: pd.DataFrame) -> None:
    """Write the blinks table as CSV."""
    with whole_file(path) as partial:
        write_table(partial, frame)


def write_events(path: Path, eyes: Sequence[EyeBlinks]) -> None:
    """Write every lid event of every column as CSV, columns as in `EVENT_COLUMNS`."""
    rows = [{"column": eye.series.column} | asdict(event) for eye in eyes for event in eye.events]
    with whole_file(path) as partial:
        write_table(partial, pd.DataFrame(rows, columns=list(EVENT_COLUMNS)).round(6))


def aligned(profiles: Sequence[BlinkProfile]) -> tuple[Array, Array]:
    """Lay profiles on their minima; outside its own length a blink keeps its first or last closure.

    Returns
    -------
    time_ms : (n,) array
        Time from the minimum.
    closures : (profiles, n) array
    """
    # The longest phases decide the width; shorter blinks are held at their ends.
    before = max(profile.minimum_index for profile in profiles)
    after = max(profile.closure.size - profile.minimum_index for profile in profiles)
    rows = [
        np.pad(
            profile.closure,
            (before - profile.minimum_index, after - (profile.closure.size - profile.minimum_index)),
            mode="edge",
        )
        for profile in profiles
    ]
    return np.arange(-before, after) * 1000 / profiles[0].fps, np.array(rows)


def summarise(eye_blinks: EyeBlinks, frame: pd.DataFrame, profiles: Sequence[BlinkProfile]) -> dict[str, Any]:
    """Return rate, spread and histograms of one column's accepted blinks, with the mean blink."""
    series = eye_blinks.series
    rows = frame[frame["accepted"] & (frame["column"] == series.column)]
    minutes = eye_blinks.seconds / 60
    # Rates count every blink; only phases and closure need plausible ones.
    believed = rows[rows["plausible"]]
    durations, closures = believed["duration_ms"].to_numpy(), believed["closure"].to_numpy()
    return {
        "column": series.column,
        "fps": round(series.fps, 4),
        "minutes": round(minutes, 4),
        "blinks": len(rows),
        "rejected": int((frame["column"] == series.column).sum() - len(rows)),
        "refused": [asdict(refused) for refused in eye_blinks.refused],
        "other_events": dict(Counter(event.kind for event in eye_blinks.events if event.kind != "blink")),
        "asymmetry": _asymmetry(eye_blinks),
        "bridged_frames": series.bridged_frames,
        "missing_frames": series.missing_frames,
        "rate_per_minute": round(len(rows) / minutes, 3),
        "complete": int(rows["complete"].sum()),
        "implausible": int((~rows["plausible"]).sum()),
        **_spreads(rows),
        "duration_histogram": duration_histogram(durations),
        "amplitude_histogram": amplitude_histogram(closures),
        "mean_blink": _mean_blink(profiles),
    }


def _spreads(rows: pd.DataFrame) -> dict[str, dict[str, float]]:
    """Spread of every measure of blinks, by the summary's name of it; of plausible blinks alone."""
    every, rows = rows, rows[rows["plausible"]]
    closing, opening = rows["peak_closing_velocity"], rows["peak_opening_velocity"]
    measures = {name: rows[name] for name in ("duration_ms", "down_ms", "up_ms", "closure")} | {
        "opening_to_closing_velocity": opening / closing,
        "peak_velocity_to_amplitude_per_s": closing / rows["amplitude"],
    }
    spreads = {name: _spread(values.to_numpy()) for name, values in measures.items()}
    # Intervals of every blink: one that is left out would join two intervals into one.
    return spreads | {"interval_s": _spread(np.diff(every["minimum_s"].to_numpy()))}


def _asymmetry(eye_blinks: EyeBlinks) -> dict[str, Any] | None:
    """What the eye does at the other's blinks; None for one eye, and by the paper's rule."""
    side = None if eye_blinks.recognised is None else eye_blinks.recognised.asymmetry
    return None if side is None else asdict(side) | {"share": round(side.share, 4)}


def write_summary(path: Path, summaries: Sequence[dict[str, Any]]) -> None:
    """Write the summaries of all columns as JSON."""
    with whole_text(path) as stream:
        stream.write(json.dumps({"columns": list(summaries)}, indent=1) + "\n")


def duration_histogram(durations_ms: Array) -> dict[str, list[float] | list[int]]:
    """Count durations in bins of one frame at 30 fps, as in the paper's Figure 6c."""
    if not durations_ms.size:
        return {"edges_ms": [], "counts": []}
    # A duration exactly on an edge belongs to the bin above it.
    last = int(np.ceil((durations_ms.max() + 1e-9) / DURATION_BIN_MS))
    edges = np.arange(last + 1) * DURATION_BIN_MS
    counts, _ = np.histogram(durations_ms, bins=edges)
    return {"edges_ms": np.round(edges, 3).tolist(), "counts": counts.tolist()}


def amplitude_histogram(closures: Array) -> dict[str, list[float] | list[int]]:
    """Count greatest closures in tenths from 0 to 1."""
    edges = np.linspace(0.0, 1.0, AMPLITUDE_BINS + 1)
    counts, _ = np.histogram(closures, bins=edges)
    return {"edges": np.round(edges, 3).tolist(), "counts": counts.tolist()}


def _spread(values: Array) -> dict[str, float]:
    if not values.size:
        return {}
    # One blink has no spread.
    sd = float(values.std(ddof=1)) if values.size > 1 else 0.0
    spread = {"mean": values.mean(), "sd": sd, "median": np.median(values), "min": values.min()}
    return {name: round(float(value), 4) for name, value in (spread | {"max": values.max()}).items()}


def _mean_blink(profiles: Sequence[BlinkProfile]) -> dict[str, list[float]]:
    if not profiles:
        return {}
    time_ms, closures = aligned(profiles)
    return {
        "from_minimum_ms": np.round(time_ms, 3).tolist(),
        # Five decimals of a closure are far below what a camera resolves.
        "closure": np.round(closures.mean(axis=0), 5).tolist(),
    }


# What `stimuli blinks` prints: a table of the columns, and a line for all that is not plain.

FEW_BLINKS = 3
"""Fewer than these say nothing of how far this person's lids close at most."""
MAX_NAME = 17
"""Letters of a column's name that leave the figures their width on a screen of 80."""
HEADERS = ("blinks", "/min", "complete", "rejected", "down", "up", "total", "closure")


def print_blinks(summaries: Sequence[dict[str, Any]], lost: Sequence[Review], *, closed_given: bool) -> None:
    """Print the table of all columns, and below it what was left out and seen besides."""
    console = Console(markup=False, highlight=False)  # names of columns are no markup: left [mm]
    table = Table(box=SIMPLE_HEAD, pad_edge=False, collapse_padding=True)
    table.add_column("column", no_wrap=True)
    for header in HEADERS:
        table.add_column(header, justify="right", no_wrap=True)
    table.caption, table.caption_justify = "down, up, total in ms; these and closure: medians", "left"
    for row in summaries:
        medians = [_median(row[name], 0) for name in ("down_ms", "up_ms", "duration_ms")]
        counts = [str(row["blinks"]), f"{row['rate_per_minute']:.1f}", str(row["complete"])]
        table.add_row(
            Text(shortened(row["column"])),
            *counts,
            str(row["rejected"]),
            *medians,
            _median(row["closure"], 2),
        )
    console.print(table)
    for row in summaries:
        for line in _column_lines(row, closed_given=closed_given):
            console.print(f"{row['column']}: {line}")
    for review in lost:
        console.print(
            f"the review names a blink at frame {review.minimum_frame} of {review.column}, but there is none"
        )


def shortened(name: str, longest: int = MAX_NAME) -> str:
    """A name of at most `longest` letters, an ellipsis for its middle: both ends distinguish columns."""
    if len(name) <= longest:
        return name
    # One letter less for the ellipsis.
    end = (longest - 1) // 2
    return f"{name[: longest - 1 - end]}…{name[-end:]}"


def _column_lines(row: dict[str, Any], *, closed_given: bool) -> list[str]:
    lines = []
    # With a given level the blinks need not show it.
    if 0 < row["blinks"] < FEW_BLINKS and not closed_given:
        lines.append(
            "there are too few blinks to decide which are complete: their own deepest level was used as "
            "closed; add --closed if it is known"
        )
    lines += [f"minimum at frame {one['minimum']} excluded: {one['reason']}" for one in row["refused"]]
    if row["other_events"]:
        kinds = [f"{count} {kind.replace('_', ' ')}" for kind, count in row["other_events"].items()]
        lines.append(f"other events: {', '.join(kinds)}")
    if row["missing_frames"]:
        lines.append(f"{row['missing_frames']} frames without a value were excluded")
    if row["bridged_frames"]:
        lines.append(f"{row['bridged_frames']} frames in short gaps were interpolated")
    return lines


def print_written(blinks: int, written: Iterable[Path | None]) -> None:
    """Print how many blinks there are in all columns, and the files that were written."""
    # None where a file was not wanted.
    paths = ", ".join(str(path) for path in written if path is not None)
    Console(markup=False, highlight=False).print(f"{counted(blinks, 'blink')}; wrote {paths}")


def _median(spread: Mapping[str, float], digits: int) -> str:
    return f"{spread['median']:.{digits}f}" if spread else "-"
