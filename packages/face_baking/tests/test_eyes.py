"""Inputs of the eye's shader: where it is shaded, and where its white turns into flesh."""

import numpy as np
import pytest
from face_baking.blink_path import BlinkPath, nasal_tip
from face_baking.eyes import Mesh, corner_floor, eyeball
from face_baking.hair import edge_line
from face_baking.identity import identity_of_seed, load_identity
from face_baking.kit import FaceKit
from face_baking.lid_loops import EDGE_LOOP, LASH_LOOP, SIDES, chains
from face_baking.scene import Part
from face_baking.sphere import IRIS_CM
from scipy.spatial import cKDTree


@pytest.fixture(scope="module")
def path(kit: FaceKit) -> BlinkPath:
    identity = identity_of_seed(4)
    return BlinkPath(kit, identity.rest(kit), identity.movement)


def eye(path: BlinkPath, side: int) -> Mesh:
    return eyeball(path, path.at({1: 0.0, -1: 0.0}), side, 0.0)


def near_corner(path: BlinkPath, mesh: Mesh, side: int) -> np.ndarray:
    """(n,) vertices that in the picture lie within 2.5 mm of the nasal corner."""
    away = (mesh.vertices - nasal_tip(path, path.rest, side, EDGE_LOOP))[:, :2]
    return np.asarray(np.linalg.norm(away, axis=1) < 0.25)


@pytest.mark.parametrize("stroke", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("name", ["cedar", "alder", "hazel", "birch"])
def test_between_the_lids_no_gap_is_left_at_either_corner(
    kit: FaceKit, name: str, side: int, stroke: float
) -> None:
    """A floor lies behind the whole of the lids' ends, and in front of it nothing but their edges."""
    identity = load_identity(name)
    path = BlinkPath(kit, identity.rest(kit), identity.movement)
    posed = path.at({1: stroke, -1: stroke})
    chain = np.concatenate(chains(path.kit, path.loops[side][EDGE_LOOP], side))
    edge = posed[chain]
    across = (edge[:, 0] - path.globes[side].centre[0]) * side
    for nasal, here in ((True, across < across.min() + 0.4), (False, across > across.max() - 0.2)):
        end, floor = edge[here], corner_floor(path, posed, side, stroke, nasal, 0.5)
        inward = end[None, :, :2] * 0.7 + 0.3 * end[:, :2].mean(0)
        away, nearest = cKDTree(floor.vertices[:, :2]).query(inward.reshape(-1, 2))
        assert away.max() < 0.06
        assert floor.vertices[nearest, 2].max() < edge[:, 2].max()


def test_the_flesh_of_light_skin_is_lighter(path: BlinkPath) -> None:
    posed = path.at({1: 0.0, -1: 0.0})
    light, dark = (corner_floor(path, posed, 1, 0.0, True, melanin) for melanin in (0.2, 1.0))
    flesh = light.values["flush"] > 0.99
    assert flesh.sum() > 100
    assert (light.values["shade"][flesh] > 1.2 * dark.values["shade"][flesh]).mean() > 0.9


@pytest.mark.parametrize("side", SIDES)
def test_the_corners_floor_runs_into_the_white(path: BlinkPath, side: int) -> None:
    """Toward the iris it lies below the white, and no edge of it is seen."""
    floor = corner_floor(path, path.at({1: 0.0, -1: 0.0}), side, 0.0, True, 0.5)
    out = floor.vertices - path.globes[side].centre
    height, beside = np.linalg.norm(out, axis=1) - path.globes[side].radius, np.abs(out[:, 0])
    assert height[beside < IRIS_CM + 0.02].max() < 0
    before_iris = np.linalg.norm(out[:, :2], axis=1) < 0.9 * IRIS_CM
    assert before_iris.any()
    assert height[before_iris].max() < -0.3
    assert height[(beside > 1.25) & (out[:, 0] * side < 0)].max() > 0.05


@pytest.mark.parametrize("side", SIDES)
def test_the_lids_lie_on_the_iris(path: BlinkPath, side: int) -> None:
    """The upper one covers 2.2 to 2.7 mm of its height, 1.5 to 2 mm of what is seen; the lower one none."""
    for upper, least, most in ((True, 0.22, 0.27), (False, -0.02, 0.04)):
        line = edge_line(path, path.rest, side, EDGE_LOOP, upper) - path.globes[side].centre
        middle = line[np.argmin(np.abs(line[:, 0])), 1]
        assert least < IRIS_CM - abs(middle) < most


@pytest.mark.parametrize("side", SIDES)
def test_the_nasal_corner_lies_as_far_from_the_iris_as_peoples(path: BlinkPath, side: int) -> None:
    tip = nasal_tip(path, path.rest, side, EDGE_LOOP) - path.globes[side].centre
    assert 1.3 < np.abs(tip[0]) < 1.6


def test_the_halves_of_a_face_differ(path: BlinkPath) -> None:
    """By half a millimeter and more in the lids' edges, once mirrored."""
    left, right = (edge_line(path, path.rest, side, LASH_LOOP, True) for side in SIDES)
    left, right = (line - path.globes[side].centre for line, side in zip((left, right), SIDES, strict=True))
    apart = np.abs(left - right * np.array([-1, 1, 1]))
    assert 0.03 < apart.max() < 0.4


@pytest.mark.parametrize("side", SIDES)
def test_the_white_turns_into_flesh_at_its_nasal_end_alone(path: BlinkPath, side: int) -> None:
    mesh = eye(path, side)
    flush, centre = mesh.values["flush"], path.globes[side].centre
    seen = mesh.vertices[:, 2] > centre[2]
    temporal = seen & ((mesh.vertices[:, 0] - centre[0]) * side > 0)
    iris = np.linalg.norm((mesh.vertices - centre)[:, :2], axis=1) < IRIS_CM
    assert flush[seen & near_corner(path, mesh, side)].min() > 0.9
    assert flush[temporal].max() < 1e-9
    assert flush[seen & iris].max() < 1e-9


def test_the_white_is_darkest_at_the_lids(path: BlinkPath) -> None:
    mesh, centre = eye(path, 1), path.globes[1].centre
    middle = (np.abs(mesh.vertices[:, 0] - centre[0]) < 0.1) & (mesh.vertices[:, 2] > centre[2])
    height, shade = (mesh.vertices - centre)[middle, 1], mesh.values["shade"][middle]
    order = np.argsort(height)
    edges = [edge_line(path, path.rest, 1, EDGE_LOOP, upper) - centre for upper in (True, False)]
    at_the_lids = [line[np.abs(line[:, 0]).argmin(), 1] for line in edges]
    assert shade[np.abs(height) < 0.3].max() > 0.75
    assert np.interp(at_the_lids, height[order], shade[order]).max() < 0.65


def test_the_white_is_lit_more_evenly_than_the_key_light_lights_it(path: BlinkPath) -> None:
    """Next to the nose the right eye's white turns away from the key light, and the left eye's to it."""
    values = []
    for side in (-1, 1):
        mesh, outward = eye(path, side), np.array([-side, 0.0, 1.0]) / np.sqrt(2)
        way = (mesh.vertices - path.globes[side].centre) @ outward
        values.append(mesh.values["shade"][way.argmax()])
    assert values[0] > 1.3 * values[1]


def test_the_pink_stays_at_the_nose_as_the_eye_turns(kit: FaceKit) -> None:
    """A renderer gets each pose's own: the white's vertices turn with the gaze, and flesh does not."""
    identity = identity_of_seed(4)
    ahead, aside = (BlinkPath(kit, identity.rest(kit), identity.movement) for _ in range(2))
    aside.look = (25.0, 0.0)
    first, turned = (Part("eye_left", "eye", eye(path, 1)).moving() for path in (ahead, aside))
    assert not np.allclose(first["value_flush"], turned["value_flush"])
    near = near_corner(ahead, eye(aside, 1), 1) & (turned["vertices"][:, 2] > ahead.globes[1].centre[2])
    assert turned["value_flush"][near].min() > 0.9
