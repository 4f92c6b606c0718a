"""How far off a fitted frame may be: stated from frames left out of training, the picture and a detector."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from stimuli_builder.compiled import compiled, compiled_over
from stimuli_builder.tracking import shapes
from stimuli_builder.tracking.accuracy import HeldOut
from stimuli_builder.tracking.fit import Fit
from stimuli_builder.tracking.model import CoupledModel, with_residual_limits
from stimuli_builder.tracking.shapes import CANTHI, EYE_POINTS, LOWER_LID, UPPER_LID, Points, widths

Values = NDArray[np.float64]

DOUBTFUL_SHARE = 0.05
"""A frame whose stated error is above this part of the eye's width is doubtful."""
DIFFERING_SHARE = 0.06
"""Mean distance of the lids from a detector's, as part of the eye's width, that makes a frame doubtful."""
UNUSUAL_SD = 2.5
"""Root mean square of the coupled parameters in standard deviations that no labeled frame reaches."""
JUMP_SHARE = 0.35
"""A canthus does not move by more of the eye's width from one frame to the next."""
STEEPEST = 2.0
UPPER_CURVE = (0, 1, 2, 3, 4, 5)
LOWER_CURVE = (5, 6, 7, 8, 0)
"""Points of an eye that its lids' curves go through, canthi included."""


def with_errors(model: CoupledModel, held_out: Sequence[HeldOut], limits: Values) -> CoupledModel:
    """Give a model what its errors are stated from: labeled frames left out of training.

    log(frame error) is regressed on log(residual / usual residual); the slope is kept between 0 and 2 and
    shrunk as by ten more frames without a slope. A stated error is the root mean square on such frames,
    those aside that tracking would not take: with a residual above `limits` (eyes,), or found elsewhere.
    """
    seen = [one for one in held_out if _would_be_taken(one, limits)]
    if not seen:
        return with_residual_limits(model, limits)
    residuals = np.array([one.residuals for one in seen])
    # The median: a single frame with a hand in it must not set what is usual.
    usual = np.median(residuals, axis=0)
    # In logarithms, as errors grow by a factor with the residual, not by an amount.
    # Not below a thousandth: the logarithm of a perfect fit is infinite.
    excess = np.log(np.maximum((residuals / usual).max(1), 1e-3))
    error = np.log([max(one.rms_px or 0.0, 1e-3) for one in seen])
    spread = float(((excess - excess.mean()) ** 2).sum())
    slope = float(((excess - excess.mean()) * (error - error.mean())).sum()) / max(spread, 1e-9)
    # A negative slope would state less error for a worse picture, which a handful of frames may suggest.
    slope = float(np.clip(slope, 0, STEEPEST)) * len(seen) / (len(seen) + 10)
    scale = np.maximum((residuals / usual).max(1), 1.0) ** slope
    # Taken back to a usual residual: a frame states this error times its own factor.
    errors = np.array([one.point_errors_px for one in seen]) / scale[:, None]
    return with_residual_limits(model, limits, usual, np.sqrt((errors**2).mean(0)), slope)


def _would_be_taken(one: HeldOut, limits: Values) -> bool:
    """Whether tracking would call such a fit neither lost nor, since its eyes jump, doubtful."""
    if one.residuals is None or one.point_errors_px is None or one.width_px is None:
        return False
    # Canthi do not move with the lids, so a canthus that is far off means that another place was taken for
    # the eye.
    away = one.point_errors_px.reshape(-1, EYE_POINTS)[:, CANTHI].max()
    return bool((one.residuals <= limits).all() and away <= JUMP_SHARE * one.width_px)


# Decision 0371: A track states its own error.
def stated_errors(model: CoupledModel, fit: Fit, difference_px: float | None) -> Values:
    """Stated error of each landmark (points,) in pixels of the video; NaN for a model that knows none.

    e_p = e0_p max(1, r / r0)^s, r / r0 the worse eye's residual over the usual one; a detector that differs
    by d px in the mean raises it to sqrt(e_p^2 + (d - e)^2) where d is above the mean e of the e_p.
    """
    # The worse eye speaks for both: they share the coupled parameters.
    excess = float(np.max(fit.residuals / model.usual_residuals))
    errors = model.point_errors * max(excess, 1.0) ** float(model.error_slope[0])
    if difference_px is None:
        return np.asarray(errors)
    more = max(0.0, difference_px - float(np.sqrt((errors**2).mean())))
    # In quadrature: what the detector adds is taken as independent of what the residual states.
    return np.asarray(np.sqrt(errors**2 + more**2))


# Decision 0890: A frame without a sign of an eye is not called tracked.
def doubt(
    model: CoupledModel,
    fit: Fit,
    points: Points,
    errors: Values,
    difference: float | None,
    before: Points | None,
) -> str:
    """Why a fit that passed may still be wrong, in words; empty if nothing speaks against it.

    Parameters
    ----------
    difference : float or None
        Mean distance of the lids from a detector's, as part of the eye's width; None if not asked.
    before : float64 array or None
        Points of the frame before, where that was tracked.
    """
    width = widths(points)
    # From the most direct evidence to the least: the first reason found is the one that is reported.
    if difference is not None and difference > DIFFERING_SHARE:
        return f"model and detector differ by {difference:.0%} of the eye's width"
    unusual = float(np.sqrt(np.mean((fit.c / np.maximum(model.sd, 1e-9)) ** 2)))
    if unusual > UNUSUAL_SD:
        return f"the shape is unlike the labeled ones ({unusual:.1f} SD)"
    if before is not None and jump_px(points, before) > JUMP_SHARE * width:
        return "the eyes jump from one frame to the next"
    if fits_badly(errors, width):
        return f"the model fits the picture badly: {_error_in_words(errors, width)}"
    return ""


def glare_hides(errors: Values, width: float) -> str:
    """Why stated errors (points,) that glare has raised make a frame doubtful, or an empty string."""
    return f"glare hides the lids: {_error_in_words(errors, width)}" if fits_badly(errors, width) else ""


def _error_in_words(errors: Values, width: float) -> str:
    rms = float(np.sqrt((errors**2).mean()))
    return f"stated error {rms:.1f} px is {rms / width:.0%} of the eye's width"


def fits_badly(errors: Values, width: float) -> bool:
    """Whether stated errors (points,) make a frame doubtful whose eyes are `width` pixels wide."""
    return float(np.sqrt((errors**2).mean())) > DOUBTFUL_SHARE * width


@compiled_over(shapes)
def jump_px(points: Points, before: Points) -> float:
    """Greatest move of a canthus since the frame before, in pixels."""
    furthest = 0.0
    for start in range(0, len(points), EYE_POINTS):
        for canthus in CANTHI:
            move = points[start + canthus] - before[start + canthus]
            furthest = max(furthest, math.hypot(move[0], move[1]))
    return furthest


@compiled_over(shapes)
def lid_difference(points: Points, other: Points) -> float:
    """Mean distance of the lid points from another's lid curves, the worse eye's, as part of its width.

    Detectors place points differently along a lid, so only the distance from the curve counts.
    """
    offsets = lid_offsets(points, other)
    worst = 0.0
    for eye in range(len(offsets)):
        worst = max(worst, offsets[eye].mean())
    return worst


@compiled_over(shapes)
def lid_offsets(points: Points, other: Points) -> Values:
    """Distance of each lid point from another's lid curve, as part of the other eye's width (eyes, 7)."""
    offsets = np.empty((len(points) // EYE_POINTS, len(UPPER_LID) + len(LOWER_LID)))
    for eye in range(len(offsets)):
        start = EYE_POINTS * eye
        span = other[start + CANTHI[1]] - other[start + CANTHI[0]]
        width = max(math.hypot(span[0], span[1]), 1e-6)
        for number, point in enumerate(UPPER_LID):
            offsets[eye, number] = from_curve(points[start + point], other, start, UPPER_CURVE) / width
        for number, point in enumerate(LOWER_LID):
            away = from_curve(points[start + point], other, start, LOWER_CURVE) / width
            offsets[eye, len(UPPER_LID) + number] = away
    return offsets


@compiled
def from_curve(point: Points, points: Points, start: int, curve: tuple[int, ...]) -> float:
    """Distance of a point (2,) from the polyline through points[start + n], n in `curve`."""
    nearest = np.inf
    for n in range(len(curve) - 1):
        a, b = points[start + curve[n]], points[start + curve[n + 1]]
        dx, dy, px, py = b[0] - a[0], b[1] - a[1], point[0] - a[0], point[1] - a[1]
        # Two points of a curve may be one; the share is then 0.
        share = min(max((px * dx + py * dy) / max(dx * dx + dy * dy, 1e-12), 0.0), 1.0)
        nearest = min(nearest, math.hypot(px - share * dx, py - share * dy))
    return nearest
