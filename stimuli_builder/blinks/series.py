"""An inter-eyelid distance over time: read from a plain series or a track, filtered with zero phase."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.errors import InputError, nearest
from stimuli_builder.blinks.column_names import is_high_when_shut
from stimuli_builder.blinks.csv_table import NOTE, few, read_table
from stimuli_builder.blinks.inverted import opening_of
from stimuli_builder.blinks.profile import Array
from stimuli_builder.blinks.times import (
    MAX_BRIDGED_MS,
    RESAMPLED,
    is_time,
    resampled,
    series_fps,
    with_time_s,
)
from stimuli_builder.blinks.tracked_lid import tracked_lower_lid
from stimuli_builder.blinks.validity import CONFIDENCE_COLUMN, VALID_COLUMNS, unseen_rows

PAPER_FPS = 300
DISTANCE_COLUMNS = ("left_distance_px", "right_distance_px", "distance_px")
INDEX_COLUMNS = ("frame", *VALID_COLUMNS, CONFIDENCE_COLUMN)


@dataclass(frozen=True, eq=False)
class BlinkSeries:
    """One eye's distance over a recording.

    Parameters
    ----------
    distance : (n,) float64 array
        Inter-eyelid distance or eye aspect ratio; NaN only where `allow_gaps` left long gaps.
    fps : float
    column : str
        Column it came from.
    is_px : bool
        Whether the distance is in pixels.
    bridged_frames, missing_frames : int
        Frames filled by a straight line, and frames left out of the labelling.
    lower_up_mm, lower_nasal_mm : (n,) float64 array or None
        Place of the lower lid where a track holds it.
    notes : tuple of str
        How its file was read, where that is not plain: semicolons, decimal commas, holes.
    """

    distance: Array
    fps: float
    column: str
    is_px: bool
    bridged_frames: int = 0
    missing_frames: int = 0
    lower_up_mm: Array | None = None
    lower_nasal_mm: Array | None = None
    notes: tuple[str, ...] = ()


def scaled_frames(paper_frames: float, fps: float) -> float:
    """Turn a number of frames of the paper (300 fps) into one at `fps`."""
    return paper_frames * fps / PAPER_FPS


def box_filter(values: Array, width_frames: float) -> Array:
    """Zero-phase moving average over a window of `width_frames`, which need not be a whole number.

    The window is centred, its outermost samples weighted by the part of them it covers: so ten frames
    at 300 fps stay 33 ms at any rate. Ends are averaged over the part of the window that exists.
    """
    reach = int(np.ceil((width_frames - 1) / 2))
    if reach <= 0:
        return values.copy()
    edge = (width_frames - (2 * reach - 1)) / 2
    kernel = np.ones(2 * reach + 1)
    kernel[0] = kernel[-1] = edge
    weight = np.convolve(np.ones(values.size), kernel, mode="full")[reach : reach + values.size]
    return np.asarray(np.convolve(values, kernel, mode="full")[reach : reach + values.size] / weight)


def choose_columns(table: pd.DataFrame, named: Sequence[str], path: Path) -> list[str]:
    """Return the distance columns to label: those named, else a track's, else the only candidate."""
    candidates = [
        str(name)
        for name in table.columns
        if table[name].dtype.kind == "f" and str(name).lower() not in INDEX_COLUMNS and not is_time(str(name))
    ]
    for name in named:
        if name not in table.columns:
            raise InputError(f"{path.name} has no column '{name}'{_near_or_plausible(name, candidates)}")
    if named:
        return list(dict.fromkeys(named))
    tracked = [name for name in DISTANCE_COLUMNS if name in table.columns]
    if tracked:
        return tracked
    if len(candidates) == 1:
        return candidates
    there = few(candidates) or "no column of decimal numbers but the times"
    raise InputError(f"{path.name}: say with --column which series to label; it has {there}")


def _near_or_plausible(name: str, candidates: Sequence[str]) -> str:
    near = nearest(name, candidates)
    if near is not None:
        return f"; did you mean '{near}'?"
    plausible = few([one for one in candidates if one in DISTANCE_COLUMNS] or candidates)
    return f"; expected one of: {plausible}" if plausible else ""


def make_series(
    table: pd.DataFrame,
    column: str,
    fps: float,
    path: Path,
    *,
    allow_gaps: bool | None,
    unseen: NDArray[np.bool_],
) -> BlinkSeries:
    """Return one column as a series: short gaps bridged, long ones kept as NaN or refused.

    `allow_gaps` left at None means: in a track yes (its frames without a fit say why), in a plain series no.
    Gaps of `unseen` frames, which the table itself says were not seen, are never refused.
    """
    values = _numbers(table, column, path)
    values = np.where(np.isfinite(values), values, np.nan)
    if values.size < scaled_frames(300, fps):
        raise InputError(
            f"{path.name}: {values.size} frames at {fps:g} fps are less than a second: nothing to label"
        )
    if not np.isfinite(values).any():
        raise InputError(f"{path.name}: column '{column}' is empty")
    gaps_allowed = (
        column in DISTANCE_COLUMNS and "status" in table.columns if allow_gaps is None else allow_gaps
    )
    reach = round(MAX_BRIDGED_MS * fps / 1000)
    filled, bridged = bridge_gaps(values, reach)
    missing = np.isnan(filled)
    unsaid = missing & ~unseen
    if unsaid.any() and not gaps_allowed:
        first = int(np.argmax(unsaid))
        start = f"{table['time_s'].iloc[first]:.3f} s" if RESAMPLED in table.attrs else f"line {first + 2}"
        rest = unsaid[first:]
        length = int(np.argmin(rest)) if not rest.all() else rest.size
        raise InputError(
            f"{path.name}: column '{column}' has no value on {length} frames from {start} on; "
            "mend the series, or label round the gap with --allow-gaps"
        )
    if np.nanmin(values) < 0:
        raise InputError(
            f"{path.name}: column '{column}' has negative distances ({np.nanmin(values):g}); lids that meet "
            "are 0 apart: set them to 0, or name another column with --column"
        )
    lid = tracked_lower_lid(table, column) if column in DISTANCE_COLUMNS else None
    up, nasal = (None, None) if lid is None else (bridge_gaps(coordinate, reach)[0] for coordinate in lid)
    return BlinkSeries(
        distance=filled,
        fps=fps,
        column=column,
        is_px=column.endswith("_px"),
        bridged_frames=bridged,
        missing_frames=int(missing.sum()),
        lower_up_mm=up,
        lower_nasal_mm=nasal,
    )


def _numbers(table: pd.DataFrame, column: str, path: Path) -> Array:
    """(n,) a column's values; InputError naming the first that is no number."""
    if table[column].dtype.kind not in "fiu":
        words = table[column][pd.to_numeric(table[column], errors="coerce").isna() & table[column].notna()]
        got = f", got {words.iloc[0]!r} in line {words.index[0] + 2}" if words.size else ""
        raise InputError(f"{path.name}: column '{column}' must hold numbers{got}")
    return table[column].to_numpy(dtype=np.float64)


def bridge_gaps(values: Array, most_frames: int) -> tuple[Array, int]:
    """Fill inner runs of NaN no longer than `most_frames` by straight lines; return the number filled."""
    filled = values.copy()
    bridged = 0
    for start, stop in runs(np.isnan(values)):
        if start > 0 and stop < values.size and stop - start <= most_frames:
            share = np.arange(1, stop - start + 1) / (stop - start + 1)
            filled[start:stop] = values[start - 1] + share * (values[stop] - values[start - 1])
            bridged += stop - start
    return filled, bridged


def runs(mask: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return the (start, stop) of every run of True."""
    edges = np.diff(np.concatenate([[0], mask.astype(np.int8), [0]]))
    return list(zip(np.flatnonzero(edges == 1).tolist(), np.flatnonzero(edges == -1).tolist(), strict=True))


def read_series(
    path: Path,
    columns: Sequence[str] = (),
    fps: float | None = None,
    *,
    allow_gaps: bool | None = None,
    resample: bool = False,
    inverted: bool | None = None,
) -> list[BlinkSeries]:
    """Read the distance columns of a plain series or track CSV, see `choose_columns` and `series_fps`.

    `resample` brings uneven times to even ones first. `inverted` says whether high is shut (`opening_of`).
    """
    table, times_note = read_table(path), ""
    if fps is None or resample:
        # A rate that was given stands by itself: columns of these names hold other things too.
        table, times_note = with_time_s(table, path)
    chosen = choose_columns(table, columns, path)
    if resample and "time_s" not in table.columns:
        raise InputError(f"{path.name} has no column time_s: --resample needs the time of every frame")
    rate = series_fps(table, fps, path, uneven=resample)
    unseen, notes = unseen_rows(table, path)
    notes.insert(0, times_note)
    given = {column: np.where(unseen, np.nan, _numbers(table, column, path)) for column in chosen}
    for column in chosen:
        same_kind = [
            one for name, one in given.items() if is_high_when_shut(name) == is_high_when_shut(column)
        ]
        table[column], note = opening_of(
            given[column], column, path, _is_inverted(column, inverted), same_kind
        )
        notes.append(note)
    if resample:
        table, unseen, note = resampled(table, chosen, rate, path, unseen)
        notes.append(note)
    said = tuple(note for note in (str(table.attrs.get(NOTE, "")), *notes) if note)
    eyes = [make_series(table, name, rate, path, allow_gaps=allow_gaps, unseen=unseen) for name in chosen]
    return [replace(eye, notes=said) for eye in eyes]


def _is_inverted(column: str, inverted: bool | None) -> bool | None:
    """A track's own distances are openings."""
    return False if inverted is None and column in DISTANCE_COLUMNS else inverted
