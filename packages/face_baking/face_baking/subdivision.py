"""Catmull-Clark subdivision as one sparse matrix, so that any per-vertex values are subdivided by a product.

Source: Catmull & Clark 1978, "Recursively generated B-spline surfaces on arbitrary topological meshes",
Computer-Aided Design 10(6), 350-355; borders by the cubic B-spline rule.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

Array = NDArray[np.float64]
Index = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Subdivision:
    """A refined mesh of part of a coarse one.

    Attributes
    ----------
    matrix : sparse array (fine, used)
        Fine values are this times the coarse values of `used`.
    used : int64 array (used,)
        Coarse vertices that the part's faces touch, ascending.
    quads : int64 array (m, 4)
        Corners of the fine faces.
    """

    matrix: sparse.csr_array
    used: Index
    quads: Index

    def __call__(self, values: Array) -> Array:
        """(fine,) or (fine, k) values from those of all coarse vertices."""
        return np.asarray(self.matrix @ values[self.used])


def subdivide(faces: Index, levels: int) -> Subdivision:
    """Refine `faces` (m, 4; a triangle has -1 last) `levels` times.

    Raises
    ------
    ValueError
        `levels` is less than 1: the coarse faces may be triangles.
    """
    if levels < 1:
        raise ValueError(f"levels must be 1 or more; it is {levels}")
    used = np.unique(faces[faces >= 0])
    local = np.where(faces >= 0, np.searchsorted(used, faces), -1)
    matrix, quads = _once(local, len(used))
    for _ in range(levels - 1):
        step, quads = _once(quads, matrix.shape[0])
        matrix = sparse.csr_array(step @ matrix)
    return Subdivision(matrix, used, quads)


def _once(faces: Index, count: int) -> tuple[sparse.csr_array, Index]:
    """One round: the matrix (count + edges + faces, count) and the new quads."""
    sides = np.where(faces[:, 3] >= 0, 4, 3)
    slot = np.arange(4)[None] < sides[:, None]
    corner = faces[slot]
    face = np.repeat(np.arange(len(faces)), sides)
    index_in_face = np.tile(np.arange(4), (len(faces), 1))[slot]
    following = faces[face, (index_in_face + 1) % sides[face]]
    pairs = np.sort(np.stack([corner, following], -1), axis=1)
    edges, edge = np.unique(pairs, axis=0, return_inverse=True)
    edge = edge.reshape(-1)
    face_mean = _matrix(face, corner, 1 / sides[face], (len(faces), count))
    edge_of_face = _matrix(edge, face, np.ones(len(edge)), (len(edges), len(faces)))
    shared = np.bincount(edge, minlength=len(edges))
    edge_points = _edge_points(edges, count, shared, edge_of_face, face_mean)
    vertex_points = _vertex_points(edges, count, shared, corner, face, face_mean)
    before = edge[_previous(sides)]
    quads = np.stack([corner, count + edge, count + len(edges) + face, count + before], -1)
    return sparse.csr_array(sparse.vstack([vertex_points, edge_points, face_mean])), quads


def _previous(sides: Index) -> Index:
    """For each corner in turn the number of the corner before it in the same face."""
    first = np.repeat(np.cumsum(sides) - sides, sides)
    own = np.arange(len(first))
    return np.where(own == first, first + np.repeat(sides, sides) - 1, own - 1)


def _matrix(rows: Index, columns: Index, values: Array, shape: tuple[int, int]) -> sparse.csr_array:
    return sparse.csr_array((values, (rows, columns)), shape=shape)


def _edge_points(
    edges: Index, count: int, shared: Index, edge_of_face: sparse.csr_array, face_mean: sparse.csr_array
) -> sparse.csr_array:
    """Mean of an edge's ends and its two faces; of the ends alone on the border."""
    inner = shared == 2
    rows = np.repeat(np.arange(len(edges)), 2)
    ends = _matrix(rows, edges.ravel(), np.repeat(np.where(inner, 0.25, 0.5), 2), (len(edges), count))
    return sparse.csr_array(ends + sparse.diags_array(np.where(inner, 0.25, 0.0)) @ edge_of_face @ face_mean)


def _vertex_points(
    edges: Index, count: int, shared: Index, corner: Index, face: Index, face_mean: sparse.csr_array
) -> sparse.csr_array:
    """(F + 2 R + (n - 3) P) / n inside; (P + 6 P + P) / 8 along the border."""
    border_edges = edges[shared != 2]
    border = np.zeros(count, bool)
    border[border_edges] = True
    ends = np.concatenate([edges, edges[:, ::-1]])
    valence = np.maximum(np.bincount(ends[:, 0], minlength=count), 1).astype(np.float64)
    touching = _matrix(corner, face, np.ones(len(corner)), (count, face_mean.shape[0]))
    faces_of = np.maximum(np.asarray(touching.sum(axis=1)).ravel(), 1)
    inner = np.where(border, 0.0, 1.0)
    mean_faces = sparse.diags_array(inner / (faces_of * valence)) @ touching @ face_mean
    neighbours = _matrix(ends[:, 0], ends[:, 1], np.ones(len(ends)), (count, count))
    middles = sparse.diags_array(inner / valence**2) @ neighbours
    own = sparse.diags_array(inner * (1 / valence + (valence - 3) / valence) + (1 - inner) * 0.75)
    along = np.concatenate([border_edges, border_edges[:, ::-1]])
    degree = np.maximum(np.bincount(along[:, 0], minlength=count), 1)
    rim = _matrix(along[:, 0], along[:, 1], 0.25 / degree[along[:, 0]], (count, count))
    return sparse.csr_array(mean_faces + middles + own + rim)
