"""The piecewise affine warp and the similarity, there and back."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stimuli_builder.tracking.mesh import build_mesh, reduce_picture, reduced_points, restored_points
from stimuli_builder.tracking.model import warp_picture
from stimuli_builder.tracking.shapes import (
    apply_pose,
    default_markers,
    inter_eyelid_distances,
    similarity_between,
    undo_pose,
    with_border,
)

OPEN_EYE = np.array(
    [[0, 5], [10, -4], [20, -8], [30, -8], [40, -4], [50, 5], [38, 12], [25, 14], [12, 12]], float
)
SHAPE = with_border(OPEN_EYE + 70)
poses = st.tuples(st.floats(0.3, 3), st.floats(-2, 2), st.floats(-200, 200), st.floats(-200, 200)).map(
    np.array
)


@settings(deadline=None, max_examples=60)
@given(pose=poses)
def test_similarity_there_and_back(pose):
    there = apply_pose(SHAPE, pose)
    assert np.allclose(undo_pose(there, pose), SHAPE)
    assert np.allclose(similarity_between(SHAPE, there), pose)


@pytest.fixture(scope="module")
def mesh():
    return build_mesh(SHAPE, 4000)


@settings(deadline=None, max_examples=40)
@given(seed=st.integers(0, 10_000))
def test_warp_there_and_back(mesh, seed):
    """A picture that grows evenly is pulled back exactly: the value shows where each pixel was read."""
    rng = np.random.default_rng(seed)
    shape = SHAPE + rng.normal(0, 1.5, SHAPE.shape)
    weights, corners = mesh.weights(), mesh.triangles[mesh.triangle_of]
    at = np.einsum("nk,nkd->nd", weights, shape[corners])
    y, x = np.mgrid[:160, :200]
    read_x = warp_picture(mesh, x.astype(np.uint8), shape)
    read_y = warp_picture(mesh, y.astype(np.uint8), shape)
    assert np.allclose(np.stack([read_x, read_y], axis=1), at, atol=1e-3)
    back = np.einsum("nk,nkd->nd", weights, mesh.vertices[corners])
    assert np.allclose(back, np.stack([mesh.x, mesh.y], axis=1), atol=1e-3)


def test_mesh_has_about_the_wanted_pixels_and_no_pixel_twice(mesh):
    assert mesh.pixel_count == pytest.approx(4000, rel=0.03)
    assert len(set(mesh.flat_index.tolist())) == mesh.pixel_count
    assert mesh.starts[-1] == mesh.pixel_count


def test_outside_the_picture_its_edge_is_repeated(mesh):
    picture = np.full((40, 40), 7, np.uint8)
    assert np.allclose(warp_picture(mesh, picture, SHAPE + 500), 7)


@pytest.mark.parametrize("factor", [1, 2, 3, 4])
def test_reduced_pictures_and_points_agree(factor):
    y, x = np.mgrid[:48, :60]
    small = reduce_picture((2 * x + y).astype(np.uint8), factor)
    point = np.array([[31.0, 20.0]])
    column, row = reduced_points(point, factor)[0]
    assert np.allclose(restored_points(reduced_points(point, factor), factor), point)
    c, r = int(column), int(row)
    value = small[r, c] + (column - c) * (float(small[r, c + 1]) - small[r, c])
    value += (row - r) * (float(small[r + 1, c]) - small[r, c])
    assert value == pytest.approx(82, abs=1.1)


def test_distance_is_square_to_the_canthi_and_turns_with_the_head():
    eye = OPEN_EYE.copy()
    eye[:, 1] -= 5
    distance = inter_eyelid_distances(eye, default_markers(1))
    assert distance == pytest.approx([14 - -8])
    turned = apply_pose(eye, np.array([np.cos(0.4), np.sin(0.4), 3, 4]))
    assert inter_eyelid_distances(turned, default_markers(1)) == pytest.approx(distance)
    mirrored = eye * [-1, 1]
    assert inter_eyelid_distances(mirrored, default_markers(1)) == pytest.approx(distance)


def test_distance_is_zero_where_the_lids_cross():
    eye = OPEN_EYE.copy()
    eye[[2, 3], 1] = 16
    assert inter_eyelid_distances(eye, default_markers(1))[0] == 0
