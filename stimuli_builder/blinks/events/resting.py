"""Where the lid rests just before and just after a dip, and how far that rest reaches.

A gaze shift near a blink changes the level at which the lid rests. The level before a blink is therefore
read from the nearest stretch in which the lid rests, not from the most open frame around, and the fit of the
phases sees no sample beyond that stretch.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import sqrt

import numpy as np

from stimuli_builder.blinks.events.candidates import Candidate
from stimuli_builder.blinks.events.levels import SMOOTHING_S, Depth
from stimuli_builder.blinks.profile import Array

CLOSING_S, OPENING_S = 0.6, 1.2
"""A lid comes from rest, and to rest, within this time before and after the half of its way."""
REST_S = (0.05, 0.08)
"""Shortest rest before and after a dip; the slow end of an opening is flat for longer."""
REST_TO_S = (0.25, 0.45)
"""As much of a rest as the fit of the phases sees."""
STILL = 0.06
"""Part of the way back to which the lid moves no more while it rests."""
OUT = 0.15
"""Part of the way up to which a flat stretch is the bottom of the dip, not a rest."""
NOISES = 4.0


@dataclass(frozen=True)
class Rest:
    """The resting lid on one side of a dip.

    Parameters
    ----------
    near, far : int
        The frames nearest to the dip and furthest from it.
    level : float
        Depth at which the lid rests.
    """

    near: int
    far: int
    level: float


def rests_about(candidate: Candidate, depth: Depth, bounds: tuple[int, int]) -> tuple[Rest, Rest]:
    """The rests before and after a dip, neither beyond `bounds` (frames of the piece)."""
    return _rest(candidate, depth, bounds[0], -1), _rest(candidate, depth, bounds[1], 1)


def bounds_of(candidates: Sequence[Candidate], depth: Depth) -> list[tuple[int, int]]:
    """For each dip the widest open frames between it and the dips before and after, else the piece's ends.

    Two dips between which the lid hardly opens are the bottom of one, and do not bound one another.
    """
    last = depth.smooth.size - 1
    before, after = [0] * len(candidates), [last] * len(candidates)
    for number, (first, second) in enumerate(pairwise(candidates)):
        widest = first.peak + int(np.argmin(depth.smooth[first.peak : second.peak + 1]))
        opens = min(first.depth, second.depth) - float(depth.smooth[widest])
        parted = opens >= OUT * min(first.prominence, second.prominence)
        after[number] = widest if parted else -1
        before[number + 1] = widest if parted else -1
    for number in range(1, len(candidates)):
        before[number] = before[number - 1] if before[number] < 0 else before[number]
    for number in range(len(candidates) - 2, -1, -1):
        after[number] = after[number + 1] if after[number] < 0 else after[number]
    return list(zip(before, after, strict=True))


def _rest(candidate: Candidate, depth: Depth, bound: int, step: int) -> Rest:
    side, fps, peak = int(step > 0), depth.fps, candidate.peak
    half = (candidate.right if side else candidate.left)[1]
    reach = abs(half - peak) + (CLOSING_S, OPENING_S)[side] * fps
    last = min(abs(bound - peak), int(reach))
    values = depth.smooth[peak - last : peak + 1][::-1] if step < 0 else depth.smooth[peak : peak + last + 1]
    noise = NOISES * _smooth_noise(depth)
    width = max(1, round(REST_S[side] * fps))
    near = _first_rest(values, width, noise)
    if near is None:
        lowest = int(np.argmin(values))
        return Rest(peak + step * lowest, peak + step * lowest, float(values[lowest]))
    far = _end_of_rest(values, near, width, max(width, round(REST_TO_S[side] * fps)), noise)
    level = float(np.median(values[near : far + 1]))
    return Rest(peak + step * near, peak + step * far, level)


def _smooth_noise(depth: Depth) -> float:
    """Noise of a smoothed frame."""
    return depth.noise / sqrt(max(1.0, SMOOTHING_S * depth.fps))


def _first_rest(values: Array, width: int, noise: float) -> int | None:
    """The first value, outwards from the deepest, from which on the lid rests for `width` frames."""
    if values.size <= width:
        return None
    windows = np.lib.stride_tricks.sliding_window_view(values, width + 1)
    level = windows.mean(1)
    way = values[0] - level
    moves = windows.max(1) - windows.min(1)
    least = max(OUT * float(values[0] - values.min()), 1.5 * noise)
    still = np.flatnonzero((way >= least) & (moves <= STILL * way + noise))
    return int(still[0]) if still.size else None


def _end_of_rest(values: Array, near: int, width: int, longest: int, noise: float) -> int:
    """The last value, outwards, that is as the rest which begins at `near`."""
    level = float(np.median(values[near : near + width + 1]))
    off = np.abs(values[near:] - level) > STILL * (values[0] - level) + noise
    left = np.flatnonzero(off[: longest + 1])
    return min(near + (int(left[0]) - 1 if left.size else longest), values.size - 1)
