"""Checks in the study's own look: which blink came first, and which eye closed first.

The two answers' clips hold the same pictures, one in the reverse order of the other: every blink closes as it
opens. A picture alone says nothing; two pictures in their order say all, as in a study's clips themselves.
"""

import numpy as np

from stimuli_builder.blinks.profile import PROFILE_FPS
from stimuli_builder.clips.curves import DECIMALS, Array, ClipCurve

BLINK_S = 0.36
REST_S = 0.13
"""Open eyes at least this long before, between and after blinks."""

Generator = np.random.Generator


def first_blink(answer: int, difficulty: float, seconds: float, rng: Generator) -> ClipCurve:
    """A full and a half blink; 1: the full one comes first. The half one closes by 0.4 to 0.75."""
    length, blink = _samples(seconds), _samples(BLINK_S)
    free = length - 2 * blink - 3 * _samples(REST_S)
    before, between = np.sort(rng.integers(0, free + 1, 2))
    heights = (1.0, 0.4 + 0.35 * difficulty)
    closure = np.zeros(length)
    first = _samples(REST_S) + int(before)
    second = first + blink + _samples(REST_S) + int(between - before)
    for start, height in zip((first, second), heights, strict=True):
        closure[start : start + blink] = height * _bump(blink)
    return _turned(ClipCurve(_rounded(closure), first), turned=answer == 2)


def first_eye(answer: int, difficulty: float, seconds: float, rng: Generator) -> ClipCurve:
    """One blink of both eyes; 1: that at the left of the picture is first, by 200 to 67 ms by difficulty."""
    length, blink = _samples(seconds), _samples(BLINK_S)
    lag = _samples((6 - 4 * difficulty) / 30)
    start = _samples(REST_S) + int(rng.integers(0, length - blink - lag - 2 * _samples(REST_S) + 1))
    at_left, at_right = np.zeros(length), np.zeros(length)
    at_left[start : start + blink] = _bump(blink)
    at_right[start + lag : start + lag + blink] = _bump(blink)
    # `closure` is of the character's left eye, which is seen at the right.
    curve = ClipCurve(_rounded(at_right), start, closure_other=_rounded(at_left))
    return _turned(curve, turned=answer == 2)


def _samples(seconds: float) -> int:
    return round(seconds * PROFILE_FPS)


def _bump(length: int) -> Array:
    """A blink that closes as it opens: sin^2 over its length."""
    return np.asarray(np.sin(np.pi * (np.arange(length) + 0.5) / length) ** 2)


def _rounded(closure: Array) -> Array:
    return np.round(closure, DECIMALS)


def _turned(curve: ClipCurve, *, turned: bool) -> ClipCurve:
    if not turned:
        return curve
    other = None if curve.closure_other is None else curve.closure_other[::-1].copy()
    return ClipCurve(curve.closure[::-1].copy(), curve.onset_sample, closure_other=other)
