"""Poses of the lower lid that are moved as the mesh moves, against a texture laid on the skin itself."""

import cv2
import numpy as np
import pytest
from face_baking.framing import Box, bounding_box
from face_baking.identity import load_identity
from face_baking.kit import FaceKit
from face_baking.lid_pose import OPEN, LidPose
from face_baking.pose_motion import PoseMotion, pose_between
from face_baking.scene import FaceScene
from numpy.typing import NDArray
from scipy.interpolate import griddata

STRIPES_MM = 4.0


@pytest.fixture(scope="module")
def scene(kit: FaceKit) -> FaceScene:
    return FaceScene(kit, load_identity("alder"), "eyes", (240, 90))


@pytest.fixture(scope="module")
def box(scene: FaceScene) -> Box:
    return bounding_box(list(scene.lower_lid_boxes.values()))


def lower_lid(scene: FaceScene) -> NDArray[np.bool_]:
    """Vertices of the skin below the lower lids' margins."""
    at = scene.skin.coordinates
    return (at.upper < 0.1) & (at.loop > 4) & (at.loop < 10) & (np.abs(at.azimuth) < 0.6)


def striped(scene: FaceScene, pose: LidPose, box: Box) -> NDArray[np.float32]:
    """(h, w, 3) upright stripes that lie on the resting skin and go where it goes; none elsewhere."""
    chosen = lower_lid(scene)
    across = scene.skin.rest[chosen, 0] * scene.view.mm_per_cm
    value = 0.5 + 0.4 * np.sin(2 * np.pi * across / STRIPES_MM)
    place = scene.view.project(scene.posed_skin(pose)[chosen]) - np.array(box[:2]) - 0.5
    rows, columns = np.mgrid[0 : box[3], 0 : box[2]]
    picture = griddata(place, value, (columns, rows), method="linear", fill_value=0.5)
    return np.repeat(picture[..., None], 3, axis=2).astype(np.float32)


def test_the_shift_is_that_of_the_skin(scene: FaceScene, box: Box) -> None:
    pose = LidPose(0.0, 0.5, 2.0)
    motion = PoseMotion.between(scene, pose, OPEN, box)
    chosen = lower_lid(scene)
    here, there = (
        scene.view.project(scene.posed_skin(each)[chosen]) - np.array(box[:2]) for each in (pose, OPEN)
    )
    pixel = np.floor(here).astype(int)
    told = motion.shift[pixel[:, 1], pixel[:, 0]]
    moved = np.abs(there - here)
    assert moved[:, 0].max() > 1.5 * scene.view.px_per_mm
    assert np.percentile(np.abs(told - (there - here)), 98) < 0.25


def test_what_is_not_of_the_lower_lid_stays(scene: FaceScene, box: Box) -> None:
    pose, rest = LidPose(0.8, 1.0, 5.0), LidPose(0.8)
    motion = PoseMotion.between(scene, pose, rest, box)
    at = scene.skin.coordinates
    lid = (at.upper > 0.9) & (at.loop > 4) & (at.loop < 6) & (np.abs(at.azimuth) < 0.5)
    upper = scene.posed_skin(pose)[lid]
    pixel = np.floor(scene.view.project(upper) - np.array(box[:2])).astype(int)
    inside = (pixel >= 0).all(axis=1) & (pixel < np.array(box[2:])).all(axis=1)
    assert inside.sum() > 20
    assert motion.share[pixel[inside, 1], pixel[inside, 0]].max() < 0.5
    noise = np.random.default_rng(0).random((box[3], box[2], 3)).astype(np.float32)
    still = motion.share[..., 0] == 0
    assert still.any()
    np.testing.assert_array_equal(motion.moved(noise)[still], noise[still])


def test_a_pose_between_two_is_as_it_would_be_there_where_a_mixture_is_not(
    scene: FaceScene, box: Box
) -> None:
    pose, ends = LidPose(0.0, 0.5, 2.0), [LidPose(0.0, 0.5, 1.0), LidPose(0.0, 0.5, 3.0)]
    pictures = {end: striped(scene, end, box) for end in ends}
    truth = striped(scene, pose, box)
    skin = PoseMotion.between(scene, pose, OPEN, box).share[..., 0] > 0.95
    striped_here = (np.abs(truth - 0.5) > 1e-6).any(axis=2).astype(np.uint8)
    skin &= cv2.erode(cv2.morphologyEx(striped_here, cv2.MORPH_CLOSE, np.ones((3, 3))), np.ones((7, 7))) > 0
    moved = pose_between(scene, pose, pictures, box)
    errors = [
        float(np.sqrt(np.mean((made - truth)[skin] ** 2))) for made in (moved, sum(pictures.values()) / 2)
    ]
    assert skin.sum() > 150
    assert errors[0] < errors[1] / 3


def test_the_nearer_neighbour_counts_more(scene: FaceScene, box: Box) -> None:
    near, far = LidPose(0.0, 0.0, 1.0), LidPose(0.0, 0.0, 4.0)
    flat = {end: np.full((box[3], box[2], 3), value, np.float32) for end, value in ((near, 0.2), (far, 0.8))}
    mixed = pose_between(scene, LidPose(0.0, 0.0, 2.0), flat, box)
    np.testing.assert_allclose(mixed, 0.4, atol=1e-5)
