"""The tracked recording itself as an animation curve: every frame's closure, looking down included."""

from collections.abc import Sequence

import numpy as np

from experiments.errors import InputError
from stimuli_builder.blinks.column_names import eye_of
from stimuli_builder.blinks.export.curve import AnimationCurve
from stimuli_builder.blinks.extract import EyeBlinks
from stimuli_builder.blinks.profile import Array
from stimuli_builder.blinks.units import closure_course


def recorded_curve(eyes: Sequence[EyeBlinks], closed: float | None = None) -> AnimationCurve:
    """Closure of both lids over a whole recording at its own rate, gaps filled by straight lines.

    With one column both eyes move alike; of two, one without a blink stays open where `closed` is not given.
    The lower lids' motion is the track's where it is known, else 0.

    Parameters
    ----------
    closed : float, optional
        Distance at lid contact of eyes without a blink.

    Raises
    ------
    InputError
        There are more than two columns, or nothing tells the closed level: no blink, and no `closed`.
    """
    if len(eyes) > 2:
        raise InputError(f"a curve has two eyes; choose them with --column, got {len(eyes)} columns")
    if closed is None and not any(eye.blinks for eye in eyes):
        columns = ", ".join(f"'{eye.series.column}'" for eye in eyes)
        raise InputError(f"no blink in {columns}: nothing tells where its lids are closed: give --closed")
    left, right = eyes[0], eyes[-1]
    if len(eyes) == 2 and eye_of(left.series.column) == "right":
        left, right = right, left
    blinks = [(f"blink {b.number}", b.onset_s * left.series.fps) for b in left.blinks or right.blinks]
    lower = left.series
    return AnimationCurve(
        fps=left.series.fps,
        left=_course(left, closed),
        right=_course(right, closed),
        lower_up_mm=_motion(lower.lower_up_mm, lower.distance.size),
        lower_nasal_mm=_motion(lower.lower_nasal_mm, lower.distance.size),
        blinks=tuple(blinks),
    )


def _course(eye: EyeBlinks, closed: float | None) -> Array:
    level = eye.closed_distance(closed)
    if level is None:
        return np.zeros(eye.series.distance.size)
    return _filled(closure_course(eye.series, level))


def _motion(place_mm: Array | None, count: int) -> Array:
    """Motion of the lower lid against its usual place; nothing where no track tells it."""
    if place_mm is None or not np.isfinite(place_mm).any():
        return np.zeros(count)
    return _filled(place_mm - np.nanmedian(place_mm))


def _filled(values: Array) -> Array:
    known = np.flatnonzero(np.isfinite(values))
    return np.interp(np.arange(values.size), known, values[known])
