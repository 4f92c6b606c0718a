"""The synthetic actor: its truth is exact, its blinks are those of the table, its seed decides everything."""

import csv
import json

import numpy as np
import pytest

from experiments.errors import InputError
from stimuli_builder.actor.face import EYE_WIDTH_PX, eye_landmarks, landmarks, lid_distances
from stimuli_builder.actor.recording import (
    Actor,
    ActorOptions,
    blink_closure,
    choose_frames,
    course,
    label_points,
    plan_blinks,
    truth_header,
)
from stimuli_builder.cli import main
from stimuli_builder.tracking.labels import load_labels
from stimuli_builder.tracking.shapes import default_markers, inter_eyelid_distances
from stimuli_builder.video import frames, scan_video


@pytest.fixture(scope="module")
def actor():
    return Actor(ActorOptions(seconds=1.0, fps=120, seed=5))


@pytest.fixture(scope="module")
def long_course():
    seconds = 1800
    blinks = plan_blinks(seconds, np.random.default_rng([1, 4]))
    return blinks, seconds


def test_rate_intervals_and_depths_are_those_of_the_table(long_course):
    blinks, seconds = long_course
    assert 8 <= len(blinks) * 60 / seconds <= 21
    pauses = np.diff([blink.apex_s for blink in blinks])
    assert 3.0 < np.median(pauses) < 3.9
    assert 0.7 < np.std(np.log(pauses)) < 0.95
    assert 0.4 < np.mean([blink.depth == 1 for blink in blinks]) < 0.6


def test_phases_and_velocities_are_those_of_the_table(long_course):
    blinks, _ = long_course
    downs, ups, ratios, speeds = [], [], [], []
    for blink in blinks[:80]:
        times = blink.apex_s + np.arange(-0.4, 1.2, 0.0005)
        closure = blink_closure(times, blink) / blink.depth
        apex = int(closure.argmax())
        downs.append(times[apex] - times[np.argmax(closure > 0.05)])
        ups.append(times[apex + np.argmax(closure[apex:] < 0.05)] - times[apex])
        velocity = np.gradient(closure, 0.0005)
        speeds.append(velocity.max())
        ratios.append(-velocity.min() / velocity.max())
    assert 1000 * np.mean(downs) == pytest.approx(92, abs=8)
    assert 1000 * np.mean(ups) == pytest.approx(242, abs=25)
    assert 1000 * np.std(downs) == pytest.approx(17, abs=6)
    assert 16 < np.mean(speeds) < 29
    assert 0.45 < np.mean(ratios) < 0.7


def test_a_closed_eye_has_its_lids_on_one_line():
    closed = eye_landmarks(1.0)
    assert np.interp(closed[6:9, 0][::-1], closed[:6, 0], closed[:6, 1]) == pytest.approx(
        closed[6:9, 1][::-1], abs=0.012
    )
    assert eye_landmarks(0.0)[7, 1] - eye_landmarks(0.0)[2:4, 1].mean() > 0.3


def test_lower_lid_rises_and_moves_to_the_nose():
    open_eye, closed = eye_landmarks(0.0), eye_landmarks(1.0)
    rise_mm, nasal_mm = 30 * (open_eye[7] - closed[7])[1], 30 * (closed[7] - open_eye[7])[0]
    assert 0.5 <= rise_mm <= 1.0
    assert 1.4 <= nasal_mm <= 5.0


def test_distances_of_truth_and_track_mean_the_same():
    points = landmarks(np.array([0.2, 0.4]), np.array([3.0, -2.0, 0.02, 1.01]))
    assert lid_distances(points) == pytest.approx(inter_eyelid_distances(points, default_markers(2)))


def test_the_same_seed_gives_the_same_frames_and_another_does_not(actor):
    again, other = Actor(actor.options), Actor(ActorOptions(seconds=1.0, fps=120, seed=6))
    first = actor.frame(0)[0]
    assert np.array_equal(Actor(actor.options).frame(0)[0], again.frame(0)[0])
    assert first.shape == (384, 512)
    assert not np.array_equal(again.frame(1)[0], other.frame(1)[0])


def test_truth_lies_where_the_picture_shows_the_eye():
    """Between open and closed the picture changes inside the true outline, and not below the lower lid."""
    actor = Actor(ActorOptions(seconds=1.2, fps=50, seed=5, noise=0))
    closure = actor.course.closure.mean(1)
    shut, rest = int(closure.argmax()), int(np.abs(closure).argmin())
    changes = []
    for number in (rest, shut):
        picture = actor.frame(number)[0].astype(float)
        points = landmarks(np.zeros(2), actor.course.head[number])
        middle, below = points[[2, 3, 7]].mean(0), points[7] + [0, 0.3 * EYE_WIDTH_PX]
        changes.append(
            [picture[int(y) - 2 : int(y) + 3, int(x) - 2 : int(x) + 3].mean() for x, y in (middle, below)]
        )
    inside, outside = np.abs(np.diff(changes, axis=0))[0]
    assert closure[shut] > 0.9
    assert inside > 40
    assert outside < 12


def test_course_is_the_same_however_finely_it_is_sampled():
    blinks = plan_blinks(3, np.random.default_rng(1))
    coarse, fine = (course(np.arange(0, 3, step), blinks, 7) for step in (0.01, 0.0025))
    assert coarse.closure == pytest.approx(fine.closure[::4])
    assert coarse.head == pytest.approx(fine.head[::4])


def test_labelled_frames_are_varied_and_carry_the_wanted_noise(actor):
    chosen = choose_frames(actor.course, 20)
    assert len(set(chosen)) == 20
    closed = actor.course.closure[chosen].mean(1)
    assert closed.max() > 0.9
    assert closed.min() < 0.1
    exact, noisy = label_points(actor, 20, 0.0), label_points(actor, 20, 1.0)
    errors = np.array([noisy[n] - exact[n] for n in exact])
    assert errors.std() == pytest.approx(1.0, abs=0.1)


def test_command_writes_video_truth_and_labels(monkeypatch, capsys, tmp_path):
    video, truth, labels = tmp_path / "a.mp4", tmp_path / "t.csv", tmp_path / "l.json"
    parts = ["actor", "--seconds", "0.5", "--fps", "60", "--seed", "2", "--out", video, "--truth", truth]
    monkeypatch.setattr(
        "sys.argv", ["stimuli", *map(str, parts), "--labels", str(labels), "--label-frames", "6"]
    )
    with pytest.raises(SystemExit) as end:
        main()
    assert not end.value.code
    assert f"track it with: stimuli track {video} --labels {labels} --out" in capsys.readouterr().out
    info = scan_video(video)
    assert (info.frame_count, info.size_px, info.variable) == (30, (512, 384), False)
    assert info.fps == pytest.approx(60)
    with truth.open() as stream:
        rows = list(csv.DictReader(stream))
    assert list(rows[0]) == truth_header()
    assert len(rows) == 30
    assert {row["phase"] for row in rows} <= {"open", "down", "up"}
    assert all(bool(row["blink"]) == (row["phase"] != "open") for row in rows)
    assert len(load_labels(labels, (512, 384), 30).frames) == 6
    assert json.loads(labels.read_text())["video"] == "a.mp4"
    assert sum(1 for _ in frames(video)) == 30


@pytest.mark.parametrize(
    ("options", "line"),
    [
        ({"seconds": 0}, "--seconds 0: expected 0.1 to 7200"),
        ({"fps": 1}, "--fps 1: expected 10 to 2000"),
        ({"noise": -1}, "--noise -1: expected 0 to 50"),
    ],
)
def test_impossible_options_are_refused(options, line):
    with pytest.raises(InputError, match=line):
        ActorOptions(**options)


def test_the_renderer_shares_nothing_with_the_tracker():
    import ast
    from pathlib import Path

    folder = Path(__file__).parents[3] / "stimuli_builder" / "actor"
    for file in folder.glob("*.py"):
        if file.name == "cli.py":
            continue
        for node in ast.walk(ast.parse(file.read_text())):
            if isinstance(node, ast.ImportFrom):
                assert "tracking" not in (node.module or ""), file.name
