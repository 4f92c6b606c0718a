"""The coupled active appearance model: what one trained model holds."""

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.errors import InputError
from experiments.files import whole_file
from stimuli_builder.tracking.mesh import BaseMesh, build_mesh, mesh_from, reduce_picture, reduced_points
from stimuli_builder.tracking.sampling_kernels import sample
from stimuli_builder.tracking.shapes import (
    EYE_POINTS,
    LidMarkers,
    Points,
    mean_shape,
    similarity_between,
    undo_pose,
    with_border,
)
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
        A0, then the appearance modes of the coupled parameters, in gray levels.
    weights : float32 array (N,)
        Mean 1; how much a pixel counts, low where left-out frames are badly explained.
    sd : float64 array (l,)
        Standard deviation of each coupled parameter over the labeled frames.
    examples, poses : float64 array
        (F, l) and (F, 4); parameters and similarity of each labeled frame.
    patches : uint8 array (P, h, w)
        Eye regions of a few labeled frames, for the search over a whole picture.
    patch_frames : int64 array (P,)
        The labeled frame each patch shows, and patch_corners (P, 2), its top left corner.
    reduction : int
        Whole factor by which pictures are reduced before fitting.
    residual_limits : float64 array (eyes,)
        Root mean square gray levels above which a fit is not believed.
    usual_residuals : float64 array (eyes,)
        Of frames left out of training; a fit's error is stated against them.
    point_errors : float64 array (9 * eyes,)
        Root mean square distance in px of the video of each point on those frames.
    error_slope : float64 array (1,)
        By which power of its residual over the usual one the error of a frame grows.
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


def with_residual_limits(
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


# The coupled model as a file.

FORMAT = 2
ARRAYS = (
    "shape_modes",
    "appearance",
    "weights",
    "sd",
    "examples",
    "poses",
    "patches",
    "patch_frames",
    "patch_corners",
    "residual_limits",
    "usual_residuals",
    "point_errors",
    "error_slope",
)


def save_model(model: CoupledModel, path: Path) -> None:
    """Write the model as .npz without pickled objects."""
    facts = {
        "format": FORMAT,
        "size_px": list(model.size_px),
        "reduction": model.reduction,
        "mid_upper": model.markers.upper,
        "mid_lower": model.markers.lower,
        "mode_counts": model.mode_counts,
        "variance_kept": model.variance_kept,
    }
    with whole_file(path) as temporary, temporary.open("wb") as stream:
        np.savez_compressed(
            stream,
            facts=np.array(json.dumps(facts)),
            vertices=model.mesh.vertices,
            triangles=model.mesh.triangles,
            eye_of=model.mesh.eye_of,
            **{name: getattr(model, name) for name in ARRAYS},
        )


def load_model(path: Path) -> CoupledModel:
    """Read a model written by `save_model`; InputError if it is something else."""
    try:
        with np.load(path, allow_pickle=False) as stored:
            facts = json.loads(str(stored["facts"]))
            arrays = {name: stored[name] for name in ARRAYS}
            mesh = mesh_from(stored["vertices"], stored["triangles"], stored["eye_of"])
    except FileNotFoundError as error:
        raise InputError(f"{path}: there is no such model file; create one with 'stimuli train'") from error
    except Exception as error:
        raise InputError(f"{path}: not a model from 'stimuli train'") from error
    if facts.get("format") != FORMAT:
        raise InputError(
            f"{path}: model format {facts.get('format')}, but this version reads {FORMAT}; train it again"
        )
    return CoupledModel(mesh=mesh, **arrays, **_facts(facts))


def _facts(facts: dict[str, Any]) -> dict[str, Any]:
    upper, lower = (tuple(tuple(eye) for eye in facts[key]) for key in ("mid_upper", "mid_lower"))
    return {
        "size_px": tuple(facts["size_px"]),
        "reduction": int(facts["reduction"]),
        "markers": LidMarkers(upper, lower),
        "mode_counts": tuple(facts["mode_counts"]),
        "variance_kept": tuple(facts["variance_kept"]),
    }


# The coupled model learnt from labeled frames.

# Pixels that a few labeled frames happen to explain well would else rule the fit: with it none counts
# more than 1.3 / 0.3 times the median pixel.
WEIGHT_FLOOR = 0.3


@dataclass(frozen=True)
class TrainingOptions:
    """How much of the labeled frames' variation the model keeps.

    Each count of modes is the one that keeps the wanted share of variance, but not fewer than the paper's
    counts (8, 10, 10) where the labeled frames carry that many.
    """

    shape_variance: float = 0.98
    appearance_variance: float = 0.90
    coupled_variance: float = 0.98
    fewest_shape_modes: int = 8
    fewest_appearance_modes: int = 10
    fewest_coupled_modes: int = 10
    base_pixels: int = 6500


def train(
    pictures: list[Picture], points: Points, markers: LidMarkers, options: TrainingOptions
) -> CoupledModel:
    """Learn the model from labeled frames.

    Parameters
    ----------
    pictures : list of Picture
        F gray pictures, all of one size.
    points : float64 array (F, 9 * eyes, 2)
        Landmarks in their pixels.

    Returns
    -------
    A model whose `residual_limits` are infinite; `with_residual_limits` sets them from frames left out.
    """
    height, width = pictures[0].shape
    mesh, reduction, shapes = _base(points, options)
    small = [reduce_picture(picture, reduction) for picture in pictures]
    poses = np.array([similarity_between(mesh.vertices, shape) for shape in shapes])
    aligned = np.array([undo_pose(shape, pose) for shape, pose in zip(shapes, poses, strict=True)])
    deviations = (aligned - mesh.vertices).reshape(len(shapes), -1)
    shape_basis, shape_values, kept_shape = principal(
        deviations, options.shape_variance, options.fewest_shape_modes
    )
    textures = np.array(
        [warp_picture(mesh, picture, shape) for picture, shape in zip(small, shapes, strict=True)]
    )
    mean = textures.mean(0)
    look_basis, look_values, kept_look = principal(
        textures - mean, options.appearance_variance, options.fewest_appearance_modes
    )
    # Pixels and gray levels have no common unit: both parts get the same total variance (Cootes, Edwards &
    # Taylor 2001).
    weight = np.sqrt((look_values**2).sum() / (shape_values**2).sum())
    both = np.c_[weight * (deviations @ shape_basis.T), (textures - mean) @ look_basis.T]
    joint, values, kept = principal(both, options.coupled_variance, options.fewest_coupled_modes)
    split = len(shape_basis)
    patches, patch_frames, corners = _patches(small, shapes)
    return CoupledModel(
        mesh=mesh,
        shape_modes=(joint[:, :split] / weight @ shape_basis).reshape(len(joint), -1, 2),
        appearance=np.concatenate([mean[None], joint[:, split:] @ look_basis]).astype(np.float32),
        weights=pixel_weights(textures, len(look_basis)),
        # Singular values are root sums of squares over the frames.
        sd=values / np.sqrt(len(shapes)),
        examples=both @ joint.T,
        poses=poses,
        patches=patches,
        patch_frames=patch_frames,
        patch_corners=corners,
        reduction=reduction,
        size_px=(width, height),
        markers=markers,
        residual_limits=np.full(markers.eyes, np.inf),
        usual_residuals=np.full(markers.eyes, np.nan),
        point_errors=np.full(EYE_POINTS * markers.eyes, np.nan),
        error_slope=np.zeros(1),
        mode_counts=(split, len(look_basis), len(joint)),
        variance_kept=(kept_shape, kept_look, kept),
    )


def _base(points: Points, options: TrainingOptions) -> tuple[BaseMesh, int, Points]:
    """Base mesh, reduction and the labeled shapes with border in reduced pixels."""
    full = np.array([with_border(frame) for frame in points])
    mesh = build_mesh(mean_shape(full), options.base_pixels)
    scales = [np.hypot(*similarity_between(mesh.vertices, shape)[:2]) for shape in full]
    # Rounded down: the reduced picture stays at least as fine as the base mesh.
    reduction = max(1, int(np.mean(scales)))
    return mesh, reduction, reduced_points(full, reduction)


def principal(rows: Values, variance: float, fewest: int) -> tuple[Values, Values, float]:
    """Principal components of rows (F, D) already centered.

    Returns
    -------
    basis (k, D) with orthonormal rows, singular values (k,), and the share of variance they keep. k keeps
    `variance`, but is at least `fewest` where the rows have that rank.
    """
    _, values, basis = np.linalg.svd(rows, full_matrices=False)
    # Frames less their mean have rank F - 1 at most; the last direction would be noise of rounding.
    rank = max(1, int((values > 1e-9 * max(values[0], 1e-300)).sum()))
    shares = np.cumsum(values**2) / max((values**2).sum(), 1e-300)
    # The last share may come out a rounding error below 1.
    modes = int(np.searchsorted(shares, variance - 1e-12) + 1)
    count = min(rank, max(modes, fewest))
    return basis[:count], values[:count], float(shares[count - 1])


def pixel_weights(textures: Values, modes: int) -> NDArray[np.float32]:
    """Inverse variance of what each labeled frame shows that the others do not explain, mean 1.

    A glint or a shift of gaze is not in the model; its pixels would drag the mesh.

    Parameters
    ----------
    textures : float64 array (F, N)
        Gray levels; frame by frame is left out and rebuilt from `modes` modes of the others.
    """
    squares = np.zeros(textures.shape[1])
    for frame in range(len(textures)):
        others = np.delete(textures, frame, axis=0)
        mean = others.mean(0)
        squares += _unexplained(others - mean, textures[frame] - mean, modes) ** 2
    variance = squares / len(textures)
    weights = 1 / (variance + WEIGHT_FLOOR * np.median(variance) + 1e-6)
    return np.asarray(weights / weights.mean(), np.float32)


def _unexplained(others: Values, rest: Values, modes: int) -> Values:
    """What `rest` (N,) has beyond the first principal components of centered rows (F, N)."""
    # The Gram matrix of F frames in place of the covariance of N pixels: the same components, thousands of
    # times cheaper.
    strengths, directions = np.linalg.eigh(others @ others.T)
    kept = np.flatnonzero(strengths > 1e-10 * max(strengths[-1], 1e-300))[-modes:]
    share = directions[:, kept].T @ (others @ rest) / strengths[kept]
    return np.asarray(rest - (directions[:, kept] @ share) @ others)


def warp_picture(mesh: BaseMesh, picture: Picture, shape: Points) -> Values:
    """The picture pulled back from `shape` (V, 2) to the base frame: gray levels (N,)."""
    out = np.empty(mesh.pixel_count, np.float32)
    pull: Any = sample
    pull(
        picture, shape.astype(np.float32), mesh.triangles, mesh.starts, mesh.barycentric, mesh.x, mesh.y, out
    )
    return out.astype(np.float64)


def _patches(
    pictures: list[Picture], shapes: Points, count: int = 5
) -> tuple[Picture, NDArray[np.int64], Values]:
    """Eye regions of labeled frames spread over the range of shapes, cut at one common size."""
    spread = (shapes - shapes.mean(1, keepdims=True)).reshape(len(shapes), -1).var(1)
    # Evenly over the ranks; where frames are few, a rank that comes twice counts once.
    chosen = np.argsort(spread)[
        np.unique(np.linspace(0, len(shapes) - 1, min(count, len(shapes))).astype(int))
    ]
    sides = np.ceil(np.ptp(shapes, axis=1).max(0)).astype(int) + 2
    height, width = pictures[0].shape
    sides = np.minimum(sides, [width, height])
    patches, corners = [], []
    for frame in chosen:
        corner = np.floor(shapes[frame].min(0)).astype(int) - 1
        # Moved inward where the eyes are at the edge: all patches have one size.
        corner = np.clip(corner, 0, np.array([width, height]) - sides)
        patches.append(pictures[frame][corner[1] : corner[1] + sides[1], corner[0] : corner[0] + sides[0]])
        corners.append(corner)
    return np.array(patches), chosen.astype(np.int64), np.array(corners, np.float64)
