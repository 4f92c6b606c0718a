"""Lashes as the camera sees them: fanned until the lid is half shut, and hanging from a closed one."""

import numpy as np
import pytest
from face_baking.blink_path import BlinkPath
from face_baking.hair import Lashes
from face_baking.identity import identity_of_seed
from face_baking.kit import FaceKit


@pytest.fixture(scope="module")
def path(kit: FaceKit) -> BlinkPath:
    identity = identity_of_seed(4)
    return BlinkPath(kit, identity.rest(kit), identity.movement)


def seen(path: BlinkPath, stroke: float) -> np.ndarray:
    """(n, 2) way in the picture from root to tip of one eye's upper lashes, cm; y points upwards."""
    lashes = Lashes(path, identity_of_seed(4).hair, 1, True, 4)
    points = lashes.at(path.at({1: stroke, -1: stroke}), stroke).points
    return np.asarray(points[:, -1, :2] - points[:, 0, :2])


def test_a_shut_lids_lashes_hang_down_as_long_as_they_stood(path: BlinkPath) -> None:
    opened, shut = seen(path, 0.0), seen(path, 1.0)
    assert np.mean(opened[:, 1] > 0) > 0.9
    assert np.mean(shut[:, 1] < 0) > 0.9
    # Curled by 88 degrees they were 0.83 times as long, and a seventh of them pointed up.
    assert np.median(np.linalg.norm(shut, axis=1)) > 0.95 * np.median(np.linalg.norm(opened, axis=1))


@pytest.mark.parametrize("stroke", [0.15, 0.3, 0.5])
def test_lashes_stay_fanned_until_the_lid_is_half_shut(path: BlinkPath, stroke: float) -> None:
    """Turned with their lid, they lay before the eye like a comb; recordings keep the fan until 0.6."""
    moved, opened = seen(path, stroke), seen(path, 0.0)
    assert np.mean(moved[:, 1] > 0) > 0.9
    assert np.median(np.linalg.norm(moved, axis=1)) > 0.9 * np.median(np.linalg.norm(opened, axis=1))


def test_lashes_hang_before_an_eye_that_is_nearly_shut(path: BlinkPath) -> None:
    """On their way down all at once, they pointed at the camera as one dark line until closure 0.95."""
    assert np.mean(seen(path, 0.85)[:, 1] < 0) > 0.9
    halfway = np.mean(seen(path, 0.65)[:, 1] < 0)
    assert 0.1 < halfway < 0.9


def test_more_of_the_lower_lashes_stand_alone(path: BlinkPath) -> None:
    """In even bundles, as upper ones are, they looked planted; counted by lashes, not by bundles."""
    alone = {}
    for upper in (True, False):
        leaders = Lashes(path, identity_of_seed(4).hair, 1, upper, 4).row.leader
        _, clump = np.unique(leaders, return_counts=True)
        alone[upper] = float(np.sum(clump == 1) / clump.sum())
    assert alone[False] > 0.3 > 2 * alone[True]


def test_upper_lashes_become_sparse_and_short_towards_the_temple(path: BlinkPath) -> None:
    """As dense and long there as elsewhere, seen from the side they were an eyeliner's wing."""
    row = Lashes(path, identity_of_seed(4).hair, 1, True, 4).row
    temple, middle = row.along_lid > 0.9, (row.along_lid > 0.6) & (row.along_lid < 0.8)
    assert temple.sum() / 0.085 < 0.85 * middle.sum() / 0.2
    assert np.median(row.size[temple]) < 0.75 * np.median(row.size[middle])
