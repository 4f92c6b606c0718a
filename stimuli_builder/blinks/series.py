"""An inter-eyelid distance over time: read from a plain series or a track, filtered with zero phase."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.errors import InputError
from stimuli_builder.blinks.columns import (
    DISTANCE_COLUMNS,
    NOT_SEEN,
    choose_columns,
    is_high_when_shut,
    opening_of,
    unseen_rows,
    without_what_is_not_measured,
)
from stimuli_builder.blinks.csv_table import NOTE, line_of, read_table
from stimuli_builder.blinks.profile import Array
from stimuli_builder.blinks.times import (
    MAX_BRIDGED_MS,
    RESAMPLED,
    TIMES,
    are_uneven,
    bridge_gaps,
    refuse_other_rate,
    resampled,
    series_fps,
    with_time_s,
)

# The lower lid's motion as a track measured it.

FISSURE_LENGTH_MM = 28.2
"""Outer to inner canthus, as on the realistic character; it gives a track its scale."""
_OUTER_CANTHUS, _INNER_CANTHUS, _LOWER_LID = 0, 5, slice(6, 9)


def tracked_lower_lid(table: pd.DataFrame, column: str) -> tuple[Array, Array] | None:
    """Place of the lower lid over a track, in mm, or None where the table has no landmarks of that eye.

    The mean of the three lower-lid points along and across the eye's axis (outer to inner canthus, median
    over the recording). In the picture's frame, not the canthi's: these move in a blink themselves. A
    close-up of one eye does not show where the nose is: there it is the side to which the lid slides.

    Returns
    -------
    up_mm, nasal_mm : (n,) float64 arrays
        From an arbitrary origin; NaN on frames without a fit.
    """
    # A track numbers points from 1, the image-left eye first.
    first = 10 if column == "right_distance_px" else 1
    names = [f"{axis}{point:02d}" for point in range(first, first + 9) for axis in "xy"]
    if not set(names) <= set(table.columns):
        return None
    points = table[names].to_numpy(dtype=np.float64).reshape(-1, 9, 2)
    # Frames without a fit have empty cells.
    known = np.isfinite(points).all(axis=(1, 2))
    if not known.any():
        return None
    axis = np.median(points[known, _INNER_CANTHUS] - points[known, _OUTER_CANTHUS], axis=0)
    length_px = float(np.hypot(*axis))
    # From the outer to the inner canthus.
    nasal = axis / max(length_px, 1e-9)
    # Square to the axis; which of both directions is up depends on the side of the nose.
    upwards = np.array([nasal[1], -nasal[0]]) * (1.0 if nasal[0] >= 0 else -1.0)
    lid_mm = points[:, _LOWER_LID].mean(axis=1) * FISSURE_LENGTH_MM / max(length_px, 1e-9)
    up_mm, nasal_mm = lid_mm @ upwards, lid_mm @ nasal
    # A lower lid slides to the nose when the eye closes; a close-up may be turned the other way.
    if column == "distance_px" and _moves_back(nasal_mm[known], table.loc[known, column].to_numpy()):
        nasal_mm = -nasal_mm
    return up_mm, nasal_mm


def _moves_back(place_mm: Array, distance: Array) -> bool:
    # Halfway between least and greatest distance.
    shut = distance < (distance.min() + distance.max()) / 2
    if not shut.any():
        return False
    return bool(np.median(place_mm[shut]) < np.median(place_mm[~shut]))


PAPER_FPS = 300
EYE_COLUMNS = frozenset({"left_distance_px", "right_distance_px"})
SIDES = "left and right are sides of the picture (the left eye is the person's right, unless it is mirrored)"
"""A track knows the picture, not whether the camera mirrored it."""


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
        Frames filled by a straight line, and frames left out of the labeling.
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

    The window is centered, its outermost samples weighted by the part of them it covers: so ten frames
    at 300 fps stay 33 ms at any rate. Ends are averaged over the part of the window that exists.
    """
    reach = int(np.ceil((width_frames - 1) / 2))
    # At a low rate the window is a single frame.
    if reach <= 0:
        return values.copy()
    # The part of each outermost sample that the window covers.
    edge = (width_frames - (2 * reach - 1)) / 2
    kernel = np.ones(2 * reach + 1)
    kernel[0] = kernel[-1] = edge
    # Ends are divided by the part of the window that exists, else every series would begin and end half
    # shut.
    weight = np.convolve(np.ones(values.size), kernel, mode="full")[reach : reach + values.size]
    return np.asarray(np.convolve(values, kernel, mode="full")[reach : reach + values.size] / weight)


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
    Gaps of `unseen` frames (n,), which are known not to have been seen, are never refused.
    """
    values = _known_values(table, column, fps, path)
    # In time, not frames: what a lid can do in a gap depends on its length.
    reach = round(MAX_BRIDGED_MS * fps / 1000)
    filled, bridged = bridge_gaps(values, reach)
    missing = np.isnan(filled)
    is_track = column in DISTANCE_COLUMNS and "status" in table.columns
    if not (is_track if allow_gaps is None else allow_gaps):
        # Frames that the table itself calls invalid need no excuse.
        _refuse_gaps(missing & ~unseen, table, column, path)
    lid = tracked_lower_lid(table, column) if column in DISTANCE_COLUMNS else None
    up, nasal = (None, None) if lid is None else (bridge_gaps(coordinate, reach)[0] for coordinate in lid)
    return BlinkSeries(
        distance=filled,
        fps=fps,
        column=column,
        # Names of tracks end in the unit; other columns may be ratios.
        is_px=column.endswith("_px"),
        bridged_frames=bridged,
        missing_frames=int(missing.sum()),
        lower_up_mm=up,
        lower_nasal_mm=nasal,
    )


def _known_values(table: pd.DataFrame, column: str, fps: float, path: Path) -> Array:
    """(n,) values, NaN where there is none; InputError where they are too few, or no distances."""
    values = _numbers(table, column, path)
    values = np.where(np.isfinite(values), values, np.nan)
    # One second at any rate: levels of an open eye cannot be found in less.
    if values.size < scaled_frames(300, fps):
        raise InputError(
            f"{path.name}: {values.size} frames at {fps:g} fps are less than one second, which is too short"
        )
    if not np.isfinite(values).any():
        raise InputError(f"{path.name}: column '{column}' is empty")
    if np.nanmin(values) < 0:
        raise InputError(
            f"{path.name}: column '{column}' has negative distances ({np.nanmin(values):g}); the smallest "
            "possible distance is 0: set them to 0, or select another column with --column"
        )
    return values


def _refuse_gaps(gaps: NDArray[np.bool_], table: pd.DataFrame, column: str, path: Path) -> None:
    """InputError that names the first unexplained gap (n,)."""
    if not gaps.any():
        return
    first = int(np.argmax(gaps))
    start = f"line {line_of(path, first)}"
    # After resampling rows are no longer lines of the file.
    if RESAMPLED in table.attrs:
        start = f"{table['time_s'].iloc[first]:.3f} s"
    rest = gaps[first:]
    length = int(np.argmin(rest)) if not rest.all() else rest.size
    raise InputError(
        f"{path.name}: column '{column}' has no value for {length} frames from {start} on; correct the "
        "series, or add --allow-gaps"
    )


def _numbers(table: pd.DataFrame, column: str, path: Path) -> Array:
    """(n,) a column's values; InputError naming the first that is not a number."""
    if table[column].dtype.kind not in "fiu":
        words = table[column][pd.to_numeric(table[column], errors="coerce").isna() & table[column].notna()]
        got = f", got {words.iloc[0]!r} in line {line_of(path, int(words.index[0]))}" if words.size else ""
        raise InputError(f"{path.name}: column '{column}' must have numbers{got}")
    return table[column].to_numpy(dtype=np.float64)


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
    # A rate that was given wins over times in the file.
    if fps is None or resample:
        table, times_note = with_time_s(table, path)
    elif "time_s" not in table.columns:
        refuse_other_rate(table, fps, path)
    chosen, left_out = choose_columns(table, columns, path)
    # Without times nothing shows how uneven they are.
    if resample and "time_s" not in table.columns:
        raise InputError(f"{path.name} has no column time_s: --resample needs the time of every frame")
    if not resample and TIMES in table.attrs and are_uneven(table):
        # Stamps of a camera or tracker: their steps differ by nature, unlike the even ones of a time_s.
        resample, times_note = True, f"{times_note}; uneven, so resampled to a constant rate"
    rate = series_fps(table, fps, path, uneven=resample)
    unseen, notes = unseen_rows(table, chosen, path)
    notes = [times_note, *left_out, *notes, *_set_openings(table, chosen, path, inverted, unseen, rate)]
    if resample:
        table, unseen, note = resampled(table, chosen, rate, path, unseen)
        notes.append(note)
    if any(name in EYE_COLUMNS for name in chosen):
        notes.append(f"{path.name}: {SIDES}")
    said = tuple(note for note in (str(table.attrs.get(NOTE, "")), *notes) if note)
    eyes = [
        make_series(table, name, rate, path, allow_gaps=allow_gaps, unseen=unseen[name]) for name in chosen
    ]
    return [replace(eye, notes=said) for eye in eyes]


def _set_openings(
    table: pd.DataFrame,
    chosen: Sequence[str],
    path: Path,
    inverted: bool | None,
    unseen: dict[str, NDArray[np.bool_]],
    fps: float,
) -> list[str]:
    """Make openings of the chosen columns, NaN where nothing was measured, and note such rows as unseen."""
    notes = []
    given = {column: np.where(unseen[column], np.nan, _numbers(table, column, path)) for column in chosen}
    for column, values in given.items():
        missing = _not_measured(values)
        if missing.any():
            notes.append(f"{path.name}: '{column}' is -1 on {missing.sum():,} frames: {NOT_SEEN}")
            given[column] = np.where(missing, np.nan, values)
            unseen[column] = unseen[column] | missing
    times_s = np.arange(len(table)) / fps
    if "time_s" in table.columns:
        times_s = table["time_s"].to_numpy(dtype=np.float64) - float(table["time_s"].iloc[0])
    # After all columns have lost their -1, since the other eye's top counts for both.
    for column in chosen:
        same_kind = [
            one for name, one in given.items() if is_high_when_shut(name) == is_high_when_shut(column)
        ]
        opening, note = opening_of(given[column], column, path, _is_inverted(column, inverted), same_kind)
        table[column], lost = without_what_is_not_measured(
            opening, fps, times_s, column, path, turned=bool(note)
        )
        # A gap that was explained is not refused later.
        unseen[column] = unseen[column] | (np.isfinite(opening) & table[column].isna().to_numpy())
        notes += [note, *lost]
    return notes


def _not_measured(values: Array) -> NDArray[np.bool_]:
    """(n,) where a column holds -1, by which trackers (PupilEXT) say that they measured nothing.

    A column with other negative numbers is no such column.
    """
    negative = values < 0
    # Without negative numbers `all` is true, and nothing is marked.
    return negative & bool((values[negative] == -1).all())


def _is_inverted(column: str, inverted: bool | None) -> bool | None:
    """A track's own distances are openings."""
    return False if inverted is None and column in DISTANCE_COLUMNS else inverted
