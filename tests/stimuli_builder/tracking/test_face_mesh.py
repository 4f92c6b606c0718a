"""A face is read in the picture and in its mirror image, and in a margin where it fills the picture."""

from dataclasses import replace
from itertools import islice
from pathlib import Path

import numpy as np
import pytest

from experiments.errors import InputError
from stimuli_builder.characters.atlas import SHIPPED, load_atlas
from stimuli_builder.characters.colour import linear_to_srgb
from stimuli_builder.tracking.detector.detection import Detection
from stimuli_builder.tracking.detector.mesh import (
    SAME_FACE,
    FaceMesh,
    cache_folder,
    in_both,
    open_detector,
    unmirrored_face,
)
from stimuli_builder.tracking.shapes import widths
from stimuli_builder.tracking.survey import _require_agreement
from stimuli_builder.video import VideoInfo, frames, rgb

WIDTH_PX = 640
INFO = VideoInfo(Path("v.mp4"), (WIDTH_PX, 480), 30.0, np.arange(9) / 30, np.arange(9), False)


def face(shift: float = 0.0) -> Detection:
    rng = np.random.default_rng(3)
    eye = np.array([[0, 20], [8, 12], [16, 8], [24, 8], [32, 12], [40, 20], [30, 26], [20, 28], [10, 26.0]])
    other = eye * [-1, 1] + [140, 0]
    points = np.concatenate([eye, other]) + np.array([200 + shift, 100])
    return Detection(points, rng.uniform(200, 340, (2, 5, 2)), np.array([150.0, 60, 400, 300]), (0.0, 0.0))


def test_a_face_mirrored_twice_is_itself():
    back = unmirrored_face(unmirrored_face(face(), WIDTH_PX), WIDTH_PX)
    assert back.points == pytest.approx(face().points)
    assert back.iris == pytest.approx(face().iris)
    assert back.box == pytest.approx(face().box)


def test_a_mirrored_face_has_its_image_left_eye_first_from_the_outer_canthus():
    turned = unmirrored_face(face(), WIDTH_PX).points
    assert turned[0, 0] < turned[5, 0] < turned[14, 0] < turned[9, 0]
    assert turned[:, 1] == pytest.approx(face().points[:, 1])


def test_a_face_in_both_images_is_the_mean_and_shows_how_far_they_differ():
    both = in_both(face(), [face(80), face(2)])
    assert both.points == pytest.approx(face(1).points)
    assert both.mirror_shares == pytest.approx([2 / widths(face().points)] * 2)


@pytest.mark.parametrize("others", [[], [face(SAME_FACE * 40 + 1)]], ids=["none", "another"])
def test_a_face_that_the_mirror_image_does_not_show_stays_and_is_unsure(others):
    alone = in_both(face(), others)
    assert alone.points == pytest.approx(face().points)
    assert alone.mirror_shares == (np.inf, np.inf)


def looks(shares: list[float]) -> list[Detection]:
    return [replace(face(), mirror_shares=(share, share)) for share in shares]


def test_a_face_that_is_read_alike_in_mirror_images_is_taken():
    _require_agreement(INFO, looks([0.02, 0.05, 0.04, np.inf]))


@pytest.mark.parametrize(
    ("shares", "told"),
    [
        ([0.1, 0.12, 0.09, np.inf], "read differently in the mirror image (by 10% of"),
        ([0.02, np.inf, np.inf, np.inf], "not detected in the mirror image of 3 of 4 frames"),
        ([np.inf, np.inf], "not detected in the mirror image of 2 of 2 frames"),
    ],
    ids=["differs", "mostly absent", "absent"],
)
def test_a_face_that_mirror_images_contradict_is_refused_in_one_line(shares, told):
    with pytest.raises(InputError) as refused:
        _require_agreement(INFO, looks(shares))
    assert told in str(refused.value)
    assert "\n" not in str(refused.value)


class OneFaceClient:
    """A client that sees one large face and, without a margin, a small one next to it."""

    def ask(self, what, picture, **_):
        if what == "eye":
            return {"eyes": [[[[0.0, 0.0]] * 9, [[0.0, 0.0]] * 9, []]] * 8}
        margin = (picture.shape[1] - WIDTH_PX) // 2
        large = self._face(margin + 120, 400, 60)
        # the mesh shrinks the wider picture further, and the small face is lost
        return {"faces": [large] if margin else [large, self._face(540, 60, 12)]}

    @staticmethod
    def _face(left, side, eye_px):
        along = np.linspace(0, eye_px, 9)
        eyes = []
        for start, step in ((left + 0.2 * side, 1), (left + 0.8 * side, -1)):
            upper = np.stack([start + step * along, np.full(9, 200.0)], 1)
            lower = np.stack([(start + step * along)[::-1], np.full(9, 210.0)], 1)
            eyes.append([upper.tolist(), lower.tolist(), [[0.0, 0.0]] * 5])
        return {"box": [left, 40, left + side, 40 + side], "eyes": eyes}


def test_a_small_face_next_to_one_that_fills_the_picture_is_kept():
    seen = FaceMesh(OneFaceClient()).detect(np.zeros((480, WIDTH_PX, 3), np.uint8))
    assert [round(float(one.box[2] - one.box[0])) for one in seen] == [400, 60]


@pytest.fixture(scope="module")
def mesh():
    if not (cache_folder() / "face-mesh-0.10.21" / "ready").exists():
        pytest.skip(
            "the face detector's environment is not made; 'stimuli track VIDEO' without labels makes it"
        )
    with open_detector(one_eye=False) as detector:
        yield detector


def test_a_picture_and_its_mirror_image_have_the_same_lids(mesh, shared_data):
    pictures = islice(frames(shared_data / "face_video" / "single_face.mp4", read=rgb), 0, 72, 12)
    for picture in pictures:
        seen = mesh.detect(picture)[0]
        turned = mesh.detect(np.ascontiguousarray(picture[:, ::-1]))[0]
        assert unmirrored_face(turned, picture.shape[1]).points == pytest.approx(seen.points, abs=1e-3)


@pytest.mark.parametrize("name", ["alder-face@4", "cedar-face@4"])
def test_a_face_that_fills_the_picture_is_seen(mesh, name):
    atlas = load_atlas(SHIPPED / name)
    picture = linear_to_srgb(atlas.base_linear())
    for level in (0, 32, 64, 96, 128):
        picture[atlas.crop] = atlas.level_srgb(level)
        seen = mesh.detect(picture)
        assert len(seen) == 1
        assert np.mean(seen[0].mirror_shares) < 0.075


def test_pictures_without_a_face_show_none_in_a_margin_either(mesh):
    grey = np.full((480, 640, 3), 127, np.uint8)
    noise = np.random.default_rng(1).integers(0, 256, grey.shape, np.uint8)
    assert [mesh.detect(grey), mesh.detect(noise)] == [[], []]
