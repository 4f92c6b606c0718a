"""The compiled loops a frame goes through, against plain forms of the same."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stimuli_builder.tracking import kernels
from stimuli_builder.tracking.certainty import jump_px, lid_difference, lid_offsets
from stimuli_builder.tracking.fit import Fitter
from stimuli_builder.tracking.mesh import build_mesh, same_picture, shows_something
from stimuli_builder.tracking.model import warp_picture
from stimuli_builder.tracking.shapes import apply_pose, with_border

EYE = np.array([[0, 5], [10, -4], [20, -8], [30, -8], [40, -4], [50, 5], [38, 12], [25, 14], [12, 12]], float)
SHAPE = with_border(EYE + 70)


def bilinear(picture, x, y):
    """Samples by the plain formula; outside the picture its edge is repeated."""
    height, width = picture.shape
    x, y = np.clip(x, 0, width - 1.001), np.clip(y, 0, height - 1.001)
    column, row = x.astype(int), y.astype(int)
    fx, fy = x - column, y - row
    grey = picture.astype(float)
    upper = grey[row, column] * (1 - fx) + grey[row, column + 1] * fx
    lower = grey[row + 1, column] * (1 - fx) + grey[row + 1, column + 1] * fx
    return upper * (1 - fy) + lower * fy


@pytest.fixture(scope="module")
def mesh():
    return build_mesh(SHAPE, 2000)


@settings(deadline=None, max_examples=40)
@given(seed=st.integers(0, 10_000), x=st.floats(-150, 150), y=st.floats(-150, 150), size=st.floats(0.3, 2))
def test_samples_equal_the_plain_formula_inside_and_outside(mesh, seed, x, y, size):
    picture = np.random.default_rng(seed).integers(0, 256, (150, 190), np.uint8)
    shape = apply_pose(SHAPE, np.array([size, 0.1, x, y]))
    corners = shape.astype(np.float32).astype(float)[mesh.triangles[mesh.triangle_of]]
    at = np.einsum("nk,nkd->nd", mesh.weights(), corners)
    # A position in float32 is good to some 1e-5 px, a step between pixels is up to 255.
    assert np.allclose(warp_picture(mesh, picture, shape), bilinear(picture, *at.T), atol=0.05)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e30])
def test_no_sample_is_taken_outside_the_picture_whatever_the_shape(mesh, bad):
    picture = np.full((40, 40), 7, np.uint8)
    shape = SHAPE.copy()
    shape[3] = bad
    assert set(np.unique(warp_picture(mesh, picture, shape))) <= {7.0}


def test_a_fit_that_wanders_across_the_picture_equals_one_started_again_at_each_step(lesson, recording):
    """Cells are packed once around the mesh; a mesh that leaves them has them packed again."""
    picture, model = recording.pictures[0], lesson.model
    c, pose = model.examples[0], model.poses[0] + [0, 0, 9.0, 0]
    start = apply_pose(model.mesh.vertices + np.tensordot(c, model.shape_modes, 1), pose)
    whole = Fitter(model, stop_px=0.0).fit(picture, c, pose, 12)
    assert start[:, 0].min() - whole.vertices[:, 0].min() > kernels.MARGIN + 1
    fitter = Fitter(model, stop_px=0.0)
    for _ in range(12):
        step = fitter.fit(picture, c, pose, 1)
        c, pose = step.c, step.pose
    assert np.array_equal(step.vertices, whole.vertices)
    assert np.array_equal(step.residuals, whole.residuals)


def test_residuals_are_weighted_root_mean_squares_of_each_eye(lesson, recording):
    model = lesson.model
    fitter = Fitter(model)
    start = apply_pose(
        model.mesh.vertices + np.tensordot(model.examples[0], model.shape_modes, 1), model.poses[0]
    )
    fit = fitter.fit(recording.pictures[0], model.examples[0], model.poses[0], 1)
    look = model.appearance[0] + model.examples[0] @ model.appearance[1:]
    squares = model.weights * (look - warp_picture(model.mesh, recording.pictures[0], start)) ** 2
    eye = model.mesh.eye_of[model.mesh.triangle_of]
    expected = [np.sqrt(squares[eye == e].sum() / model.weights[eye == e].sum()) for e in range(model.eyes)]
    assert fit.residuals == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e7])
def test_a_movement_that_is_not_a_number_is_infinite(bad):
    before, after = np.zeros((3, 2), np.float32), np.zeros((3, 2), np.float32)
    after[1, 1] = 0.25
    assert kernels.moved_by(after, before) == 0.25
    after[2, 0] = bad
    assert kernels.moved_by(after, before) == np.inf


def test_equal_and_empty_pictures():
    picture = np.random.default_rng(1).integers(0, 255, (33, 41), np.uint8)
    other = picture.copy()
    assert same_picture(picture, other)
    other[32, 40] += 1
    assert not same_picture(picture, other)
    flat = np.full((33, 41), 240, np.uint8)
    assert not shows_something(flat, 12, 4)
    flat[1, 1] = 0  # not among every fourth row and column
    flat[32, 40] = 251
    assert not shows_something(flat, 12, 4)
    flat[32, 40] = 252
    assert shows_something(flat, 12, 4)


def from_curve(point, curve):
    """Distance of a point from a polyline, by 20,001 points along it."""
    along = np.linspace(0, len(curve) - 1, 20_001)
    points = np.stack([np.interp(along, np.arange(len(curve)), curve[:, axis]) for axis in (0, 1)], axis=1)
    return np.hypot(*(points - point).T).min()


@settings(deadline=None, max_examples=10)
@given(seed=st.integers(0, 10_000))
def test_distances_from_lid_curves(seed):
    rng = np.random.default_rng(seed)
    two = np.concatenate([EYE, EYE + np.array([90.0, 4.0])])
    one = two + rng.normal(0, 3, two.shape)
    expected = np.array(
        [
            [from_curve(one[s + k], two[s : s + 6]) for k in (1, 2, 3, 4)]
            + [from_curve(one[s + k], two[s + np.array([5, 6, 7, 8, 0])]) for k in (6, 7, 8)]
            for s in (0, 9)
        ]
    )
    expected /= np.hypot(50, 0)
    assert np.allclose(lid_offsets(one, two), expected, atol=1e-3)
    assert lid_difference(one, two) == pytest.approx(expected.mean(1).max(), abs=1e-3)
    canthi = [0, 5, 9, 14]
    assert jump_px(one, two) == pytest.approx(np.hypot(*(one - two)[canthi].T).max())
