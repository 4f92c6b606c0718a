"""A fit begun from what a detector saw."""

import numpy as np
from numpy.typing import NDArray

from stimuli_builder.tracking.fit import Fit, Fitter
from stimuli_builder.tracking.model import CoupledModel
from stimuli_builder.tracking.picture import reduced_points
from stimuli_builder.tracking.shapes import Points, similarity_between, unmoved, with_border
from stimuli_builder.video import Picture

MAX_SD = 3.0
"""Coupled parameters start within so many of their standard deviations."""


class DetectedStart:
    """Turns a detector's points into coupled parameters and fits from there."""

    def __init__(self, fitter: Fitter) -> None:
        self._fitter = fitter
        self._to_parameters = _to_parameters(fitter.model)

    def fit(self, picture: Picture, points: Points) -> Fit:
        """Fit a reduced picture from points (9 * eyes, 2) in pixels of the video."""
        model = self._fitter.model
        shape = reduced_points(with_border(points), model.reduction)
        mean = model.mesh.vertices
        pose = similarity_between(mean, shape)
        away = (unmoved(shape, pose) - mean).ravel()
        limit = MAX_SD * model.sd
        return self._fitter.fit(picture, np.clip(self._to_parameters @ away, -limit, limit), pose)


def _to_parameters(model: CoupledModel) -> NDArray[np.float64]:
    """Matrix (l, 2 V) from movements of the vertices to coupled parameters, least squares kept small."""
    modes = model.shape_modes.reshape(len(model.sd), -1)
    size = (modes**2).sum(1).mean() * model.sd.max() ** 2
    ridge = 1e-3 * np.diag(size / np.maximum(model.sd, 1e-9) ** 2)
    return np.asarray(np.linalg.solve(modes @ modes.T + ridge, modes))
