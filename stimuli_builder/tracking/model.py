"""The coupled active appearance model: what one trained model holds."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from stimuli_builder.tracking.mesh import BaseMesh
from stimuli_builder.tracking.shapes import LidMarkers
from stimuli_builder.video import Picture

Values = NDArray[np.float64]


@dataclass(frozen=True)
class CoupledModel:
    """A coupled AAM (paper, section 3.1), everything in pixels of the reduced picture or the base frame.

    Attributes
    ----------
    mesh : BaseMesh
        The base mesh, with the mean shape s0 as vertices.
    shape_modes : float64 array (l, V, 2)
        Movement of the vertices per coupled parameter.
    appearance : float32 array (l + 1, N)
        A0, then the appearance modes of the coupled parameters, in grey levels.
    weights : float32 array (N,)
        Mean 1; how much a pixel counts, low where left-out frames are badly explained.
    sd : float64 array (l,)
        Standard deviation of each coupled parameter over the labelled frames.
    examples, poses : float64 array
        (F, l) and (F, 4); parameters and similarity of each labelled frame.
    patches : uint8 array (P, h, w)
        Eye regions of a few labelled frames, for the search over a whole picture.
    patch_frames : int64 array (P,)
        The labelled frame each patch shows, and patch_corners (P, 2), its top left corner.
    reduction : int
        Whole factor by which pictures are reduced before fitting.
    residual_limits : float64 array (eyes,)
        Root mean square grey levels above which a fit is not believed.
    usual_residuals : float64 array (eyes,)
        Of frames left out of training; a fit's error is stated against them.
    point_errors : float64 array (9 * eyes,)
        Root mean square distance in px of the video of each point on those frames.
    error_slope : float64 array (1,)
        By which power of its residual over the usual one a frame's error grows.
    variance_kept : (float, float, float)
        Share of the variance in shape, appearance and coupled parameters.
    """

    mesh: BaseMesh
    shape_modes: Values
    appearance: NDArray[np.float32]
    weights: NDArray[np.float32]
    sd: Values
    examples: Values
    poses: Values
    patches: Picture
    patch_frames: NDArray[np.int64]
    patch_corners: Values
    reduction: int
    size_px: tuple[int, int]
    markers: LidMarkers
    residual_limits: Values
    usual_residuals: Values
    point_errors: Values
    error_slope: Values
    mode_counts: tuple[int, int, int]
    variance_kept: tuple[float, float, float]

    @property
    def eyes(self) -> int:
        """One or two."""
        return self.markers.eyes


def believing(
    model: CoupledModel,
    limits: Values,
    usual: Values | None = None,
    point_errors: Values | None = None,
    slope: float = 0.0,
) -> CoupledModel:
    """The same model with residual limits (eyes,) and, where given, what its errors are stated from."""
    return replace(
        model,
        residual_limits=np.asarray(limits, np.float64),
        usual_residuals=model.usual_residuals if usual is None else usual,
        point_errors=model.point_errors if point_errors is None else point_errors,
        error_slope=np.array([slope]),
    )
