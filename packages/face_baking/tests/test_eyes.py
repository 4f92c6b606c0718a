"""Inputs of the eye's shader: where it is shaded, and where its white turns into flesh."""

import numpy as np
import pytest
from face_baking.blink_path import BlinkPath, nasal_tip
from face_baking.eyes import Mesh, eyeball
from face_baking.identity import identity_of_seed
from face_baking.kit import FaceKit
from face_baking.lid_loops import EDGE_LOOP, SIDES
from face_baking.scene import Part
from face_baking.sphere import IRIS_CM


@pytest.fixture(scope="module")
def path(kit: FaceKit) -> BlinkPath:
    identity = identity_of_seed(4)
    return BlinkPath(kit, identity.rest(kit), identity.movement)


def eye(path: BlinkPath, side: int) -> Mesh:
    return eyeball(path, path.at({1: 0.0, -1: 0.0}), side, 0.0)


@pytest.mark.parametrize("side", SIDES)
def test_the_white_turns_into_flesh_at_its_nasal_end_alone(path: BlinkPath, side: int) -> None:
    mesh = eye(path, side)
    flush, centre = mesh.values["flush"], path.globes[side].centre
    seen = mesh.vertices[:, 2] > centre[2]
    temporal = seen & ((mesh.vertices[:, 0] - centre[0]) * side > 0)
    iris = np.linalg.norm((mesh.vertices - centre)[:, :2], axis=1) < IRIS_CM
    corner = np.linalg.norm(mesh.vertices - nasal_tip(path, path.rest, side, EDGE_LOOP), axis=1) < 0.15
    assert flush[seen & corner].min() > 0.9
    assert flush[temporal].max() == 0
    assert flush[seen & iris].max() == 0


def test_the_white_is_darkest_at_the_lids(path: BlinkPath) -> None:
    mesh, centre = eye(path, 1), path.globes[1].centre
    middle = (np.abs(mesh.vertices[:, 0] - centre[0]) < 0.1) & (mesh.vertices[:, 2] > centre[2])
    height, shade = (mesh.vertices - centre)[middle, 1], mesh.values["shade"][middle]
    order = np.argsort(height)
    lowest, highest = shade[order][[0, -1]]
    assert shade.max() > 0.9
    assert max(lowest, highest) < 0.7


def test_the_pink_stays_at_the_nose_as_the_eye_turns(kit: FaceKit) -> None:
    """A renderer gets each pose's own: the white's vertices turn with the gaze, and flesh does not."""
    identity = identity_of_seed(4)
    ahead, aside = (BlinkPath(kit, identity.rest(kit), identity.movement) for _ in range(2))
    aside.look = (25.0, 0.0)
    first, turned = (Part("eye_left", "eye", eye(path, 1)).moving() for path in (ahead, aside))
    assert not np.allclose(first["value_flush"], turned["value_flush"])
    tip = nasal_tip(ahead, ahead.rest, 1, EDGE_LOOP)
    near = np.linalg.norm(turned["vertices"] - tip, axis=1) < 0.15
    assert turned["value_flush"][near].min() > 0.9
