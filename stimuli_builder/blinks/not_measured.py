"""Values that are no lids: one that a tracker repeats for seconds, and zeros where it saw no face."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from stimuli_builder.blinks.column_names import eye_of
from stimuli_builder.blinks.gaps import runs
from stimuli_builder.blinks.profile import OPEN_PERCENTILE, Array

FROZEN_S = 1.0
MAX_REPEATS = 0.1
"""Where more samples than this part repeat the one before, values are coarse, and repeat by themselves."""
REVERSALS_A_S = 6.0
"""Noise goes up and down at least so often in a second; a curve without noise does by its blinks alone."""
SHUT_SHARE = 0.2
"""Part of the way from the least value to the opening below which a value that stays is of shut lids."""
JUMP_SHARE = 0.6
"""Part of the opening that no lid leaves, nor comes back to, from one frame to the next."""
LEAST_JUMP_FPS = 24.5
"""Of 25 frames a second, whose times may tell a little less. In a longer frame a lid goes so far."""
NOT_SEEN = "taken as not seen"
LEFT = "left as it is: nothing else of it closes, so that these may be its blinks"
NEAR_ZERO = 0.1
"""Part of the opening; a series that comes below it without being 0 has lids that meet at 0."""


@dataclass(frozen=True)
class _Kind:
    """Rows that hold no measurement, or may not: (start, stop) of each run, and what they do in words.

    Of a run the first `measured` rows were measured.
    """

    what: str
    spans: Sequence[tuple[int, int]]
    measured: int = 0
    becomes: str = NOT_SEEN

    def when(self, fps: float, times_s: Array) -> str:
        """How often, how long, and from when on."""
        times = "once" if len(self.spans) == 1 else f"{len(self.spans)} times"
        seconds = sum(stop - start for start, stop in self.spans) / fps
        return f"{times}, {seconds:.3g} s, first at {times_s[self.spans[0][0]]:.4g} s"


def without_what_is_not_measured(
    opening: Array, fps: float, times_s: Array, column: str, path: Path, *, turned: bool
) -> tuple[Array, list[str]]:
    """A column, NaN where it holds no measurement, and a line about each reason.

    Parameters
    ----------
    opening : (n,) float64 array
        The column as an opening; NaN where it is known not to be seen.
    fps : float
    times_s : (n,) float64 array
        From the first row.
    turned : bool
        Whether the column was turned round: its zeros are of lids that are shut.
    """
    eye = eye_of(column)
    label = f"{path.name}: '{column}'" + (f" ({eye} eye)" if eye else "")
    kinds = [_Kind("repeats one value for a second or longer", _frozen_runs(opening, fps), measured=1)]
    if not turned and fps >= LEAST_JUMP_FPS:
        kinds.append(_zeros(opening))
    notes, kept = [], opening.copy()
    for kind in kinds:
        if not kind.spans:
            continue
        for start, stop in kind.spans if kind.becomes == NOT_SEEN else ():
            kept[start + kind.measured : stop] = np.nan
        notes.append(f"{label} {kind.what}: {kind.when(fps, times_s)}: {kind.becomes}")
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


def _zeros(values: Array) -> _Kind:
    """Zeros between open lids, in a series that else stays far from 0; not seen where it has other dips."""
    what = "jumps to 0 and back from one frame to the next"
    zero = values == 0
    others = values[np.isfinite(values) & ~zero]
    if not zero.any() or not others.size:
        return _Kind(what, [])
    opening = float(np.percentile(others, OPEN_PERCENTILE))
    if others.min() < NEAR_ZERO * opening:
        return _Kind(what, [])
    low = values < JUMP_SHARE * opening
    # A frame without a value (NaN) beside a zero tells of no lid on its way either: it is not low.
    jumps = [(a, b) for a, b in runs(zero) if not low[max(0, a - 1) : a].any() and not low[b : b + 1].any()]
    has_other_dips = any(not zero[a:b].any() for a, b in runs(low))
    return _Kind(what, jumps, becomes=NOT_SEEN if has_other_dips else LEFT)
