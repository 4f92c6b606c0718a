"""Irises of the actor against its exact truth; shut eyes and bare skin have none."""

import csv

import numpy as np
import pytest

from stimuli_builder.actor.face import EYE_CENTRES, EYE_WIDTH_PX, head_matrix
from stimuli_builder.actor.recording import Actor, ActorOptions
from stimuli_builder.actor.renderer import IRIS_RADIUS
from stimuli_builder.tracking.iris import IRIS_MM, measure_iris
from stimuli_builder.tracking.mesh import restored_points
from stimuli_builder.tracking.model import save_model


@pytest.fixture(scope="module")
def course():
    return Actor(ActorOptions(seconds=1.0, fps=200, seed=3)).course


def true_iris(course, number, eye):
    """Middle (2,) and diameter in px."""
    matrix, side = head_matrix(course.head[number]), 1 - 2 * eye
    gaze = course.gaze[number] * [side, 1] - [0, 0.035]
    still = gaze * EYE_WIDTH_PX * [side, 1] + EYE_CENTRES[eye]
    return still @ matrix[:, :2].T + matrix[:, 2], 2 * IRIS_RADIUS * EYE_WIDTH_PX * np.hypot(*matrix[0, :2])


def test_irises_of_open_eyes_lie_where_they_were_drawn(recording, course):
    off, wide, open_eyes = [], [], 0
    for number in range(0, 200, 4):
        for eye in range(2):
            seen = measure_iris(recording.pictures[number], recording.points[number, 9 * eye : 9 * eye + 9])
            middle, diameter = true_iris(course, number, eye)
            if course.closure[number, eye] > 0.3:
                assert seen is None
            elif course.closure[number, eye] < 0.2:
                open_eyes += 1
                assert seen is not None
                off.append(np.hypot(seen.x - middle[0], seen.y - middle[1]))
                wide.append(seen.diameter / diameter - 1)
    assert open_eyes > 40
    assert np.median(off) < 0.05 * EYE_WIDTH_PX
    assert abs(np.median(wide)) < 0.05


def test_a_close_up_is_measured_as_the_same_eye_far_away(recording):
    eye = recording.points[0, :9]
    far = measure_iris(recording.pictures[0], eye)
    near = measure_iris(np.kron(recording.pictures[0], np.ones((3, 3), np.uint8)), restored_points(eye, 3))
    assert near.diameter / 3 == pytest.approx(far.diameter, rel=0.04)
    assert (near.x + 0.5) / 3 - 0.5 == pytest.approx(far.x, abs=1.0)


def test_skin_has_no_iris(recording):
    skin = np.full_like(recording.pictures[0], 140)
    assert measure_iris(skin, recording.points[0, :9]) is None


@pytest.fixture
def track(stimuli, recording, lesson, tmp_path):
    save_model(lesson.model, tmp_path / "m.npz")
    out = tmp_path / "track.csv"
    assert stimuli("track", recording.video, "--model", tmp_path / "m.npz", "--out", out)[0] == 0
    return out


def test_the_command_shows_the_scale(stimuli, recording, course, track, tmp_path):
    out = tmp_path / "iris.csv"
    code, said, error = stimuli("iris", recording.video, track, "--out", out)
    assert (code, error) == (0, "")
    rows = list(csv.DictReader(out.read_text().splitlines()))
    assert len(rows) == 200
    assert list(rows[0])[2:5] == ["left_iris_x_px", "left_iris_y_px", "left_iris_diameter_px"]
    told = float(said.split(" mm per pixel")[0].split()[-1])
    assert told == pytest.approx(IRIS_MM / true_iris(course, 0, 0)[1], rel=0.06)


def test_a_track_of_another_video_is_refused(stimuli, recording, track, tmp_path):
    short = tmp_path / "short.csv"
    short.write_text("\n".join(track.read_text().splitlines()[:50]) + "\n")
    out = tmp_path / "iris.csv"
    code, _, error = stimuli("iris", recording.video, short, "--out", out)
    assert code == 2
    assert error.count("\n") == 1
    assert "not a track of" in error
    assert not out.exists()
