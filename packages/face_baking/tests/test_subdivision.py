"""Catmull-Clark subdivision against surfaces whose refinement is known."""

import numpy as np
import pytest
from face_baking.subdivision import subdivide

CUBE = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
CUBE_FACES = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])


def test_a_cube_is_refined_as_catmull_and_clark_say() -> None:
    fine = subdivide(CUBE_FACES, 1)
    points = fine(CUBE)
    assert len(points) == 8 + 12 + 6
    # Corner: (mean of 3 face points + 2 mean of 3 edge middles) / 3 = 5/9 of the corner.
    np.testing.assert_allclose(points[:8], CUBE * 5 / 9)
    # Edge: mean of its ends and the two face points, 3/4 away from the axis it runs along.
    edges = points[8:20]
    np.testing.assert_allclose(np.sort(np.abs(edges), axis=1), [[0, 0.75, 0.75]] * 12)
    np.testing.assert_allclose(np.sort(np.abs(points[20:]), axis=1), [[0, 0, 1]] * 6, atol=1e-12)


def test_a_flat_grid_stays_flat_and_its_border_stays_straight() -> None:
    grid = np.arange(16).reshape(4, 4)
    faces = np.stack([grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]], -1).reshape(-1, 4)
    points = np.stack([*np.meshgrid(np.arange(4.0), np.arange(4.0)), np.full((4, 4), 2.0)], -1).reshape(-1, 3)
    fine = subdivide(faces, 2)
    refined = fine(points)
    np.testing.assert_allclose(refined[:, 2], 2.0)
    assert len(fine.quads) == 9 * 16
    border = refined[np.isclose(refined[:, 1], refined[:, 1].min())]
    assert refined[:, 1].min() == 0.0
    assert len(border) >= 7


def test_triangles_and_unused_vertices_are_taken_as_they_come() -> None:
    points = np.array([[9, 9, 9], [0, 0, 0], [3, 0, 0], [0, 3, 0]], float)
    fine = subdivide(np.array([[1, 2, 3, -1]]), 1)
    assert fine.used.tolist() == [1, 2, 3]
    assert len(fine.quads) == 3
    np.testing.assert_allclose(fine(points)[-1], [1, 1, 0])


def test_weights_of_every_fine_vertex_sum_to_one() -> None:
    fine = subdivide(CUBE_FACES, 3)
    np.testing.assert_allclose(fine(np.ones(8)), 1.0)


def test_no_refinement_is_refused() -> None:
    with pytest.raises(ValueError, match="levels must be 1 or more"):
        subdivide(CUBE_FACES, 0)
