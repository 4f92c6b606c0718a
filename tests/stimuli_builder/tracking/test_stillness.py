"""A picture that stands still under noise or a codec is told; a person who hardly moves is not."""

import csv

import av
import numpy as np
import pytest

from stimuli_builder.actor.recording import Actor, ActorOptions
from stimuli_builder.tracking.stillness import Stillness
from stimuli_builder.tracking.track import track_video
from stimuli_builder.tracking.tracker import STILL, Tracker
from stimuli_builder.video_scan import scan_video

FPS = 60
EYE = np.array([[0, 0], [20, -9], [40, -12], [60, -12], [80, -9], [100, 0], [75, 5], [50, 7], [25, 5.0]])


def noisy(picture, rng):
    return np.clip(picture + rng.normal(0, 3, picture.shape), 0, 255).astype(np.uint8)


def test_a_still_picture_under_noise_is_doubtful_after_two_seconds(lesson, recording):
    rng, tracker = np.random.default_rng(1), Tracker(lesson.model, FPS)
    frames = [tracker.step(noisy(recording.pictures[0], rng)) for _ in range(150)]
    assert {frame.status for frame in frames[:119]} == {"tracked"}
    assert {(frame.status, frame.reason) for frame in frames[119:]} == {("doubtful", STILL)}
    moved = [tracker.step(noisy(np.roll(recording.pictures[0], 4 + n, 1), rng)) for n in range(3)]
    assert [frame.status for frame in moved] == ["tracked"] * 3


def test_a_still_picture_that_was_compressed_is_doubtful(lesson, recording, tmp_path):
    rng, clip, out = np.random.default_rng(1), tmp_path / "still.mp4", tmp_path / "t.csv"
    with av.open(str(clip), "w") as container:
        stream = container.add_stream("libx264", rate=FPS, options={"crf": "30", "g": "30"})
        stream.height, stream.width = recording.pictures[0].shape
        stream.pix_fmt = "yuv420p"
        for _ in range(240):
            picture = av.VideoFrame.from_ndarray(noisy(recording.pictures[0], rng), format="gray")
            container.mux(stream.encode(picture))
        container.mux(stream.encode())
    track_video(lesson.model, scan_video(clip), out)
    with out.open() as stream:
        rows = list(csv.DictReader(stream))
    assert {row["status"] for row in rows[180:]} == {"doubtful"}
    assert STILL in {row["reason"] for row in rows[180:]}


def test_the_actor_who_holds_still_between_blinks_is_tracked(lesson):
    actor = Actor(ActorOptions(seconds=4.0, fps=FPS, seed=3))
    tracker = Tracker(lesson.model, FPS)
    frames = [tracker.step(actor.frame(n)[0]) for n in range(240)]
    assert STILL not in {frame.reason for frame in frames}


@pytest.mark.parametrize(("drift_share", "still"), [(0.0, True), (0.004, False)])
def test_a_slow_drift_under_noise_is_a_move(drift_share, still):
    rng, lids = np.random.default_rng(2), Stillness(FPS)
    told = [
        lids.after(EYE + rng.normal(0, 0.1, EYE.shape) + 100 * drift_share * np.sin(n / 30))
        for n in range(400)
    ]
    assert not any(told[:119])
    assert set(told[119:]) == {still}


@pytest.mark.parametrize(("first_scale", "still"), [(4.0, False), (0.25, True)])
def test_the_width_that_counts_is_that_of_the_eye_now(first_scale, still):
    """Eyes that were 4 times as wide move by 0.4% of their width now; some a quarter as wide, by 0.1%."""
    rng, lids = np.random.default_rng(2), Stillness(FPS)
    share = 0.001 if still else 0.004
    for scale in np.linspace(first_scale, 1, 60):
        lids.after(scale * EYE)
    told = [lids.after(EYE + rng.normal(0, 100 * share, EYE.shape)) for _ in range(200)]
    assert set(told[119:]) == {still}


@pytest.mark.parametrize("fps", [1.0, 2.5, 5.0])
def test_lids_that_are_alike_in_a_few_frames_are_not_called_still(fps):
    """A calm person at a low rate: the eye is narrowed in each fifth frame, and the same in the others."""
    lids, narrowed = Stillness(fps), EYE * [1, 0.8]
    assert not any(lids.after(narrowed if n % 5 == 4 else EYE) for n in range(60))
    told = [lids.after(EYE) for _ in range(20)]
    assert not any(told[:5])
    assert all(told[10:])


def test_two_seconds_begin_anew_after_a_frame_without_eyes():
    lids, eye = Stillness(FPS), np.arange(18.0).reshape(9, 2)
    assert [lids.after(eye) for _ in range(130)][119:] == [True] * 11
    lids.forget()
    assert not any(lids.after(eye) for _ in range(119))
    assert lids.after(eye)
