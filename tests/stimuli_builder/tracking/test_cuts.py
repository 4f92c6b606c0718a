"""A cut to somebody else: no number from the first person's model that looks good and is not."""

import csv
from itertools import islice

import cv2
import numpy as np
import pytest

from stimuli_builder.actor.recording import Actor, ActorOptions, write_truth, write_video
from stimuli_builder.tracking.detector.mesh import cache_folder
from stimuli_builder.tracking.labelfree import label_free_lesson
from stimuli_builder.tracking.model import TrainingOptions
from stimuli_builder.tracking.shapes import widths
from stimuli_builder.tracking.survey import survey
from stimuli_builder.tracking.track import track_video
from stimuli_builder.video import frames, scan_video
from tests.stimuli_builder.tracking.test_bad_input import write_frames
from tests.stimuli_builder.tracking.test_files_as_they_come import written


def rows_of(model, video, hints, out):
    track_video(model, scan_video(video), out, None, hints)
    with out.open() as stream:
        return list(csv.DictReader(stream))


@pytest.mark.parametrize("seed", [11, 12])
def test_after_a_cut_to_another_actor_no_frame_is_tracked_and_wrong(seed, lesson, recording, tmp_path):
    other = Actor(ActorOptions(seconds=0.2, fps=200, seed=seed))
    write_video(other, tmp_path / "other.mp4", lambda: None)
    write_truth(other, tmp_path / "other.csv")
    truth = np.loadtxt(tmp_path / "other.csv", delimiter=",", skiprows=1, usecols=range(2, 38))
    truth = truth.reshape(-1, 18, 2)
    written(tmp_path / "cut.mp4", [*recording.pictures[:20], *frames(tmp_path / "other.mp4")])
    rows = rows_of(lesson.model, tmp_path / "cut.mp4", {}, tmp_path / "t.csv")
    assert {row["status"] for row in rows[:20]} <= {"tracked", "doubtful"}
    for row, points in zip(rows[20:], truth, strict=True):
        if row["status"] in {"tracked", "reinitialised"}:
            given = np.array([[float(row[f"{axis}{n:02d}"]) for axis in "xy"] for n in range(1, 19)])
            off = float(np.sqrt(((given - points) ** 2).sum(1).mean()))
            assert off < 0.05 * widths(points), row["frame"]
        else:
            assert row["reason"], row["frame"]


@pytest.fixture
def detector(monkeypatch):
    if not (cache_folder() / "face-mesh-0.10.21" / "ready").exists():
        pytest.skip(
            "the face detector's environment is not made; 'stimuli track VIDEO' without labels makes it"
        )
    monkeypatch.setattr("stimuli_builder.tracking.survey.LOOKED_AT", 24)


def test_after_a_cut_to_a_close_up_of_another_person_no_frame_is_tracked(detector, shared_data, tmp_path):
    face = list(frames(shared_data / "face_video" / "single_face.mp4"))
    eye = islice(frames(shared_data / "face_video" / "short_human_3blink.mp4"), 24)
    close = [cv2.resize(picture, (640, 360), interpolation=cv2.INTER_AREA) for picture in eye]
    write_frames(tmp_path / "cut.mp4", [*face[:48], *close], fps=30)
    info = scan_video(tmp_path / "cut.mp4")
    seen = survey(info, one_eye=False)
    lesson = label_free_lesson(info, seen, TrainingOptions(), one_eye=False, refine=False)
    rows = rows_of(lesson.model, tmp_path / "cut.mp4", seen.hints, tmp_path / "t.csv")
    assert {row["status"] for row in rows[48:]} <= {"lost", "doubtful"}
    assert all(row["reason"] for row in rows[48:])
    assert {row["status"] for row in rows[:20]} == {"tracked"}
