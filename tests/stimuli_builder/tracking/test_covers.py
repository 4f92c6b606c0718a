"""A hand, a cup or a cloth over an eye is not called an eye, whatever its texture; a blink is not a cover."""

import csv
from pathlib import Path

import cv2
import numpy as np
import pytest

from experiments.errors import InputError
from stimuli_builder.characters.atlas import SHIPPED, load_atlas
from stimuli_builder.characters.colour import linear_to_srgb
from stimuli_builder.tracking.detector.detection import contour_spread
from stimuli_builder.tracking.detector.mesh import FaceMesh, cache_folder
from stimuli_builder.tracking.fit import Fitter
from stimuli_builder.tracking.labelfree import label_free_lesson
from stimuli_builder.tracking.model import TrainingOptions
from stimuli_builder.tracking.search import Faults
from stimuli_builder.tracking.survey import LEAST_SPREAD, covered_frames, likenesses, surroundings_of, survey
from stimuli_builder.tracking.track import track_video
from stimuli_builder.video import frames, scan_video
from tests.stimuli_builder.tracking.test_bad_input import write_frames
from tests.stimuli_builder.tracking.test_files_as_they_come import written

VIDEO = Path("video.mp4")
PLAIN_TEXTURES = ("skin", "wood", "cloth", "fingers")


def clouds(height, width, blur, rng):
    """Noise of one grain, of standard deviation 1."""
    noise = cv2.GaussianBlur(rng.normal(size=(height + 60, width + 60)), (0, 0), blur)
    return noise[30 : 30 + height, 30 : 30 + width] / noise.std()


def texture(kind, height, width, rng):
    """Grey levels (height, width) of something that may lie over an eye."""
    y, x = np.mgrid[:height, :width] * 1.0
    if kind == "skin":
        mottled = zip((1, 4, 12), (3, 6, 10), strict=True)
        return 140 + sum(size * clouds(height, width, blur, rng) for blur, size in mottled)
    if kind == "wood":
        rings = np.sin(2 * np.pi * (y + 3 * clouds(height, width, 8, rng)) / 9)
        return 120 + 25 * rings + 4 * clouds(height, width, 1, rng)
    if kind == "cloth":
        return 110 + 30 * ((x // 6 + y // 6) % 2) + 20 * (x // 12 % 2) + 4 * clouds(height, width, 1, rng)
    fingers = np.sin(np.pi * ((x + 0.15 * y) % 18) / 18)
    return 90 + 70 * fingers**0.7 + 5 * clouds(height, width, 5, rng)


def cover(picture, eye, kind, seed=0):
    """A copy of a grey picture with an ellipse of a texture, or of the face's skin, over an eye (9, 2)."""
    rng = np.random.default_rng(seed)
    wide = np.hypot(*(eye[5] - eye[0]))
    height, width = int(1.8 * wide), int(2.3 * wide)
    x, y = eye.mean(0).round().astype(int) - (width // 2, height // 2)
    if kind in PLAIN_TEXTURES:
        patch = texture(kind, height, width, rng)
    else:
        below = y + round(1.9 * wide)
        patch = picture[np.clip(below, 0, len(picture) - height) :][:height, x : x + width]
    mask = cv2.ellipse(
        np.zeros((height, width)), (width // 2, height // 2), (width // 2, height // 2), 0, 0, 360, 1, -1
    )
    mask = cv2.GaussianBlur(mask, (0, 0), 1.5)
    spoilt = picture.copy()
    under = spoilt[y : y + height, x : x + width]
    under[:] = np.clip(under * (1 - mask) + (patch + rng.normal(0, 1.5, mask.shape)) * mask, 0, 255)
    return spoilt


CURVE = np.linspace(0, 1, 9)
UPPER, LOWER = np.c_[CURVE, -0.6 * CURVE * (1 - CURVE)], np.c_[1 - CURVE, 0.4 * CURVE * (1 - CURVE)]
"""An eye of width 1 from its image-left canthus, as the iris network draws it."""


class DrawsWhereItLooks:
    """A detector's worker: a face with two eyes of 40 px, read in regions, of which one may be covered."""

    def __init__(self, covered):
        self._covered = covered

    def ask(self, operation, picture, **more):
        del picture
        middles = np.array([[100, 100], [200, 100]])
        if operation == "faces":
            eyes = [[(m + 40 * (one - [0.5, 0])).tolist() for one in (UPPER, LOWER)] for m in middles]
            return {
                "faces": [{"box": [50, 50, 250, 250], "eyes": [[*eye, np.zeros((5, 2))] for eye in eyes]}]
            }
        answers = []
        for x, y, side, *_ in more["regions"]:
            number = int(x > 150)
            middle, width = (
                (np.array([x, y]), side / 2.9) if number == self._covered else (middles[number], 40)
            )
            answers.append([*((middle + width * (one - [0.5, 0])).tolist() for one in (UPPER, LOWER)), []])
        return {"eyes": answers}


@pytest.mark.parametrize("eye", [0, 1])
def test_lids_that_are_drawn_wherever_one_looks_spread(eye):
    (seen,) = FaceMesh(DrawsWhereItLooks(eye)).detect(np.zeros((300, 300, 3), np.uint8))
    assert seen.spreads[1 - eye] == pytest.approx(0, abs=1e-9)
    assert seen.spreads[eye] > 2 * LEAST_SPREAD


def test_a_spread_is_part_of_the_eyes_width_and_free_of_what_all_views_share():
    contours = np.full((2, 16, 2), 70.0)
    contours[0] += [3, 4]
    contours[1] -= [3, 4]
    assert contour_spread(contours, 50) == pytest.approx(0.1)


def looks(spread, covers, count=40, eyes=2):
    """Spreads of eyes that are read alike in all looks, and covers (eye, looks)."""
    spreads = spread * np.random.default_rng(1).uniform(0.8, 1.6, (count, eyes))
    for eye, numbers in covers:
        spreads[list(numbers), eye] = np.random.default_rng(2).uniform(0.1, 0.2, len(numbers))
    return dict(enumerate(spreads.tolist()))


@pytest.mark.parametrize("spread", [0.015, 0.025, 0.05])
def test_eyes_that_stay_are_not_covered_in_a_sharp_picture_or_a_poor_one(spread):
    assert covered_frames(VIDEO, looks(spread, []), 6) == {}
    assert covered_frames(VIDEO, looks(spread, [], eyes=1), 6) == {}


@pytest.mark.parametrize(
    ("covers", "eyes", "words"),
    [
        ([(0, range(5, 9))], 1, "eye covered, closed tightly or turned away: "),
        ([(0, range(5, 9))], 2, "left eye covered, closed tightly or turned away: "),
        ([(1, range(5, 6))], 2, "right eye covered, closed tightly or turned away: "),
        ([(0, range(5, 9)), (1, range(5, 9))], 2, "both eyes covered, closed tightly or turned away: "),
        ([(0, range(5, 32)), (1, range(5, 32))], 2, "both eyes covered, closed tightly or turned away: "),
    ],
)
def test_covers_are_detected_however_brief_or_long_and_on_all_eyes_at_once(covers, eyes, words):
    told = covered_frames(VIDEO, looks(0.025, covers, eyes=eyes), 6)
    assert sorted(told) == list(covers[0][1])
    assert all(why.startswith(words) for why in told.values())


def test_a_look_that_a_cover_nearly_hides_from_is_detected_by_those_next_to_it():
    seen = looks(0.025, [(0, [5, 6, 8])], eyes=1)
    assert sorted(covered_frames(VIDEO, seen | {7: [0.05], 20: [0.05]}, 6)) == [5, 6, 7, 8]


def test_looks_apart_in_time_are_not_next_to_one_another():
    seen = looks(0.025, [(0, [5, 6, 8])], eyes=1) | {7: [0.05]}
    apart = {n + 100 * (n > 6) + 100 * (n > 7): spreads for n, spreads in seen.items()}
    assert sorted(covered_frames(VIDEO, apart, 6)) == [5, 6, 208]


def test_blinks_that_are_read_less_steadily_are_not_covers():
    seen = looks(0.02, [], eyes=1)
    assert covered_frames(VIDEO, seen | {n: [0.05] for n in (5, 6, 20, 21, 22, 35)}, 6) == {}


@pytest.mark.parametrize("covers", [range(5, 37), range(40)])
def test_covers_for_most_of_a_recording_or_all_of_it_are_detected(covers):
    seen = looks(0.025, [(0, covers)])
    with pytest.raises(InputError, match=f"an eye is covered in {len(covers)} of 40 frames that show one"):
        covered_frames(VIDEO, seen, fewest=20)
    assert sorted(covered_frames(VIDEO, seen, fewest=0)) == list(covers)


def drawn_face(turn_deg=0.0, size=1.0, lids=0.3, away=(0, 0)):
    """A picture (300, 400, 3) with brows, cheeks and two eyes of 40 px, and their points (18, 2)."""
    y, x = np.mgrid[:300, :400] * 1.0
    grey = 150 + 30 * np.sin(x / 37) * np.cos(y / 29)
    for middle in (140, 260):
        grey -= 90 * np.exp(-(((x - middle) / 28) ** 2) - ((y - 122) / 4) ** 2)
        inside = np.hypot((x - middle) / 20, (y - 150) / max(40 * lids / 2, 0.5)) < 1
        grey = np.where(inside, 80, grey)
    curve = np.linspace(-1, 1, 6)
    upper = np.c_[20 * curve, -6 * (1 - curve**2)]
    eye = np.concatenate([upper, np.c_[[10, 0, -10], [4, 5, 4]]])
    points = np.concatenate([eye + np.array([140, 150]), eye * [-1, 1] + np.array([260, 150])])
    matrix = cv2.getRotationMatrix2D((200, 150), turn_deg, size)
    matrix[:, 2] += away
    turned = cv2.warpAffine(grey.astype(np.float32), matrix, (400, 300), borderMode=cv2.BORDER_REFLECT)
    rgb = np.repeat(turned[..., None], 3, axis=2).clip(0, 255).astype(np.uint8)
    return rgb, points @ matrix[:, :2].T + matrix[:, 2]


def test_surroundings_are_the_same_wherever_the_head_is_and_whatever_the_lids_do():
    first = surroundings_of(*drawn_face())
    assert first.shape[0] == 2
    for other in (drawn_face(8, 1.2, away=(9, -5)), drawn_face(lids=0.02), drawn_face(-5, 0.9, lids=0.02)):
        for one, two in zip(surroundings_of(*other), first, strict=True):
            assert likenesses(one[0], two[:1])[0] > 0.95
    picture, points = drawn_face()
    cv2.ellipse(picture, (140, 150), (60, 40), 20, 0, 360, (160, 150, 140), -1)
    covers = surroundings_of(picture, points)
    assert max(likenesses(one, first[0, :1])[0] for one in covers[0]) < 0.5
    assert likenesses(covers[1, 0], first[1, :1])[0] > 0.95


def test_surroundings_of_lids_read_low_and_wide_are_found_where_they_lie():
    """So the detector reads eyes that shut."""
    (picture, points), (closed, _) = drawn_face(), drawn_face(lids=0.02)
    for row in (116, 126, 170, 178):
        picture[row : row + 2] //= 2
        closed[row : row + 2] //= 2
    usual, eyes = surroundings_of(picture, points), points.reshape(2, 9, 2)
    low = (eyes - eyes.mean(1, keepdims=True)) * 1.09 + eyes.mean(1, keepdims=True) + [0, 4]
    seen = surroundings_of(closed, low.reshape(18, 2))
    for places, first in zip(seen, usual, strict=True):
        own, *others = (likenesses(one, first[:1])[0] for one in places)
        assert own < 0.85
        assert max(others) > 0.9
    spreads = looks(0.025, [], count=20) | {n: [0.07, 0.07] for n in range(20, 26)}
    around = dict.fromkeys(range(20), usual) | dict.fromkeys(range(20, 26), seen)
    assert covered_frames(VIDEO, spreads, 6, around) == {}


def test_surroundings_beyond_the_picture_are_not_compared():
    picture, points = drawn_face()
    whole, cut = surroundings_of(picture, points), surroundings_of(picture[:, 120:], points - [120, 0])
    assert np.isfinite(whole).all()
    assert np.isnan(cut[0]).any()
    assert np.isfinite(cut[1]).all()
    assert likenesses(cut[0, 0], whole[0, :1])[0] > 0.99
    barely = surroundings_of(picture[128:172, 116:160], points - [116, 128])
    assert max(likenesses(one, whole[0, :1])[0] for one in barely[0]) == 0


def surroundings(count=40, eyes=2, others=(), seed=3):
    """Of looks that all show the same eyes, but for those of `others`, which show something else."""
    rng = np.random.default_rng(seed)
    usual, strange = rng.normal(size=(2, eyes, 1, 200))
    return {
        n: ((strange if n in others else usual) + 0.3 * rng.normal(size=(eyes, 1, 200))).astype(np.float32)
        for n in range(count)
    }


@pytest.mark.parametrize("spread", [0.062, 0.075, 0.11])
def test_shut_and_averted_eyes_in_their_usual_surroundings_are_not_covered(spread):
    seen = looks(0.025, []) | {n: [spread, 0.9 * spread] for n in range(10, 25)}
    assert set(covered_frames(VIDEO, seen, 6)) == set(range(10, 25))
    assert covered_frames(VIDEO, seen, 6, surroundings()) == {}


@pytest.mark.parametrize("spread", [0.062, 0.075, 0.11])
def test_unsteady_eyes_in_strange_surroundings_are_covered(spread):
    seen = looks(0.025, []) | {n: [spread, 0.02] for n in range(10, 25)}
    told = covered_frames(VIDEO, seen, 6, surroundings(others=range(10, 25)))
    assert set(told) == set(range(10, 25))
    assert all(why.startswith("left eye covered: ") and "surroundings" in why for why in told.values())


def test_a_small_thing_over_one_eye_is_a_cover_in_the_usual_surroundings_too():
    """Eyes shut and look aside together: where the other one is as ever, this one is not shut."""
    seen = {n: [0.025, 0.025] for n in range(40)} | {n: [0.075, 0.026] for n in range(10, 25)}
    assert set(covered_frames(VIDEO, seen, 6, surroundings())) == set(range(10, 25))


def test_an_eye_shuts_with_its_fellow_however_steadily_that_one_is_read():
    seen = {n: [0.025, 0.04] for n in range(40)} | {n: [0.075, 0.045] for n in range(10, 25)}
    wide = {n: np.array([0.3, 0.3]) for n in range(40)} | {n: np.array([0.1, 0.1]) for n in range(10, 25)}
    usual, strange = surroundings(), surroundings(others=range(10, 25))
    assert set(covered_frames(VIDEO, seen, 6, usual)) == set(range(10, 25))
    assert covered_frames(VIDEO, seen, 6, usual, wide) == {}
    assert set(covered_frames(VIDEO, seen, 6, strange, wide)) == set(range(10, 25))
    open_fellow = wide | {n: np.array([0.1, 0.3]) for n in range(10, 25)}
    assert set(covered_frames(VIDEO, seen, 6, usual, open_fellow)) == set(range(10, 25))


def test_one_steady_look_at_a_cover_makes_no_cover_familiar():
    seen = looks(0.025, []) | {n: [0.09, 0.09] for n in range(10, 25)} | {9: [0.03, 0.03]}
    assert set(covered_frames(VIDEO, seen, 6, surroundings(others=range(9, 25)))) == set(range(10, 25))


def test_without_steady_looks_every_unsteady_eye_is_covered_or_shut():
    seen = {n: [0.05, 0.05] for n in range(40)} | {n: [0.12, 0.12] for n in range(10, 25)}
    told = covered_frames(VIDEO, seen, 6, surroundings())
    assert set(told) == set(range(10, 25))
    assert all("closed tightly or turned away" in why for why in told.values())


@pytest.mark.parametrize("kind", ["skin", "cheek"])
def test_a_model_from_labels_does_not_track_a_textured_cover(kind, lesson, recording, tmp_path):
    """No detector looks here: the model has never seen the cover, and its residual shows it."""
    pictures = list(recording.pictures[:40])
    for n in range(15, 25):
        pictures[n] = cover(pictures[n], recording.points[n, 9:], kind)
    out = tmp_path / "t.csv"
    written(tmp_path / "covered.mp4", pictures)
    track_video(lesson.model, scan_video(tmp_path / "covered.mp4"), out)
    with out.open() as stream:
        rows = list(csv.DictReader(stream))
    assert {row["status"] for row in rows[15:25]} <= {"lost", "doubtful"}
    assert all("right eye covered" in row["reason"] for row in rows[15:25])
    assert {row["status"] for row in [*rows[:15], *rows[26:]]} <= {"tracked", "doubtful"}
    assert {rows[0]["status"], rows[-1]["status"]} == {"tracked"}


@pytest.fixture
def detector(monkeypatch):
    """Some 24 frames are looked at, so that the detector is quick."""
    if not (cache_folder() / "face-mesh-0.10.21" / "ready").exists():
        pytest.skip(
            "the face detector's environment is not made; 'stimuli track VIDEO' without labels makes it"
        )
    monkeypatch.setattr("stimuli_builder.tracking.survey.LOOKED_AT", 24)


@pytest.fixture
def face(detector, shared_data):
    """Frames of a real face."""
    return list(frames(shared_data / "face_video" / "single_face.mp4"))


def tracked(video, pictures):
    """Rows of the track of grey pictures without labels, and what the detector saw."""
    write_frames(video, pictures, fps=30)
    info, out = scan_video(video), video.with_suffix(".csv")
    known = survey(info, one_eye=False)
    lesson = label_free_lesson(info, known, TrainingOptions(), one_eye=False, refine=False)
    track_video(lesson.model, info, out, None, known.hints)
    with out.open() as stream:
        return list(csv.DictReader(stream)), known


@pytest.mark.parametrize(
    ("kind", "first", "eyes"),
    [
        ("skin", 36, [0]),
        ("cheek", 36, [0]),
        ("wood", 12, [0]),
        ("fingers", 36, [0, 1]),
        ("cheek", 12, [0, 1]),
    ],
)
def test_a_textured_cover_on_a_real_face_is_never_tracked(face, tmp_path, kind, first, eyes):
    plain = tmp_path / "plain.mp4"
    write_frames(plain, face, fps=30)
    at = survey(scan_video(plain), one_eye=False)
    assert not at.covered
    spoilt = list(face)
    for n in range(first, first + 27):
        points = at.points[min(at.points, key=lambda look: abs(look - n))].reshape(2, 9, 2)
        for eye in eyes:
            spoilt[n] = cover(spoilt[n], points[eye], kind)
    rows, known = tracked(tmp_path / "covered.mp4", spoilt)
    assert set(known.covered) == set(range(first, first + 27, 3))
    assert {row["status"] for row in rows[first : first + 27]} <= {"lost", "doubtful"}
    words = "left eye covered:" if eyes == [0] else "both eyes covered:"
    assert all(words in why for why in known.covered.values())
    assert all("covered" in row["reason"] for row in rows[first : first + 27])
    assert {row["status"] for row in [*rows[: first - 1], *rows[first + 30 :]]} == {"tracked"}


def test_a_face_that_keeps_its_eyes_shut_is_not_covered(detector, tmp_path):
    """Rendered lids that stay shut are read less steadily, in one of two eyes by more than the limit."""
    atlas = load_atlas(SHIPPED / "alder-face@4")
    base, rng = linear_to_srgb(atlas.base_linear()), np.random.default_rng(4)
    pictures = []
    for closure in np.repeat([0.0, 0.5, 1.0, 1.0, 0.0], 10):
        base[atlas.crop] = atlas.level_srgb(int(np.abs(atlas.closures - closure).argmin()))
        small = cv2.resize(base, (454, 568), interpolation=cv2.INTER_AREA).mean(2)
        pictures.append((small + rng.normal(0, 4, small.shape)).clip(0, 255).astype(np.uint8))
    write_frames(tmp_path / "shut.mp4", pictures, fps=30)
    seen = survey(scan_video(tmp_path / "shut.mp4"), one_eye=False)
    assert seen.covered == {}
    assert len(seen.points) == seen.looked_at


def test_no_look_at_a_real_close_up_is_called_covered(detector, shared_data):
    info = scan_video(shared_data / "face_video" / "short_human_3blink.mp4")
    assert survey(info, one_eye=True).covered == {}


@pytest.mark.parametrize("eye", [0, 1])
def test_an_eye_whose_picture_is_flat_is_not_an_eye(eye, lesson, recording):
    """A model that has learned a cover has no residual on it; then the flat picture shows it."""
    fitter, faults = Fitter(lesson.model), Faults(lesson.model)
    start, kept = lesson.model.poses[0], np.zeros(len(lesson.model.sd))
    assert faults.flat(fitter.fit(recording.pictures[0], kept, start, max_iterations=1)) == ""
    flat = recording.pictures[0].copy()
    x, y = recording.points[0].reshape(2, 9, 2)[eye].mean(0).round().astype(int).tolist()
    cv2.ellipse(flat, (x, y), (80, 50), 0, 0, 360, 105, -1)
    seen = fitter.fit(flat, kept, start, max_iterations=1)
    assert faults.flat(seen) == f"{('left', 'right')[eye]} eye covered: its picture is flat"
