"""Label files: what is accepted, and every refusal."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from experiments.errors import InputError
from stimuli_builder.tracking.labels import Labels, load_labels, save_labels
from stimuli_builder.tracking.shapes import default_markers


def saved(tmp_path, document, raw=None):
    path = tmp_path / "labels.json"
    path.write_text(raw if raw is not None else json.dumps(document))
    return path


def spoil(document, how):
    frame = next(iter(document["frames"]))
    points = document["frames"][frame]
    if how == "few":
        document["frames"] = dict(list(document["frames"].items())[:2])
    elif how == "outside":
        points[3] = [600.0, 100.0]
    elif how == "swapped points":
        points[1], points[4] = points[4], points[1]
    elif how == "lids crossed":
        points[7][1] -= 60
    elif how == "eyes swapped":
        document["frames"][frame] = points[9:] + points[:9]
    elif how == "count":
        points.pop()
    elif how == "mixed":
        document["frames"][frame] = points[:9]
    elif how == "text":
        points[0] = ["a", 3]
    elif how == "not finite":
        points[0] = [float("nan"), 3]
    elif how == "key":
        document["frames"]["first"] = points
    elif how == "same frame":
        document["frames"]["0" + frame] = points
    elif how == "size":
        document["image_size_px"] = [512]
    elif how == "no size":
        del document["image_size_px"]
    elif how == "no frames":
        del document["frames"]
    elif how == "canthi":
        points[5] = [points[0][0] + 1, points[0][1]]
    elif how == "markers":
        document["mid_upper"] = [[2], [3]]
    return document


@pytest.mark.parametrize(
    ("how", "line"),
    [
        ("few", "2 labeled frames, but at least 3"),
        ("outside", "point 4 at (600, 100) is outside the picture of 512 x 384"),
        ("swapped points", "cross; check the point order"),
        ("lids crossed", "is above the upper lid"),
        ("eyes swapped", "the eyes are swapped"),
        ("no size", "'image_size_px' is missing; expected [width, height]"),
        ("count", "expected 18 points (or 9 for one eye), found 17"),
        ("mixed", "some frames have 9 points and some 18"),
        ("text", "point 1 is ['a', 3], expected [x, y]"),
        ("not finite", "point 1 is [nan, 3]"),
        ("key", "expected a frame number from 0, found 'first'"),
        ("same frame", "occurs twice"),
        ("size", "expected 'image_size_px'"),
        ("no frames", "'frames' is missing; expected the points"),
        ("canthi", "less than 4 px apart"),
        ("markers", "expected points 9 to 17"),
    ],
)
def test_bad_labels_end_in_one_line(document, tmp_path, how, line):
    path = saved(tmp_path, spoil(document, how))
    with pytest.raises(InputError) as caught:
        load_labels(path, (512, 384), 200)
    assert line in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_frame_given_twice_in_the_file_is_refused(document, tmp_path):
    text = json.dumps(document)
    frame = next(iter(document["frames"]))
    twice = text.replace('"frames": {', f'"frames": {{"{frame}": {json.dumps(document["frames"][frame])}, ')
    with pytest.raises(InputError, match="occurs twice"):
        load_labels(saved(tmp_path, None, raw=twice))


def test_labels_of_another_size_or_a_longer_video_are_refused(document, tmp_path):
    path = saved(tmp_path, document)
    with pytest.raises(InputError, match="made on 512 x 384 pixels, but the video has 640 x 480"):
        load_labels(path, (640, 480))
    with pytest.raises(InputError, match="the video ends at frame 4"):
        load_labels(path, (512, 384), 5)


@pytest.mark.parametrize("raw", ["", "[]", "{", "\x00", '{"frames": 3, "image_size_px": [1, 1]}'])
def test_what_is_not_a_label_file_is_refused(tmp_path, raw):
    with pytest.raises(InputError):
        load_labels(saved(tmp_path, None, raw=raw))


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(InputError, match="found none"):
        load_labels(tmp_path / "none.json")


@settings(deadline=None, max_examples=20)
@given(seed=st.integers(0, 1000))
def test_what_is_saved_is_what_is_loaded(tmp_path_factory, seed):
    rng = np.random.default_rng(seed)
    eye = np.array(
        [[0, 5], [10, -4], [20, -8], [30, -8], [40, -4], [50, 5], [38, 12], [25, 14], [12, 12]], float
    )
    frames = {n: eye + 100 + rng.normal(0, 0.4, eye.shape) for n in (0, 5, 9)}
    path = tmp_path_factory.mktemp("labels") / "labels.json"
    save_labels(Labels(path, (300, 300), default_markers(1), frames), "eye.mp4", "test")
    again = load_labels(path, (300, 300), 10)
    assert again.eyes == 1
    assert again.markers == default_markers(1)
    assert all(np.allclose(again.frames[n], frames[n], atol=6e-4) for n in frames)


def test_closed_eyes_of_a_real_label_file_are_accepted(shared_data):
    for name, eyes, count in (("single_face", 2, 20), ("short_human_3blink", 1, 16)):
        labels = load_labels(shared_data / "face_video" / f"{name}.points.json")
        assert (labels.eyes, len(labels.frames)) == (eyes, count)
