"""Tracking the synthetic actor: accuracy, the table, recovery, and frames that must not get a number."""

import csv

import cv2
import numpy as np
import pytest

from experiments.errors import InputError
from stimuli_builder.tracking.accuracy import compare_with_truth, residual_limits
from stimuli_builder.tracking.labels import load_labels
from stimuli_builder.tracking.model import load_model, save_model
from stimuli_builder.tracking.table import COLUMN_MEANINGS, track_columns
from stimuli_builder.tracking.track import track_video
from stimuli_builder.tracking.tracker import Tracker
from stimuli_builder.video import frames, rgb, scan_video


@pytest.fixture(scope="module")
def track(recording, lesson, tmp_path_factory):
    out = tmp_path_factory.mktemp("track") / "track.csv"
    summary = track_video(lesson.model, scan_video(recording.video), out)
    return out, summary


def test_actor_is_tracked_within_the_limits(track, recording):
    with pytest.raises(InputError, match="swap them"):
        compare_with_truth(recording.truth, track[0])
    report = compare_with_truth(track[0], recording.truth)
    assert (report.frames, report.lost, report.reinitialised) == (200, 0, 0)
    assert report.rms_px < 0.5
    assert report.blink_p95_px < 1.0
    assert report.distance_sd_px < 0.3


def test_track_has_the_promised_columns(track):
    with track[0].open() as stream:
        rows = list(csv.DictReader(stream))
    assert list(rows[0]) == track_columns(2)
    assert [row["frame"] for row in rows] == [str(n) for n in range(200)]
    assert float(rows[100]["time_s"]) == pytest.approx(0.5)
    assert {(row["status"], row["reason"]) for row in rows} == {("tracked", "")}
    assert all(float(row["left_distance_px"]) >= 0 for row in rows)


def test_every_column_is_explained():
    for eyes in (1, 2):
        for name in track_columns(eyes):
            assert name in COLUMN_MEANINGS or name[0] in "xye"


def test_accuracy_by_fold_is_of_frames_left_out(lesson, recording):
    assert len(lesson.held_out) == len(lesson.labels.frames)
    assert {result.fold for result in lesson.held_out} == set(range(5))
    assert all(result.rms_px is not None and result.rms_px < 1.5 for result in lesson.held_out)


def test_residual_limits_follow_what_was_seen(lesson):
    limits = residual_limits(lesson.held_out, 2)
    seen = np.array([result.residuals for result in lesson.held_out])
    assert (limits > seen.max(0) * 0.99).all()
    assert np.isinf(residual_limits([], 2)).all()


def test_a_saved_model_tracks_the_same(lesson, recording, tmp_path):
    path = tmp_path / "model.npz"
    save_model(lesson.model, path)
    again = Tracker(load_model(path)).step(recording.pictures[0])
    assert np.array_equal(again.points, Tracker(lesson.model).step(recording.pictures[0]).points)


def test_after_a_cut_the_eyes_are_found_again(lesson, recording):
    tracker = Tracker(lesson.model)
    first = tracker.step(recording.pictures[10])
    matrix = np.array([[1.0, 0, 46], [0, 1.0, -38]])
    cut = cv2.warpAffine(recording.pictures[60], matrix, (512, 384), borderMode=cv2.BORDER_REPLICATE)
    frame = tracker.step(cut)
    assert first.status == "tracked"
    assert frame.status == "reinitialised"
    assert frame.reason.startswith("found again after")
    error = frame.points - (recording.points[60] + [46, -38])
    assert np.sqrt((error**2).sum(1).mean()) < 0.6


def test_a_covered_eye_is_lost_with_a_reason_and_found_when_uncovered(lesson, recording):
    tracker = Tracker(lesson.model)
    tracker.step(recording.pictures[0])
    for number in range(1, 6):
        hand = recording.pictures[number].copy()
        hand[120:290, 60:250] = 128
        frame = tracker.step(hand)
        assert frame.status == "lost"
        assert frame.points is None
        assert frame.distances is None
        assert "left eye" in frame.reason
    found = tracker.step(recording.pictures[6])
    assert found.status == "reinitialised"
    assert np.abs(found.points - recording.points[6]).max() < 1


def test_a_head_that_leaves_the_picture_is_lost_not_guessed(lesson, recording):
    tracker = Tracker(lesson.model)
    statuses = []
    for step in range(0, 420, 12):
        matrix = np.array([[1.0, 0, -step], [0, 1.0, 0]])
        moved = cv2.warpAffine(recording.pictures[5], matrix, (512, 384), borderValue=90)
        frame = tracker.step(moved)
        statuses.append((step, frame))
        if frame.points is not None:
            error = frame.points - (recording.points[5] - [step, 0])
            assert np.sqrt((error**2).sum(1).mean()) < 1
    assert statuses[0][1].status == "tracked"
    assert statuses[-1][1].status == "lost"
    assert statuses[-1][1].reason


def test_noise_without_eyes_is_never_tracked(lesson):
    tracker = Tracker(lesson.model)
    rng = np.random.default_rng(1)
    for _ in range(4):
        frame = tracker.step(rng.integers(0, 255, (384, 512), dtype=np.uint8))
        assert frame.status == "lost"
        assert frame.points is None


def test_memory_does_not_grow_with_length(lesson, recording):
    """The tracker keeps one fit, whatever it has seen; the decoder keeps a bounded queue."""
    tracker = Tracker(lesson.model)
    for picture in recording.pictures[:3]:
        tracker.step(picture)
    before = {name: type(value) for name, value in vars(tracker).items()}
    for picture in recording.pictures[3:60]:
        tracker.step(picture)
    assert {name: type(value) for name, value in vars(tracker).items()} == before


def test_label_noise_is_averaged_out_by_refining(recording):
    from stimuli_builder.tracking.accuracy import refined_labels
    from stimuli_builder.tracking.model import TrainingOptions

    labels = load_labels(recording.labels)
    rng = np.random.default_rng(2)
    noisy = {n: p + rng.normal(0, 1, p.shape) for n, p in labels.frames.items()}
    pictures = {n: recording.pictures[n] for n in noisy}
    better = refined_labels(pictures, noisy, labels.markers, TrainingOptions())

    def off(points):
        return np.sqrt(np.mean([((points[n] - labels.frames[n]) ** 2).sum(1).mean() for n in points]))

    assert off(better) < 0.65 * off(noisy)


def test_command_writes_track_preview_and_plot(recording, stimuli, tmp_path):
    out, preview, plot = tmp_path / "t.csv", tmp_path / "p.mp4", tmp_path / "f.png"
    model = tmp_path / "m.npz"
    code, said, error = stimuli(
        "train", recording.video, "--labels", recording.labels, "--out", model, "--no-refine", "--folds", 3
    )
    assert (code, error) == (0, "")
    assert "all      20" in said
    code, said, error = stimuli(
        "track", recording.video, "--model", model, "--out", out, "--preview", preview, "--plot", plot
    )
    assert (code, error) == (0, "")
    assert "200 tracked (0 of them doubtful), 0 re-initialized, 0 lost" in said
    assert "frames/s fit only" in said
    assert "with decoding" in said
    assert sum(1 for _ in frames(preview)) == 200
    assert scan_video(preview).size_px == (512, 480)
    drawn, film = (next(iter(frames(path, read=rgb)))[:60].astype(int) for path in (preview, recording.video))
    assert np.ptp(film.mean((0, 1))) > 20
    assert np.abs(drawn - film).mean() < 6
    assert plot.read_bytes()[:4] == b"\x89PNG"
    code, said, _ = stimuli("accuracy", out, recording.truth)
    assert code == 0
    assert "landmarks: RMS 0." in said
