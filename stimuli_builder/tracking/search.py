"""Finding the eyes again: closures tried at a known place, or patches of labeled frames anywhere."""

from collections.abc import Iterator

import cv2
import numpy as np
from numpy.typing import NDArray

from stimuli_builder.tracking.fit import Fit, Fitter
from stimuli_builder.tracking.mesh import reduce_picture
from stimuli_builder.tracking.model import CoupledModel
from stimuli_builder.tracking.sampling_kernels import grey_spreads
from stimuli_builder.tracking.shapes import EYE_POINTS, inter_eyelid_distances
from stimuli_builder.video import Picture

Values = NDArray[np.float64]

CLOSURES = 4
# Neighbors differ by 18 %: no size between them is off by more than 9 %.
SCALES = (0.85, 1.0, 1.18)
# Correlation costs the area of the picture times that of the patch.
PATCH_HEIGHT_PX = 26
CANDIDATES = 5
LEAST_MATCH = 0.35


class Finder:
    """Searches with one fitter; `residual` of what it returns is for the caller to judge."""

    def __init__(self, fitter: Fitter):
        self._fitter, model = fitter, fitter.model
        self._model = model
        self._closures = _spread_closures(fitter)
        height, width = model.patches.shape[1:]
        self._factor = max(1, height // PATCH_HEIGHT_PX)
        self._templates = [
            (number, scale, cv2.resize(reduce_picture(patch, self._factor), None, fx=scale, fy=scale))
            for number, patch in enumerate(model.patches)
            for scale in SCALES
            # A patch of fewer than four reduced pixels resembles anything.
            if min(height, width) * scale >= 4 * self._factor
        ]

    def near(self, picture: Picture, pose: Values) -> Fit | None:
        """Best fit of several closures started at `pose`; None if all broke down."""
        return self._best(picture, ((c, pose) for c in self._closures))

    def anywhere(self, picture: Picture) -> Fit | None:
        """Best fit started at the places of the whole picture most like labeled frames."""
        return self._best(picture, self._starts(picture))

    def _best(self, picture: Picture, starts: Iterator[tuple[Values, Values]]) -> Fit | None:
        fits = [self._fitter.fit(picture, c, pose) for c, pose in starts]
        # Those inside come first: a fit that slid over the edge sees repeated pixels and so a small
        # residual.
        good = [fit for fit in fits if fit.iterations and inside(fit, picture)]
        return min(good or [fit for fit in fits if fit.iterations], key=_worst, default=None)

    def _starts(self, picture: Picture) -> Iterator[tuple[Values, Values]]:
        small = reduce_picture(picture, self._factor)
        matches = []
        for number, scale, template in self._templates:
            if template.shape[0] > small.shape[0] or template.shape[1] > small.shape[1]:
                continue
            # Normalized by mean and contrast, as the light may have changed since the labeled frames.
            _, match, _, corner_px = cv2.minMaxLoc(cv2.matchTemplate(small, template, cv2.TM_CCOEFF_NORMED))
            # A flat part of the picture has no contrast to divide by.
            if np.isfinite(match) and match > LEAST_MATCH:
                matches.append((match, number, scale, corner_px))
        matches.sort(key=lambda entry: -entry[0])
        for _, number, scale, corner_px in matches[:CANDIDATES]:
            frame = int(self._model.patch_frames[number])
            # Pixel centers: the middle of a reduced pixel lies between the middles of those that it covers.
            corner = (np.array(corner_px) + 0.5) * self._factor - 0.5
            yield (
                self._model.examples[frame],
                _carried(self._model.poses[frame], self._model.patch_corners[number], corner, scale),
            )


def _carried(pose: Values, from_corner: Values, to_corner: Values, scale: float) -> Values:
    shift = (pose[2:] - from_corner) * scale + to_corner
    return np.array([pose[0] * scale, pose[1] * scale, shift[0], shift[1]])


def _worst(fit: Fit) -> float:
    return float(fit.residuals.max())


def inside(fit: Fit, picture: Picture) -> bool:
    """Whether every landmark lies in the picture."""
    points = fit.vertices[: EYE_POINTS * len(fit.residuals)]
    height, width = picture.shape
    (left, top), (right, bottom) = points.min(0).tolist(), points.max(0).tolist()
    return bool(left > -0.5 and top > -0.5 and right < width - 0.5 and bottom < height - 0.5)


def _spread_closures(fitter: Fitter) -> list[Values]:
    """Parameters of labeled frames from the most closed to the most open, evenly spread."""
    model = fitter.model
    shapes = model.mesh.vertices + np.tensordot(model.examples, model.shape_modes, axes=1)
    lids = shapes[:, : EYE_POINTS * model.eyes]
    openings = [inter_eyelid_distances(points, model.markers).mean() for points in lids]
    # By opening and not by parameters: the starts must differ in what a search has to find.
    order = np.argsort(openings)
    chosen = np.unique(np.linspace(0, len(order) - 1, min(CLOSURES, len(order))).astype(int))
    return [model.examples[order[index]] for index in chosen]


# Why a fit is not believed: it broke down, left the picture, is of another size, or shows no eye.

SCALE_RANGE = (0.5, 2.0)
FLAT_SHARE = 0.25
"""Spread of gray levels, as part of the other eye's or the labeled ones', below which there is no eye to be
seen: a shut eye has 0.7 of an open one's or more in two recordings, plain things over it 0 to 0.05."""


class Faults:
    """Reports what is wrong with fits of one model."""

    def __init__(self, model: CoupledModel):
        self._model = model
        low, high = SCALE_RANGE
        sizes = np.hypot(model.poses[:, 0], model.poses[:, 1])
        self._sizes = (float(low * sizes.min()), float(high * sizes.max()))
        self._usual_spread = float(grey_spreads(model.appearance[0], model.mesh.ends, model.eyes).max())

    def lost(self, fit: Fit, picture: Picture) -> str:
        """Why a fit to a reduced picture (h, w) is taken for none, or an empty string."""
        if fit.iterations == 0:
            return "the fit broke down"
        if not inside(fit, picture):
            return "the eyes left the picture"
        # Scale and turn are the first two numbers, a complex factor: its modulus is the size.
        size = float(np.hypot(*fit.pose[:2]))
        if not self._sizes[0] < size < self._sizes[1]:
            return f"the eyes would be {size / self._sizes[0] * SCALE_RANGE[0]:.2g} times their labeled size"
        excess = fit.residuals / self._model.residual_limits
        eye = int(excess.argmax())
        if excess[eye] > 1:
            limit = self._model.residual_limits[eye]
            return (
                f"{self._name(eye)} covered or changed: residual {fit.residuals[eye]:.1f} above {limit:.1f}"
            )
        return ""

    def flat(self, fit: Fit) -> str:
        """Which eye's picture is too even to show one, or an empty string.

        A detector, and the model that it trains, draw lids all the same.
        """
        usual = max(float(fit.spreads.max()), self._usual_spread)
        eye = int(fit.spreads.argmin())
        return (
            f"{self._name(eye)} covered: its picture is flat" if fit.spreads[eye] < FLAT_SHARE * usual else ""
        )

    def _name(self, eye: int) -> str:
        return ("left eye", "right eye")[eye] if self._model.eyes == 2 else "eye"
