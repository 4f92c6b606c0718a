"""The blink of many identities, measured on the refined mesh by rays cast here, not by the builder."""

import numpy as np
import pytest
from face_baking.blink_path import BlinkPath
from face_baking.identity import Movement, identity_of_seed
from face_baking.kit import FaceKit
from face_baking.lid_loops import chains
from face_baking.lid_skin import FaceSkin, lid_skin
from face_baking.sphere import CORNEA_CM, IRIS_CM
from numpy.typing import NDArray

Array = NDArray[np.float64]
CLOSURES = (0.0, 0.15, 0.35, 0.5, 0.7, 0.85, 0.95)
RAY_STEP_CM = 0.002
FISSURE_CM = (-1.1, -0.7, -0.35, 0.0, 0.35, 0.7, 1.1)


def skin_of(kit: FaceKit, seed: int, movement: Movement | None = None) -> FaceSkin:
    identity = identity_of_seed(seed)
    path = BlinkPath(kit, identity.rest(kit), movement or identity.movement)
    return lid_skin(path, identity, levels=2)


def seen_cm(skin: FaceSkin, posed: Array, side: int, offset: float = 0.0) -> float:
    """Height of the gap between the lids that rays along -z find at a column of the picture."""
    globe = skin.path.globes[side]
    x, y = globe.centre[0] + offset, globe.centre[1] + np.arange(-0.8, 0.8, RAY_STEP_CM)
    quads = posed[skin.fine.quads]
    near = quads[(quads[..., 0].min(1) <= x) & (quads[..., 0].max(1) >= x)]
    triangles = np.concatenate([near[:, [0, 1, 2]], near[:, [0, 2, 3]]])
    a, b, c = (triangles[:, k] for k in range(3))
    area = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    area = np.where(np.abs(area) < 1e-12, 1e-12, area)
    dx, dy = x - a[:, 0], y[:, None] - a[:, 1]
    u = (dx * (c[:, 1] - a[:, 1]) - dy * (c[:, 0] - a[:, 0])) / area
    v = (dy * (b[:, 0] - a[:, 0]) - dx * (b[:, 1] - a[:, 1])) / area
    z = a[:, 2] + u * (b[:, 2] - a[:, 2]) + v * (c[:, 2] - a[:, 2])
    eye = globe.centre[2] + np.sqrt(
        np.clip(globe.radius**2 - offset**2 - (y - globe.centre[1]) ** 2, 0, None)
    )
    hit = (u >= 0) & (v >= 0) & (u + v <= 1) & (z > eye[:, None] - 0.02)
    covered = hit.any(axis=1)
    first, last = np.flatnonzero(covered)[[0, -1]]
    return float((~covered[first : last + 1]).sum() * RAY_STEP_CM)


def deepest_cm(skin: FaceSkin, posed: Array, side: int) -> float:
    """Least distance of the lids' vertices outside globe and corneal sphere; the gaze is at the camera."""
    globe, at = skin.path.globes[side], skin.coordinates
    lids = posed[(at.side == side) & (at.loop > 1.2)] - globe.centre
    gaze = np.array([-globe.centre[0], 0, 74.0 - globe.centre[2]])
    edge = np.sqrt(globe.radius**2 - IRIS_CM**2)
    cornea = gaze / np.linalg.norm(gaze) * (edge - np.sqrt(CORNEA_CM**2 - IRIS_CM**2))
    outside = np.minimum(
        np.linalg.norm(lids, axis=1) - globe.radius, np.linalg.norm(lids - cornea, axis=1) - CORNEA_CM
    )
    return float(outside.min())


@pytest.mark.parametrize("seed", range(1, 21))
def test_the_opening_falls_evenly_and_nothing_enters_the_globe(kit: FaceKit, seed: int) -> None:
    skin = skin_of(kit, seed)
    opened = {side: seen_cm(skin, skin.at(0.0), side) for side in (1, -1)}
    assert all(0.75 < height < 1.15 for height in opened.values())
    for closure in CLOSURES:
        posed = skin.at(closure)
        for side in (1, -1):
            wanted = opened[side] * (1 - closure)
            assert abs(seen_cm(skin, posed, side) - wanted) * 10 <= 0.10
            assert deepest_cm(skin, posed, side) > 0
    shut = skin.at(1.0)
    assert max(seen_cm(skin, shut, side, x) for side in (1, -1) for x in FISSURE_CM) == 0.0
    assert min(deepest_cm(skin, shut, side) for side in (1, -1)) > 0


def test_what_is_declared_to_hold_still_does(kit: FaceKit) -> None:
    skin = skin_of(kit, 5)
    moved = np.abs(skin.path.at({1: 1.0, -1: 1.0}) - skin.path.rest).max(1)
    away = np.linalg.norm(skin.path.rest - skin.path.globes[1].centre, axis=1)
    away = np.minimum(away, np.linalg.norm(skin.path.rest - skin.path.globes[-1].centre, axis=1))
    assert moved[away > 2.6].max() < 1e-4, "a micrometre"
    assert moved.max() > 0.5


def test_declared_movement_moves_cheek_and_brow(kit: FaceKit) -> None:
    skin = skin_of(kit, 5, Movement(cheek=0.1, brow=0.1, lower_lid_slide=0.5))
    moved = np.abs(skin.path.at({1: 1.0, -1: 1.0}) - skin.path.rest).max(1)
    away = np.linalg.norm(skin.path.rest - skin.path.globes[1].centre, axis=1)
    assert moved[(away > 2.6) & (skin.path.rest[:, 0] > 0)].max() > 0.02


def test_one_eye_may_blink_alone(kit: FaceKit) -> None:
    path = skin_of(kit, 2).path
    moved = np.abs(path.at({1: 1.0, -1: 0.0}) - path.at({1: 0.0, -1: 0.0})).max(1)
    assert moved[path.rest[:, 0] > 0.5].max() > 0.5
    assert moved[path.rest[:, 0] < -0.5].max() == 0.0


def test_a_seed_is_the_same_face_each_time_and_another_seed_another(kit: FaceKit) -> None:
    first, again, other = (identity_of_seed(seed) for seed in (9, 9, 10))
    assert first == again
    np.testing.assert_array_equal(first.rest(kit), again.rest(kit))
    assert np.abs(first.rest(kit) - other.rest(kit)).max() > 0.1


def test_modes_stay_within_the_documented_range() -> None:
    drawn = np.array([identity_of_seed(seed).weights() for seed in range(1, 200)])
    assert np.abs(drawn).max() == pytest.approx(1.6)
    assert not identity_of_seed(0).weights().any()


@pytest.mark.parametrize(("up", "nasal"), [(0.10, 0.0), (0.0, 0.50), (0.10, 0.50)])
def test_the_lower_lid_goes_as_far_as_told_on_the_globe(kit: FaceKit, up: float, nasal: float) -> None:
    skin = skin_of(kit, 3)
    still, moved = skin.at(0.0), skin.at_strokes({1: 0.0, -1: 0.0}, (up, nasal))
    at = skin.coordinates
    middle = (np.abs(at.loop - 3) < 0.3) & (at.upper < 0.5) & (np.abs(at.azimuth - 0.12) < 0.12)
    for side in (1, -1):
        change = (moved - still)[middle & (at.side == side)]
        assert np.median(change[:, 1]) == pytest.approx(up, abs=0.03)
        assert np.median(-change[:, 0] * side) == pytest.approx(nasal, rel=0.12, abs=0.02)
        assert deepest_cm(skin, moved, side) > 0
    corners = np.abs(moved - still).max(1)[at.upper > 0.99]
    assert corners.max() < 0.03


def passed_cm(path: BlinkPath, vertices: Array, side: int) -> float:
    """How far the lower lid's edge lies above the upper one's in the picture, between the corners."""
    upper, lower = (vertices[chain] for chain in chains(path.kit, path.loops[side][3], side))
    first, last = np.sort(upper[:, 0])[[0, -1]]
    at = np.linspace(first + 0.15 * (last - first), last - 0.15 * (last - first), 80)
    heights = []
    for edge in (lower, upper):
        order = np.argsort(edge[:, 0])
        heights.append(np.interp(at, edge[order, 0], edge[order, 1]))
    return float((heights[0] - heights[1]).max())


@pytest.mark.parametrize("seed", [3, 12, 19])
@pytest.mark.parametrize("nasal_cm", [0.0, 0.25, 0.5])
def test_a_raised_lower_lid_does_not_pass_the_upper_one(kit: FaceKit, seed: int, nasal_cm: float) -> None:
    identity = identity_of_seed(seed)
    path = BlinkPath(kit, identity.rest(kit), identity.movement)
    for stroke in (0.0, 0.5, 0.9, 1.0):
        strokes = {1: stroke, -1: stroke}
        shut, moved = path.at(strokes), path.at(strokes, (0.1, nasal_cm))
        for side in (1, -1):
            assert passed_cm(path, moved, side) < max(passed_cm(path, shut, side), 0) + 0.015
