"""The steepest-descent images, the quadratic-form Hessian and the compiled sums against direct forms."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stimuli_builder.tracking import kernels
from stimuli_builder.tracking.fit import Fitter, linear_parts, similarity_directions, work_out
from stimuli_builder.tracking.model import principal, train
from stimuli_builder.tracking.shapes import default_markers, with_border
from stimuli_builder.video import Picture


@pytest.fixture(scope="module")
def model(recording):
    chosen = list(range(0, 200, 14))
    return train(
        [recording.pictures[n] for n in chosen], recording.points[chosen], default_markers(2), small()
    )


def small():
    from stimuli_builder.tracking.model import TrainingOptions

    return TrainingOptions(base_pixels=3000)


def steepest_descent(model, c):
    """SD (K, N) formed directly, the oracle of every fast sum."""
    basis, _, _ = similarity_directions(model.mesh.vertices)
    directions = np.concatenate([model.shape_modes, basis])
    gx, gy = model.mesh.gradient(model.appearance.astype(np.float64))
    return np.tensordot(np.r_[1.0, c], linear_parts(model, gx, gy, directions), axes=1)


def test_jacobian_equals_finite_differences(model):
    """E(x; c) = A(c) - I(W(x; c)) on an image that equals A(0) at the base mesh, moved by each parameter."""
    height, width = model.mesh.shape
    y, x = np.mgrid[:height, :width].astype(float)
    image = 120 + 40 * np.sin(x / 9) * np.cos(y / 11) + 0.3 * x

    def sampled(vertices):
        weights = model.mesh.weights()
        corners = vertices[model.mesh.triangles[model.mesh.triangle_of]]
        at = np.einsum("nk,nkd->nd", weights, corners)
        return 120 + 40 * np.sin(at[:, 0] / 9) * np.cos(at[:, 1] / 11) + 0.3 * at[:, 0]

    looks = np.concatenate([image.ravel()[model.mesh.flat_index][None], model.appearance[1:]])
    from dataclasses import replace

    here = replace(model, appearance=looks.astype(np.float32))
    direct = steepest_descent(here, np.zeros(len(model.sd)))
    basis, _, _ = similarity_directions(model.mesh.vertices)
    directions = np.concatenate([model.shape_modes, basis])
    inner = inner_pixels(model.mesh)
    step = 1e-3
    for k, direction in enumerate(directions):
        ahead, behind = (sampled(model.mesh.vertices + sign * step * direction) for sign in (1, -1))
        slope = -(ahead - behind) / (2 * step)
        if k < len(model.sd):
            slope = slope + looks[k + 1]
        scale = np.abs(slope).max()
        assert np.abs(direct[k] - slope)[inner].max() < 0.02 * scale, k


def inner_pixels(mesh):
    left, right, above, below = mesh.neighbours()
    own = np.arange(mesh.pixel_count)
    return (left != own) & (right != own) & (above != own) & (below != own)


@settings(deadline=None, max_examples=15)
@given(seed=st.integers(0, 10_000))
def test_quadratic_form_hessian_equals_the_direct_one(model, seed):
    c = np.random.default_rng(seed).normal(size=len(model.sd)) * model.sd
    descent = steepest_descent(model, c)
    direct = (descent * model.weights) @ descent.T
    fast = np.empty_like(direct)
    kernels.hessian(work_out(model).hessian_forms, c, fast)
    lower = np.tril_indices(len(direct))
    assert np.abs(fast - direct)[lower].max() < 1e-12 * np.abs(direct).max()


def test_right_side_equals_the_direct_sum(model, recording):
    rng = np.random.default_rng(4)
    c = rng.normal(size=len(model.sd)) * model.sd
    error = rng.normal(size=model.mesh.pixel_count).astype(np.float32)
    algebra, mesh = work_out(model), model.mesh
    look, gx, gy = (np.empty(mesh.pixel_count, np.float32) for _ in range(3))
    kernels.compose(model.appearance, c, 0, mesh.pixel_count, look)
    kernels.differentiate(look, *mesh.neighbours(), gx, gy)
    sums, fast = np.empty(mesh.vertices.shape, np.float32), np.empty(len(c) + 4)
    kernels.accumulate(error, gx, gy, mesh.triangles, mesh.starts, mesh.barycentric, mesh.x, mesh.y, sums)
    fast[:] = 0
    kernels.project(model.appearance, error, 0, mesh.pixel_count, fast)
    kernels.subtract_warp(algebra.directions, sums, fast)
    direct = steepest_descent(model, c) @ error
    assert np.allclose(fast, direct, atol=2e-4 * np.abs(direct).max())


@settings(deadline=None, max_examples=25)
@given(seed=st.integers(0, 10_000), size=st.integers(1, 14))
def test_cholesky_solves(seed, size):
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(size, size + 3))
    matrix, right = root @ root.T, rng.normal(size=size)
    answer = right.copy()
    assert kernels.solve(matrix.copy(), answer)
    assert np.allclose(matrix @ answer, right)


def test_a_matrix_that_is_not_positive_definite_is_refused():
    assert not kernels.solve(np.array([[1.0, 0.0], [2.0, 1.0]]) @ np.diag([1.0, -1.0]), np.ones(2))


@settings(deadline=None, max_examples=25)
@given(seed=st.integers(0, 10_000), rows=st.integers(2, 12), columns=st.integers(2, 30))
def test_all_components_rebuild_the_data(seed, rows, columns):
    data = np.random.default_rng(seed).normal(size=(rows, columns))
    data -= data.mean(0)
    basis, _, kept = principal(data, 1.0, 1)
    assert np.allclose((data @ basis.T) @ basis, data)
    assert kept == pytest.approx(1.0)


@settings(deadline=None, max_examples=25)
@given(seed=st.integers(0, 10_000), wanted=st.floats(0.3, 0.99), fewest=st.integers(1, 6))
def test_kept_components_hold_the_wanted_variance_and_count(seed, wanted, fewest):
    data = np.random.default_rng(seed).normal(size=(9, 20))
    basis, _, kept = principal(data, wanted, fewest)
    assert kept >= wanted - 1e-9
    assert len(basis) >= fewest


def test_the_fit_stays_where_the_truth_is(model, recording):
    """Started on a labelled frame's own parameters, a fit ends near its label and reports few iterations."""
    picture: Picture = recording.pictures[0]
    fit = Fitter(model).fit(picture, model.examples[0], model.poses[0])
    assert 1 <= fit.iterations < 15
    assert np.sqrt(((fit.vertices[:18] - recording.points[0]) ** 2).sum(1).mean()) < 0.5


def test_template_of_18_points_becomes_42(recording):
    assert with_border(recording.points[0]).shape == (42, 2)
    assert with_border(recording.points[0][:9]).shape == (21, 2)
