"""Why a fit is not believed: it broke down, left the picture, is of another size, or shows no eye."""

import numpy as np

from stimuli_builder.tracking.fit import Fit
from stimuli_builder.tracking.model import CoupledModel
from stimuli_builder.tracking.sampling_kernels import grey_spreads
from stimuli_builder.tracking.search import inside
from stimuli_builder.video import Picture

SCALE_RANGE = (0.5, 2.0)
FLAT_SHARE = 0.25
"""Spread of grey levels, as part of the other eye's or the labelled ones', below which there is no eye to be
seen: a shut eye has 0.7 of an open one's or more in two recordings, plain things over it 0 to 0.05."""


class Faults:
    """Tells what is wrong with fits of one model."""

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
        size = float(np.hypot(*fit.pose[:2]))
        if not self._sizes[0] < size < self._sizes[1]:
            return f"the eyes would be {size / self._sizes[0] * SCALE_RANGE[0]:.2g} times their labelled size"
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
