"""Fitting the coupled AAM to one picture: the steepest-descent algebra, and buffers kept between frames."""

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from stimuli_builder.tracking import kernels
from stimuli_builder.tracking.model import CoupledModel
from stimuli_builder.tracking.sampling_kernels import grey_spreads
from stimuli_builder.tracking.stillness import light_between
from stimuli_builder.video import Picture

# What the compiled fit is given: named arrays of the mesh, of the model, and buffers.


class MeshArrays(NamedTuple):
    """The base mesh of V vertices and N pixels.

    Attributes
    ----------
    vertices : float64 array (V, 2)
    triangles : int array (T, 3)
    starts : int array (T + 1,)
        First pixel of each triangle.
    forms : float32 array (T, 3, 3)
        Barycentric coordinates as linear forms in (x, y, 1).
    x, y : float32 array (N,)
        Pixel positions.
    ends : int array (eyes,)
        One past the last pixel of each eye.
    left, right, above, below : uint32 array (N,)
        Neighbors of each pixel.
    """

    vertices: Any
    triangles: Any
    starts: Any
    forms: Any
    x: Any
    y: Any
    ends: Any
    left: Any
    right: Any
    above: Any
    below: Any


class ModelArrays(NamedTuple):
    """What the fit needs of a model of l coupled parameters, K = l + 4.

    Attributes
    ----------
    shape_modes : float64 array (l, V, 2)
    appearance : float32 array (l + 1, N)
    weights : float32 array (N,)
    shares : float32 array (N,)
        1 / (weight times the sum of the eye's weights).
    hessian_forms : float64 array (pairs, K (K + 1) / 2)
    directions : float64 array (K, V, 2)
    prior, limits : float64 array (l,)
    scales : float64 array (4,)
    centre : float64 array (2,)
    """

    shape_modes: Any
    appearance: Any
    weights: Any
    shares: Any
    hessian_forms: Any
    directions: Any
    prior: Any
    limits: Any
    scales: Any
    centre: Any


class Buffers(NamedTuple):
    """Written by every fit: float32 (N,) five times, float32 (V, 2), and float64 (eyes,)."""

    sampled: Any
    look: Any
    error: Any
    gx: Any
    gy: Any
    vertices: Any
    squares: Any


Values = NDArray[np.float64]

STOP_PX = 0.03
MAX_ITERATIONS = 30
# Beyond, the linear modes draw shapes that no eye has.
LIMIT_SD = 4.0
# Relative to the Hessian's own diagonal: enough to invert it where two modes move the same pixels.
RIDGE = 1e-6


@dataclass(frozen=True)
class Fit:
    """Where one fit ended.

    Attributes
    ----------
    c, pose : float64 array
        Coupled parameters (l,) and similarity (4,) in the reduced picture.
    vertices : float32 array (V, 2)
        In the reduced picture.
    residuals : float64 array (eyes,)
        Root mean square gray levels.
    spreads : float64 array (eyes,)
        Standard deviation of the picture's gray levels over each eye.
    iterations : int
        0 if the fit broke down.
    light : (float, float)
        Gain and offset that would bring the picture's gray levels nearest to the model's; (1, 0) if the fit
        broke down.
    """

    c: Values
    pose: Values
    vertices: NDArray[np.float32]
    residuals: Values
    spreads: Values
    iterations: int
    light: tuple[float, float] = (1.0, 0.0)

    @property
    def overall_residual(self) -> float:
        """Root mean square gray levels over both eyes."""
        squares = [residual * residual for residual in self.residuals.tolist()]
        return math.sqrt(sum(squares) / len(squares))


@dataclass(frozen=True)
class Algebra:
    """What steepest-descent images SD = A_i - grad A(c) . dW/dc need, worked out once for a model.

    Attributes
    ----------
    directions : float64 array (K, V, 2)
        Movement of the vertices per parameter, the 4 of the similarity last.
    scales, centre : float64 array
        The similarity directions' norms (4,) and the centroid they turn about (2,).
    hessian_forms : float64 array (pairs, K (K + 1) / 2)
        Lower triangle, row by row, of H(c) = sum over pairs i <= j of c_i c_j forms, with c_0 = 1.
    """

    directions: Values
    scales: Values
    centre: Values
    hessian_forms: Values


def similarity_directions(vertices: Values) -> tuple[Values, Values, Values]:
    """Unit vertex movements (4, V, 2) of scale, turn, shift x and shift y, with their norms and center."""
    centre = vertices.mean(0)
    from_centre = vertices - centre
    turned = np.stack([-from_centre[:, 1], from_centre[:, 0]], axis=1)
    one = np.ones(len(vertices))
    basis = np.stack([from_centre, turned, np.outer(one, [1, 0]), np.outer(one, [0, 1])])
    norms = np.sqrt((basis**2).sum((1, 2)))
    return basis / norms[:, None, None], norms, centre


def linear_parts(model: CoupledModel, gx: Values, gy: Values, directions: Values) -> Values:
    """Steepest-descent images as a linear form in (1, c): (l + 1, K, N), SD = sum_i c_i parts[i]."""
    mesh, modes = model.mesh, len(model.shape_modes)
    corners = directions[:, mesh.triangles[mesh.triangle_of], :]
    movement = np.einsum("nk,pnkd->pnd", mesh.weights(), corners)
    # By the chain rule the picture pulled back changes by grad A dW/dc; the model's own change with c is
    # taken from it.
    parts = -(gx[:, None] * movement[None, :, :, 0] + gy[:, None] * movement[None, :, :, 1])
    parts[0, :modes] += model.appearance[1:]
    return np.asarray(parts)


def work_out(model: CoupledModel) -> Algebra:
    """Prepare everything that does not depend on the picture or on c."""
    basis, scales, centre = similarity_directions(model.mesh.vertices)
    directions = np.concatenate([model.shape_modes, basis])
    gx, gy = model.mesh.gradient(model.appearance.astype(np.float64))
    parts = linear_parts(model, gx, gy, directions)
    count, size, pixels = parts.shape
    rows = parts.reshape(count * size, pixels)
    products = ((rows * model.weights) @ rows.T).reshape(count, size, count, size).transpose(0, 2, 1, 3)
    # H is quadratic in (1, c): its forms are summed once here, so that a frame needs no product over
    # pixels.
    lower = np.tril_indices(size)
    forms = [
        (products[i, j] + (products[j, i] if i < j else 0.0))[lower]
        # Symmetric in i and j: one form serves both orders, with the two products added.
        for i in range(count)
        for j in range(i, count)
    ]
    return Algebra(directions, scales, centre, np.ascontiguousarray(forms))


def _diagonal(form: Values) -> Values:
    """Diagonal of a lower triangle laid out row by row."""
    # K^2 < K (K + 1) < (K + 1)^2, so that the root cut to a whole number is K.
    size = int(np.sqrt(2 * len(form)))
    # Row k of the triangle has k + 1 numbers, the last of them on the diagonal.
    return form[np.cumsum(np.arange(1, size + 1)) - 1]


def _shares(weights: NDArray[np.float32], ends: NDArray[np.int64]) -> NDArray[np.float32]:
    """1 / (weight times the sum of its eye's weights) of each pixel (N,)."""
    starts = np.r_[0, ends[:-1]]
    sums = np.repeat(np.add.reduceat(weights.astype(np.float64), starts), ends - starts)
    return np.asarray(1 / (weights * sums), np.float32)


class Fitter:
    """Fits one model to pictures; keeps its buffers, so use one for each thread."""

    def __init__(
        self,
        model: CoupledModel,
        *,
        stop_px: float = STOP_PX,
        max_iterations: int = MAX_ITERATIONS,
        prior: float = 0.0,
    ):
        self.model = model
        self.stop_px, self.max_iterations = stop_px, max_iterations
        algebra = work_out(model)
        mesh, pixels = model.mesh, model.mesh.pixel_count
        diagonal = _diagonal(algebra.hessian_forms[0])[: len(model.sd)]
        # A mode without variance over the labeled frames would divide by zero.
        prior_of_c = RIDGE * diagonal + prior / np.maximum(model.sd, 1e-9) ** 2
        ends = mesh.ends
        self._mesh = MeshArrays(
            mesh.vertices, mesh.triangles, mesh.starts, mesh.barycentric, mesh.x, mesh.y, ends,
            *mesh.neighbours(),
        )  # fmt: skip
        self._arrays = ModelArrays(
            model.shape_modes, model.appearance, model.weights, _shares(model.weights, ends),
            algebra.hessian_forms, algebra.directions, prior_of_c, LIMIT_SD * model.sd,
            algebra.scales, algebra.centre,
        )  # fmt: skip
        vertices = np.empty(mesh.vertices.shape, np.float32)
        # One block, rows next to one another: single precision halves what every iteration reads from
        # memory.
        sampled, look, error, gx, gy = np.empty((5, pixels), np.float32)
        self._buffers = Buffers(sampled, look, error, gx, gy, vertices, np.empty(model.eyes))

    def fit(self, picture: Picture, c: Values, pose: Values, max_iterations: int | None = None) -> Fit:
        """Fit to a reduced picture, uint8 (h, w), from parameters c (l,) and a similarity (4,)."""
        # The kernel writes into both, and callers start further fits from the same ones.
        c, pose = c.copy(), pose.copy()
        run: Any = kernels.fit
        limit = max_iterations or self.max_iterations
        iterations = run(picture, c, pose, limit, self.stop_px, self._mesh, self._arrays, self._buffers)
        residuals = np.sqrt(self._buffers.squares)
        # A fit that broke down leaves what it last sampled, wherever that was.
        light = (1.0, 0.0)
        if iterations:
            light = light_between(self._buffers.look, self._buffers.sampled, self.model.weights)
        spreads = grey_spreads(self._buffers.sampled, self.model.mesh.ends, self.model.eyes)
        return Fit(c, pose, self._buffers.vertices.copy(), residuals, spreads, int(iterations), light)
