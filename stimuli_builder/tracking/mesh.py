"""The base mesh: one fixed triangulation, owned by the mean shape, and the pixels inside it."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import Delaunay

from experiments.errors import InputError
from stimuli_builder.compiled import compiled
from stimuli_builder.tracking.shapes import BORDER_POINTS, EYE_POINTS, Points
from stimuli_builder.video import Picture

MARGIN_PX = 2


@dataclass(frozen=True)
class BaseMesh:
    """Triangles and pixels of the base frame, pixels sorted by triangle and triangles by eye.

    Attributes
    ----------
    vertices : float64 array (V, 2)
        Vertex positions of the mean shape, base pixels.
    triangles : int64 array (T, 3)
        Vertex numbers.
    starts : int64 array (T + 1,)
        Pixels of triangle t are starts[t] to starts[t + 1] - 1.
    eye_of : int64 array (T,)
        The eye a triangle belongs to.
    x, y : float32 array (N,)
        Pixel coordinates.
    barycentric : float32 array (T, 3, 3)
        Barycentric coordinate k = b[k, 0] x + b[k, 1] y + b[k, 2].
    shape : (int, int)
        (height, width) of the base frame.
    """

    vertices: Points
    triangles: NDArray[np.int64]
    starts: NDArray[np.int64]
    eye_of: NDArray[np.int64]
    x: NDArray[np.float32]
    y: NDArray[np.float32]
    barycentric: NDArray[np.float32]
    shape: tuple[int, int]

    @property
    def pixel_count(self) -> int:
        """Number of base pixels."""
        return len(self.x)

    @property
    def eyes(self) -> int:
        """One or two."""
        return int(self.eye_of.max()) + 1

    @property
    def ends(self) -> NDArray[np.int64]:
        """One past the last pixel of each eye, int64 (eyes,)."""
        last = np.searchsorted(self.eye_of, np.arange(self.eyes), side="right")
        return np.asarray(self.starts[last])

    @property
    def flat_index(self) -> NDArray[np.int64]:
        """Index of every pixel in the base frame laid out row by row."""
        return (self.y.astype(np.int64) * self.shape[1] + self.x.astype(np.int64)).astype(np.int64)

    @property
    def triangle_of(self) -> NDArray[np.int64]:
        """Triangle of every pixel, int64 (N,)."""
        return np.repeat(np.arange(len(self.triangles)), np.diff(self.starts))

    def weights(self) -> NDArray[np.float64]:
        """Barycentric coordinates of every pixel, (N, 3)."""
        forms = self.barycentric[self.triangle_of].astype(np.float64)
        return np.asarray(
            forms[:, :, 0] * self.x[:, None] + forms[:, :, 1] * self.y[:, None] + forms[:, :, 2]
        )

    def neighbours(self) -> tuple[NDArray[np.uint32], ...]:
        """Pixel number of the left, right, upper and lower neighbor, each (N,).

        Where one of a pair is outside the mesh, both name the pixel itself, so that their difference is 0.
        """
        height, width = self.shape
        number = np.full((height, width), -1)
        number.reshape(-1)[self.flat_index] = np.arange(self.pixel_count)
        column, row = self.x.astype(np.int64), self.y.astype(np.int64)
        edges = []
        for dx, dy in ((1, 0), (0, 1)):
            before, after = number[row - dy, column - dx], number[row + dy, column + dx]
            missing = (before < 0) | (after < 0)
            own = np.arange(self.pixel_count)
            edges += [np.where(missing, own, before), np.where(missing, own, after)]
        left, right, above, below = (part.astype(np.uint32) for part in edges)
        return left, right, above, below

    def gradient(self, appearance: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Central differences along x and y of an appearance (..., N); 0 where a neighbor is outside."""
        left, right, above, below = self.neighbours()
        return (
            (appearance[..., right] - appearance[..., left]) / 2,
            (appearance[..., below] - appearance[..., above]) / 2,
        )


def build_mesh(mean: Points, base_pixels: int) -> BaseMesh:
    """Triangulate the mean shape, scaled so that about `base_pixels` pixels lie inside.

    Parameters
    ----------
    mean : float64 array
        (42, 2), or (21, 2) for one eye; template points first, then the border.
    """
    eyes = len(mean) // (EYE_POINTS + BORDER_POINTS)
    groups = [_eye_vertices(eye, eyes) for eye in range(eyes)]
    # Each eye separately: one triangulation of both would stretch triangles over the nose.
    triangles = [group[Delaunay(mean[group]).simplices] for group in groups]
    area = sum(_area(mean, part) for part in triangles)
    scale = float(np.sqrt(base_pixels / area))
    vertices = (mean - mean.min(0)) * scale + MARGIN_PX
    both = np.concatenate(triangles).astype(np.int64)
    eye_of = np.repeat(np.arange(eyes), [len(part) for part in triangles])
    return mesh_from(vertices, both, eye_of)


def _eye_vertices(eye: int, eyes: int) -> NDArray[np.int64]:
    border = EYE_POINTS * eyes + BORDER_POINTS * eye
    return np.asarray(np.r_[EYE_POINTS * eye : EYE_POINTS * (eye + 1), border : border + BORDER_POINTS])


def _area(points: Points, triangles: NDArray[np.int64]) -> float:
    a, b, c = (points[triangles[:, corner]] for corner in range(3))
    return float(np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]).sum() / 2)


def mesh_from(vertices: Points, triangles: NDArray[np.int64], eye_of: NDArray[np.int64]) -> BaseMesh:
    """Find the pixels of every triangle; a pixel on a shared edge belongs to the first one."""
    width, height = (np.ceil(vertices.max(0)).astype(int) + MARGIN_PX + 1).tolist()
    forms = _barycentric_forms(vertices[triangles])
    owner = np.full((height, width), -1)
    for number, form in enumerate(forms):
        _claim(owner, number, form, vertices[triangles[number]])
    rows, columns = np.nonzero(owner >= 0)
    owners = owner[rows, columns]
    # By triangle, so that a warp is six numbers per run of pixels; stable, so that models are equal on
    # every machine.
    order = np.argsort(owners, kind="stable")
    starts = np.searchsorted(owners[order], np.arange(len(triangles) + 1)).astype(np.int64)
    x, y = columns[order].astype(np.float32), rows[order].astype(np.float32)
    return BaseMesh(
        vertices, triangles, starts, eye_of.astype(np.int64), x, y, forms.astype(np.float32), (height, width)
    )


def _barycentric_forms(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    system = np.concatenate([corners, np.ones((len(corners), 3, 1))], axis=2)
    if np.abs(np.linalg.det(system)).min() < 1e-9:
        raise InputError("the mean of the labeled shapes has a flat triangle; check the labels' point order")
    # Barycentric coordinates are linear in (x, y, 1): their forms are the inverse of the corners' matrix.
    return np.asarray(np.linalg.inv(system).transpose(0, 2, 1))


def _claim(owner: NDArray[np.int64], number: int, form: NDArray[np.float64], corners: Points) -> None:
    x0, y0 = np.floor(corners.min(0)).astype(int)
    x1, y1 = np.ceil(corners.max(0)).astype(int) + 1
    y, x = np.mgrid[y0:y1, x0:x1]
    # A pixel on an edge belongs to a triangle in spite of rounding.
    inside = ((form[:, 0, None, None] * x + form[:, 1, None, None] * y + form[:, 2, None, None]) > -1e-9).all(
        0
    )
    part = owner[y0:y1, x0:x1]
    part[inside & (part < 0)] = number


# Pictures reduced by a whole factor, and points carried along.


def reduce_picture(picture: Picture, factor: int) -> Picture:
    """Mean of factor x factor blocks; rows and columns that fill no block are left out."""
    if factor == 1:
        return picture
    height, width = (side // factor for side in picture.shape)
    whole = picture[: height * factor, : width * factor]
    # Whole blocks, as a block cut at the edge would be a mean of fewer pixels, and shift its center.
    return np.asarray(cv2.resize(whole, (width, height), interpolation=cv2.INTER_AREA), np.uint8)


def reduced_points(points: Points, factor: int) -> Points:
    """Where points of the full picture (pixel centers at integers) lie in the reduced one."""
    # Pixel centers lie at whole numbers, so that the picture begins at -1/2.
    return np.asarray((points + 0.5) / factor - 0.5)


def restored_points(points: Points, factor: int) -> Points:
    """Undo `reduced_points`."""
    return np.asarray((points + 0.5) * factor - 0.5)


@compiled
def same_picture(one: Picture, other: Picture) -> bool:
    """Whether two gray pictures of one size are equal; it stops at the first row that differs."""
    for row in range(one.shape[0]):
        differs = False
        for column in range(one.shape[1]):
            differs |= one[row, column] != other[row, column]
        if differs:
            return False
    return True


@compiled
def shows_something(picture: Picture, grey_levels: int, step: int) -> bool:
    """Whether the gray levels of every step-th row and column span so many; it stops as soon as they do."""
    low, high = picture[0, 0], picture[0, 0]
    for row in range(0, picture.shape[0], step):
        for column in range(0, picture.shape[1], step):
            low, high = min(low, picture[row, column]), max(high, picture[row, column])
        if high >= low + grey_levels:
            return True
    return False
