"""Eyelid landmarks: the template, its border vertices, alignment, and the inter-eyelid distance."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]

EYE_POINTS = 9
CANTHI = (0, 5)
UPPER_LID = (1, 2, 3, 4)
LOWER_LID = (6, 7, 8)
BORDER_POINTS = 12
BORDER_HALF_WIDTH = 0.70
BORDER_ABOVE = 0.50
BORDER_BELOW = 0.40


@dataclass(frozen=True)
class LidMarkers:
    """Per eye, the points whose mean is the centered marker of the upper and of the lower lid.

    Point numbers count over all points of the template (0 to 8 first eye, 9 to 17 second).
    """

    upper: tuple[tuple[int, ...], ...]
    lower: tuple[tuple[int, ...], ...]

    @property
    def eyes(self) -> int:
        """One or two."""
        return len(self.upper)


def default_markers(eyes: int) -> LidMarkers:
    """The two middle upper-lid points and the middle lower-lid point of each eye."""
    starts = [EYE_POINTS * eye for eye in range(eyes)]
    return LidMarkers(tuple((s + 2, s + 3) for s in starts), tuple((s + 7,) for s in starts))


def eye_axis(eye: Points) -> tuple[Points, Points, float]:
    """Unit vector from the image-left to the image-right canthus, the one pointing down, and the width.

    Parameters
    ----------
    eye : (9, 2) array
        In pixels.
    """
    (span,) = eye_spans(eye)
    width = float(np.hypot(*span))
    along = span / width
    return along, np.array([-along[1], along[0]]), width


def eye_spans(points: Points) -> Points:
    """Vector (eyes, 2) of each eye from its image-left to its image-right canthus, in pixels.

    Parameters
    ----------
    points : (9 * eyes, 2) array
        In pixels.
    """
    eyes = points.reshape(-1, EYE_POINTS, 2)
    spans = eyes[:, CANTHI[1]] - eyes[:, CANTHI[0]]
    return np.asarray(np.where(spans[:, :1] < 0, -spans, spans))


def widths(points: Points) -> float:
    """Mean width of the eyes, canthus to canthus, in pixels."""
    spans = eye_spans(points)
    return float(np.hypot(spans[:, 0], spans[:, 1]).mean())


def inter_eyelid_distances(points: Points, markers: LidMarkers) -> NDArray[np.float64]:
    """Distance of the lower from the upper lid marker, at right angles to the canthus line.

    Parameters
    ----------
    points : (9 * eyes, 2) array
        In pixels.

    Returns
    -------
    (eyes,) array in pixels, image-left eye first. Zero where the markers meet or the upper one passes the
    lower one (see docs/explanation/decisions/0101).
    """
    # Plain numbers: so few of them take numpy ten times as long, in every frame.
    rows = points.tolist()
    distances = []
    for upper, lower, (x, y) in zip(markers.upper, markers.lower, eye_spans(points).tolist(), strict=True):
        across, down = (
            sum(rows[k][axis] for k in lower) / len(lower) - sum(rows[k][axis] for k in upper) / len(upper)
            for axis in (0, 1)
        )
        distances.append(max((x * down - y * across) / math.hypot(x, y), 0.0))
    return np.array(distances)


def with_border(points: Points) -> Points:
    """Extend the template by 12 border vertices per eye: 18 points become 42 (paper, Figure 5b).

    The border is fixed to the canthi alone, so that it stays with the face while the lids move.
    """
    return np.concatenate(
        [points, *[_border(points[s : s + EYE_POINTS]) for s in range(0, len(points), EYE_POINTS)]]
    )


def _border(eye: Points) -> Points:
    along, down, width = eye_axis(eye)
    centre = (eye[CANTHI[0]] + eye[CANTHI[1]]) / 2
    angle = np.linspace(0, 2 * np.pi, BORDER_POINTS, endpoint=False)
    # y points down, so that a positive sine lies below the eye.
    height = np.where(np.sin(angle) > 0, BORDER_BELOW, BORDER_ABOVE)
    across = np.outer(np.cos(angle) * BORDER_HALF_WIDTH * width, along)
    return np.asarray(centre + across + np.outer(np.sin(angle) * height * width, down))


def similarity_between(source: Points, target: Points) -> NDArray[np.float64]:
    """Least-squares similarity (a, b, tx, ty) that takes `source` to `target`, both (points, 2).

    x' = a x - b y + tx and y' = b x + a y + ty.
    """
    from_mean, to_mean = source.mean(0), target.mean(0)
    z = (source - from_mean) @ np.array([1, 1j])
    w = (target - to_mean) @ np.array([1, 1j])
    # As complex numbers a scaling with a turn is one factor, and least squares is a projection.
    turn = np.vdot(z, w) / np.vdot(z, z).real
    shift = to_mean @ np.array([1, 1j]) - turn * (from_mean @ np.array([1, 1j]))
    return np.array([turn.real, turn.imag, shift.real, shift.imag])


def apply_pose(points: Points, pose: NDArray[np.float64]) -> Points:
    """Apply a similarity (a, b, tx, ty) to (points, 2)."""
    a, b, tx, ty = pose
    return np.asarray(points @ np.array([[a, b], [-b, a]]) + [tx, ty])


def undo_pose(points: Points, pose: NDArray[np.float64]) -> Points:
    """Undo a similarity (a, b, tx, ty) on (points, 2)."""
    a, b, tx, ty = pose
    return np.asarray((points - [tx, ty]) @ np.array([[a, -b], [b, a]]) / (a * a + b * b))


def mean_shape(shapes: Points, rounds: int = 20) -> Points:
    """Procrustes mean of (examples, points, 2), at the mean size of the examples."""
    mean = shapes[0]
    size = np.mean([_size(shape) for shape in shapes])
    for _ in range(rounds):
        mean = np.mean([apply_pose(shape, similarity_between(shape, mean)) for shape in shapes], axis=0)
        # Back onto the first shape at each round, else the mean drifts, turns and shrinks freely.
        mean = apply_pose(mean, similarity_between(mean, shapes[0]))
        mean = mean.mean(0) + (mean - mean.mean(0)) * size / _size(mean)
    return np.asarray(mean)


def _size(shape: Points) -> float:
    return float(np.sqrt(((shape - shape.mean(0)) ** 2).sum()))
