"""A hand, a cup or a cloth over an eye is not called an eye, whatever its texture; a blink is no cover."""

import csv
from dataclasses import replace

import cv2
import numpy as np
import pytest

from experiments.errors import InputError
from stimuli_builder.environments import cache_folder
from stimuli_builder.tracking.covers import Look, covered_frames, covered_looks, textures_of
from stimuli_builder.tracking.faults import Faults
from stimuli_builder.tracking.fit import Fitter
from stimuli_builder.tracking.labelfree import label_free_lesson
from stimuli_builder.tracking.survey import survey
from stimuli_builder.tracking.track import track_video
from stimuli_builder.tracking.training import TrainingOptions
from stimuli_builder.video import frames
from stimuli_builder.video_scan import scan_video
from tests.stimuli_builder.tracking.test_bad_input import write_frames
from tests.stimuli_builder.tracking.test_files_as_they_come import written

PLAIN_TEXTURES = ("skin", "wood", "cloth", "fingers")
TEXTURES = (*PLAIN_TEXTURES, "cheek", "forehead")


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
        above = y + round((1.9 if kind == "cheek" else -1.9) * wide)
        patch = picture[np.clip(above, 0, len(picture) - height) :][:height, x : x + width]
    mask = cv2.ellipse(
        np.zeros((height, width)), (width // 2, height // 2), (width // 2, height // 2), 0, 0, 360, 1, -1
    )
    mask = cv2.GaussianBlur(mask, (0, 0), 1.5)
    spoilt = picture.copy()
    under = spoilt[y : y + height, x : x + width]
    under[:] = np.clip(under * (1 - mask) + (patch + rng.normal(0, 1.5, mask.shape)) * mask, 0, 255)
    return spoilt


@pytest.fixture(scope="module")
def seen(recording):
    """Textures (50, 2, pixels) of the actor's eyes in every fourth frame."""
    both = zip(recording.pictures[::4], recording.points[::4], strict=True)
    return np.array([textures_of(picture, points) for picture, points in both])


def looks(textures, step_s=0.08):
    """A look for each of textures, as of a slower recording than they are from."""
    return [Look(number * step_s, one) for number, one in enumerate(textures)]


def covered_by(textures, recording, numbers, eye, kind):
    """Textures of the actor whose eye is covered at the looks of those numbers."""
    spoilt = textures.copy()
    for n in numbers:
        points = recording.points[4 * n]
        picture = cover(recording.pictures[4 * n], points.reshape(2, 9, 2)[eye], kind)
        spoilt[n, eye] = textures_of(picture, points)[eye]
    return spoilt


def closed(seen):
    """The actor's most closed frame: there both eyes are least like themselves."""
    likeness = (seen * np.median(seen, axis=0)).mean(2)
    return int(likeness.min(1).argmin())


def open_and_shut(seen, shut):
    """The actor's open eyes for fifty looks, each eye shut at the looks named for it."""
    middle = int((seen * np.median(seen, axis=0)).mean((1, 2)).argmax())
    textures = np.repeat(seen[middle][None], 50, axis=0)
    for eye, numbers in enumerate(shut):
        textures[list(numbers), eye] = seen[closed(seen), eye]
    return textures + np.random.default_rng(1).normal(0, 0.05, textures.shape)


@pytest.mark.parametrize("step", [1, 3])
def test_no_look_of_a_recording_is_taken_for_a_cover(seen, step):
    shut = float((seen[closed(seen)] * np.median(seen, axis=0)).mean(1).max())
    assert shut < 0.6
    assert covered_looks(looks(seen[::step], 0.08 * step)) == {}


@pytest.mark.parametrize("kind", TEXTURES)
@pytest.mark.parametrize("eye", [0, 1])
def test_a_textured_cover_is_told_from_the_eye(recording, seen, kind, eye):
    told = covered_looks(looks(covered_by(seen, recording, range(4, 20), eye, kind)))
    assert sorted(told) == list(range(4, 20))
    assert all(why.startswith(f"{('left', 'right')[eye]} eye covered: ") for why in told.values())


def test_a_cover_without_any_texture_is_told(seen):
    textures = seen.copy()
    textures[4:20, 1] = 0
    assert sorted(covered_looks(looks(textures))) == list(range(4, 20))


def test_an_eye_covered_for_most_of_a_recording_is_still_known_by_the_other_one(recording, seen):
    told = covered_looks(looks(covered_by(seen, recording, range(5, 42), 0, "wood")))
    assert sorted(told) == list(range(5, 42))


@pytest.mark.parametrize("blink", [range(22, 25), range(29, 33)])
def test_a_cover_stays_one_while_the_other_eye_blinks(seen, recording, blink):
    textures = covered_by(open_and_shut(seen, ([], blink)), recording, range(15, 33), 0, "fingers")
    assert sorted(covered_looks(looks(textures))) == list(range(15, 33))


def test_eyes_covered_one_after_the_other_are_both_covered_in_between(seen, recording):
    textures = covered_by(open_and_shut(seen, ([], [])), recording, range(6, 26), 0, "fingers")
    textures[:, 1] = covered_by(textures, recording, range(16, 36), 1, "wood")[:, 1]
    told = covered_looks(looks(textures))
    assert [told.get(n, "").partition(" covered")[0] for n in (5, 10, 20, 30, 36)] == [
        "",
        "left eye",
        "both eyes",
        "right eye",
        "",
    ]


def test_a_video_that_shows_covers_alone_is_refused_with_their_number(seen, recording, tmp_path):
    spoilt = covered_by(open_and_shut(seen, ([], [])), recording, range(4, 40), 1, "cloth")
    info = scan_video(recording.video)
    info = replace(info, times_s=np.arange(50) * 0.08)
    with pytest.raises(InputError, match=r"one eye is covered on 36 of 50 frames that show a face, too few"):
        covered_frames(info, dict(enumerate(spoilt)), fewest=20)
    assert sorted(covered_frames(info, dict(enumerate(spoilt)), fewest=14)) == list(range(4, 40))


BLINKS = [7, 8, 9, 22, 23, 37, 38]
KEPT_SHUT = [7, 8, 9, *range(22, 45)]


@pytest.mark.parametrize(
    ("left", "right"),
    [
        (BLINKS, []),  # a palsy leaves the other lid open
        ([], BLINKS),
        (KEPT_SHUT, []),
        (KEPT_SHUT, BLINKS[:3]),
        (KEPT_SHUT, KEPT_SHUT),
        (range(20, 41), range(22, 38)),  # one lid opens a moment after the other
    ],
)
def test_an_eye_that_is_shut_is_not_covered(seen, left, right):
    assert covered_looks(looks(open_and_shut(seen, (left, right)))) == {}


def test_no_look_at_all_is_no_cover():
    assert covered_looks([]) == {}


@pytest.mark.parametrize("kind", ["skin", "cheek"])
def test_a_model_from_labels_does_not_track_a_textured_cover(kind, lesson, recording, tmp_path):
    """No detector looks here: the model has never seen the cover, and its residual tells it."""
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
def face(shared_data, monkeypatch):
    """Frames of a real face; every third is looked at, so that the detector is quick."""
    if not (cache_folder() / "face-mesh-0.10.21" / "ready").exists():
        pytest.skip(
            "the face detector's environment is not made; 'stimuli track VIDEO' without labels makes it"
        )
    monkeypatch.setattr("stimuli_builder.tracking.survey.LOOKED_AT", 24)
    return list(frames(shared_data / "face_video" / "single_face.mp4"))


@pytest.mark.parametrize(("kind", "first"), [("skin", 36), ("cheek", 36), ("wood", 12)])
def test_a_textured_cover_on_a_real_face_is_never_tracked(face, tmp_path, kind, first):
    plain = tmp_path / "plain.mp4"
    write_frames(plain, face, fps=30)
    at = survey(scan_video(plain), one_eye=False)
    assert not at.covered
    spoilt, out = list(face), tmp_path / "t.csv"
    for n in range(first, first + 27):
        points = at.points[min(at.points, key=lambda look: abs(look - n))]
        spoilt[n] = cover(face[n], points[:9], kind)
    video = tmp_path / "covered.mp4"
    write_frames(video, spoilt, fps=30)
    info = scan_video(video)
    known = survey(info, one_eye=False)
    assert set(known.covered) == set(range(first, first + 27, 3))
    lesson = label_free_lesson(info, known, TrainingOptions(), one_eye=False, refine=False)
    track_video(lesson.model, info, out, None, known.hints)
    with out.open() as stream:
        rows = list(csv.DictReader(stream))
    assert {row["status"] for row in rows[first : first + 27]} <= {"lost", "doubtful"}
    assert all("left eye covered" in row["reason"] for row in rows[first : first + 27])
    assert {row["status"] for row in [*rows[: first - 1], *rows[first + 30 :]]} == {"tracked"}


@pytest.mark.parametrize("eye", [0, 1])
def test_an_eye_whose_picture_is_flat_is_no_eye(eye, lesson, recording):
    """A model that has learnt a cover has no residual on it; that its picture is flat then tells it."""
    fitter, faults = Fitter(lesson.model), Faults(lesson.model)
    start, kept = lesson.model.poses[0], np.zeros(len(lesson.model.sd))
    assert faults.flat(fitter.fit(recording.pictures[0], kept, start, max_iterations=1)) == ""
    flat = recording.pictures[0].copy()
    x, y = recording.points[0].reshape(2, 9, 2)[eye].mean(0).round().astype(int).tolist()
    cv2.ellipse(flat, (x, y), (80, 50), 0, 0, 360, 105, -1)
    seen = fitter.fit(flat, kept, start, max_iterations=1)
    assert faults.flat(seen) == f"{('left', 'right')[eye]} eye covered: its picture is flat"
