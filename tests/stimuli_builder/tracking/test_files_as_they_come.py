"""Recordings as cameras and phones write them: turned, 12 bits deep, upright and close, or turned wrongly."""

from fractions import Fraction

import av
import numpy as np
import pytest

from experiments.errors import InputError
from stimuli_builder.tracking.labels import Labels
from stimuli_builder.tracking.learn import lesson_from, training_steps
from stimuli_builder.tracking.model import TrainingOptions
from stimuli_builder.tracking.shapes import default_markers
from stimuli_builder.tracking.table import numbers, point_columns, track_rows
from stimuli_builder.tracking.track import track_video
from stimuli_builder.video import scan_video

FRAMES = 24


def written(path, pictures, codec="libx264", pixels="yuv420p", rotation_deg=0, fps=240, options=None):
    """A gray video; `rotation_deg` is what a phone would write into its head.

    8 bits are written as they are, as the model's own recording was: its gray levels belong to the model.
    """
    with av.open(str(path), "w", options=options or {}) as container:
        stream = container.add_stream(codec, rate=Fraction(fps))
        stream.height, stream.width = pictures[0].shape
        stream.pix_fmt = pixels
        if rotation_deg:
            stream.set_display_rotation(rotation_deg)
        for picture in pictures:
            if pixels == "yuv420p":
                chroma = np.full((picture.shape[0] // 2, picture.shape[1]), 128, np.uint8)
                frame = av.VideoFrame.from_ndarray(np.concatenate([picture, chroma]), format=pixels)
            else:
                grey = av.VideoFrame.from_ndarray(np.ascontiguousarray(picture), format="gray")
                frame = grey.reformat(format=pixels)
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
    return path


def points_off(model, video, out, truth):
    """Root mean square distance from the truth in px over all frames, each of which must be tracked."""
    info = scan_video(video)
    assert track_video(model, info, out).lost == 0
    names = point_columns(model.eyes)
    found = np.array([numbers(row, names, out) for row in track_rows(out)]).reshape(len(truth), -1, 2)
    return float(np.sqrt(((found - truth) ** 2).sum(-1).mean()))


@pytest.mark.parametrize("rotation_deg", [90, 180, 270])
def test_a_phone_held_otherwise_is_tracked_upright(lesson, recording, tmp_path, rotation_deg):
    turned = [np.rot90(picture, -rotation_deg // 90) for picture in recording.pictures[:FRAMES]]
    video = written(tmp_path / "phone.mp4", turned, rotation_deg=rotation_deg)
    assert scan_video(video).size_px == (512, 384)
    assert points_off(lesson.model, video, tmp_path / "t.csv", recording.points[:FRAMES]) < 0.5


def test_twelve_bits_at_a_high_rate_are_tracked_as_eight(lesson, recording, tmp_path):
    video = written(tmp_path / "deep.mkv", recording.pictures[:FRAMES], "ffv1", "yuv420p12le", fps=480)
    info = scan_video(video)
    assert (info.variable, info.fps) == (False, pytest.approx(480, rel=0.01))
    assert points_off(lesson.model, video, tmp_path / "t.csv", recording.points[:FRAMES]) < 0.5


def test_one_eye_in_an_upright_picture_is_tracked(recording, tmp_path):
    left = np.array([20, 0])
    eye = recording.points[:, :9] - left
    cut = [picture[:, 20:260] for picture in recording.pictures]
    assert (eye > 0).all()
    assert (eye < [240, 384]).all()
    video = written(tmp_path / "eye.mp4", cut, fps=200)
    info = scan_video(video)
    labels = Labels(
        tmp_path / "l.json", (240, 384), default_markers(1), {n: eye[n] for n in range(0, 200, 16)}
    )
    steps = []
    lesson = lesson_from(
        info, labels, TrainingOptions(), folds=2, refine=False, advance=lambda: steps.append(1)
    )
    assert points_off(lesson.model, video, tmp_path / "t.csv", eye) < 0.7
    assert len(steps) == training_steps(2, False) == 3


def test_a_wrong_rotation_in_the_head_is_one_line_and_no_track(lesson, recording, tmp_path):
    video = written(tmp_path / "wrong.mp4", recording.pictures[:12], rotation_deg=180)
    with pytest.raises(InputError, match="no eyes like the labeled ones") as refused:
        track_video(lesson.model, scan_video(video), tmp_path / "t.csv")
    assert "\n" not in str(refused.value)
    assert not (tmp_path / "t.csv").exists()
