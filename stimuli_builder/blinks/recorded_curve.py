"""The tracked recording itself as an animation curve: every frame's closure, looking down included."""

from collections.abc import Sequence

import numpy as np

from experiments.errors import InputError
from stimuli_builder.blinks.column_names import eye_of
from stimuli_builder.blinks.export.curve import AnimationCurve
from stimuli_builder.blinks.extract import EyeBlinks
from stimuli_builder.blinks.profile import Array
from stimuli_builder.blinks.units import closure_course


def recorded_curve(eyes: Sequence[EyeBlinks]) -> AnimationCurve:
    """Closure of both lids over a whole recording at its own rate, gaps filled by straight lines.

    With one column both eyes move alike; of two, one without a blink stays open.
    The lower lids' motion is the track's where it is known, else 0.

    Raises
    ------
    InputError
        There are more than two columns, or no blink, so that nothing tells the closed level.
    """
    if len(eyes) > 2:
        raise InputError(f"a curve has two eyes; choose them with --column, got {len(eyes)} columns")
    if not any(eye.blinks for eye in eyes):
        columns = ", ".join(f"'{eye.series.column}'" for eye in eyes)
        raise InputError(f"no blink in {columns}: nothing tells where its lids are closed")
    left, right = eyes[0], eyes[-1]
    if len(eyes) == 2 and eye_of(left.series.column) == "right":
        left, right = right, left
    blinks = [(f"blink {b.number}", b.onset_s * left.series.fps) for b in left.blinks or right.blinks]
    lower = left.series
    return AnimationCurve(
        fps=left.series.fps,
        left=_course(left),
        right=_course(right),
        lower_up_mm=_motion(lower.lower_up_mm, lower.distance.size),
        lower_nasal_mm=_motion(lower.lower_nasal_mm, lower.distance.size),
        blinks=tuple(blinks),
    )


def _course(eye: EyeBlinks) -> Array:
    if not eye.blinks:
        return np.zeros(eye.series.distance.size)
    return _filled(closure_course(eye.series, eye.blinks[0].closed_distance))


def _motion(place_mm: Array | None, count: int) -> Array:
    """Motion of the lower lid against its usual place; nothing where no track tells it."""
    if place_mm is None or not np.isfinite(place_mm).any():
        return np.zeros(count)
    return _filled(place_mm - np.nanmedian(place_mm))


def _filled(values: Array) -> Array:
    known = np.flatnonzero(np.isfinite(values))
    return np.interp(np.arange(values.size), known, values[known])
