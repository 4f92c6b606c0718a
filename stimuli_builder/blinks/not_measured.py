"""Values that are no lids: one that a tracker repeats for seconds, and zeros where it saw no face."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from stimuli_builder.blinks.column_names import eye_of
from stimuli_builder.blinks.gaps import runs
from stimuli_builder.blinks.profile import Array

FROZEN_S = 1.0
MAX_REPEATS = 0.1
"""Where more samples than this part repeat the one before, values are coarse, and repeat by themselves."""
REVERSALS_A_S = 6.0
"""Noise goes up and down at least so often in a second; a curve without noise does by its blinks alone."""
SHUT_SHARE = 0.2
"""Part of the way from the least value to the opening below which a value that stays is of shut lids."""
OPEN_PERCENTILE = 85
JUMP_SHARE = 0.6
"""Part of the opening that no lid leaves, nor comes back to, from one frame to the next."""
NEAR_ZERO = 0.1
"""Part of the opening; a series that comes below it without being 0 has lids that meet at 0."""


def not_measured(
    opening: Array, fps: float, times_s: Array, *, turned: bool
) -> list[tuple[str, NDArray[np.bool_], str]]:
    """Rows of one column that hold no measurement.

    Parameters
    ----------
    opening : (n,) float64 array
        The column as an opening; NaN where it is known not to be seen.
    fps : float
    times_s : (n,) float64 array
        From the first row.
    turned : bool
        Whether the column was turned round: its zeros are of lids that are shut.

    Returns
    -------
    list of (str, bool array (n,), str)
        What such rows do, which they are, and how often, how long and from when on.
    """
    kinds = [("repeats one value for a second or longer", _frozen_runs(opening, fps), 1)]
    if not turned:
        kinds.append(("jumps to 0 and back from one frame to the next", _lost_runs(opening), 0))
    told = []
    for what, spans, first in kinds:
        rows = np.zeros(opening.size, np.bool_)
        for start, stop in spans:
            rows[start + first : stop] = True  # the first of equal values was measured
        if spans:
            times = "once" if len(spans) == 1 else f"{len(spans)} times"
            seconds = sum(stop - start for start, stop in spans) / fps
            told.append((what, rows, f"{times}, {seconds:.3g} s, first at {times_s[spans[0][0]]:.4g} s"))
    return told


def without_what_is_not_measured(
    opening: Array, fps: float, times_s: Array, column: str, path: Path, *, turned: bool
) -> tuple[Array, list[str]]:
    """A column, NaN where it holds no measurement, and a line about each reason; see `not_measured`."""
    eye = eye_of(column)
    label = f"{path.name}: '{column}'" + (f" ({eye} eye)" if eye else "")
    notes, kept = [], opening.copy()
    for what, rows, when in not_measured(opening, fps, times_s, turned=turned):
        kept[rows] = np.nan
        notes.append(f"{label} {what}: {when}: taken as not seen")
    return kept, notes


def _frozen_runs(values: Array, fps: float) -> list[tuple[int, int]]:
    """(start, stop) of equal values for `FROZEN_S` or longer, between shut lids and the greatest value.

    Only where the series has noise elsewhere; in a curve without noise a lid at rest repeats its value.
    """
    repeats = np.concatenate([[False], values[1:] == values[:-1]])
    spans = [(a - 1, b) for a, b in runs(repeats) if b - a + 1 >= FROZEN_S * fps]
    elsewhere = np.isfinite(values)
    for start, stop in spans:
        elsewhere[start:stop] = False
    if not spans or not _has_noise(values, elsewhere, fps):
        return []
    low, middle, high = np.percentile(values[elsewhere], [0, OPEN_PERCENTILE, 100])
    shut = low + SHUT_SHARE * (middle - low)
    return [(start, stop) for start, stop in spans if shut < values[start] < high]


def _has_noise(values: Array, elsewhere: NDArray[np.bool_], fps: float) -> bool:
    """Whether a second or more elsewhere goes up and down as noise does, and seldom repeats a value."""
    steps = np.diff(values)[elsewhere[1:] & elsewhere[:-1]]
    if steps.size < fps:
        return False
    signs = np.sign(steps[steps != 0])
    reversals = float((signs[1:] != signs[:-1]).sum())
    return bool((steps == 0).mean() <= MAX_REPEATS and reversals >= REVERSALS_A_S * steps.size / fps)


def _lost_runs(values: Array) -> list[tuple[int, int]]:
    """(start, stop) of zeros between open lids, in a series that else stays far from 0."""
    zero = values == 0
    others = values[np.isfinite(values) & ~zero]
    if not zero.any() or not others.size:
        return []
    opening = float(np.percentile(others, OPEN_PERCENTILE))
    if others.min() < NEAR_ZERO * opening:
        return []
    beside = [(values[max(0, a - 1) : a], values[b : b + 1], (a, b)) for a, b in runs(zero)]
    return [
        span
        for before, after, span in beside
        if (np.concatenate([before, after]) >= JUMP_SHARE * opening).all()
    ]
