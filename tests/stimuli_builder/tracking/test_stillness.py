"""A picture that is still under noise or a codec is detected; a person who hardly moves is not."""

import csv

import av
import numpy as np
import pytest

from stimuli_builder.actor.recording import Actor, ActorOptions
from stimuli_builder.tracking.stillness import Stillness
from stimuli_builder.tracking.table import TrackedFrame
from stimuli_builder.tracking.track import STOOD, Hindsight, evenly_repeated, pictures_alike, track_video
from stimuli_builder.tracking.tracker import FROZEN, STILL, Tracker
from stimuli_builder.video import scan_video

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
    # A codec that keeps the picture shows that it stands still before two seconds of still lids do.
    assert {row["reason"] for row in rows[180:]} <= {STILL, STOOD}


def tracked(lesson, folder, pictures, fps, **options):
    """Rows and the summary of a track of these grey pictures, compressed."""
    clip, out = folder / "clip.mp4", folder / "t.csv"
    with av.open(str(clip), "w") as container:
        stream = container.add_stream("libx264", rate=fps, options=options)
        stream.height, stream.width = pictures[0].shape
        stream.pix_fmt = "yuv420p"
        for picture in pictures:
            container.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="gray")))
        container.mux(stream.encode())
    summary = track_video(lesson.model, scan_video(clip), out)
    with out.open() as stream:
        return list(csv.DictReader(stream)), summary


@pytest.mark.parametrize("options", [{"qp": "0"}, {"crf": "16", "preset": "ultrafast"}, {"crf": "28"}])
def test_a_frozen_end_is_doubtful_from_its_first_frame_to_its_last(lesson, recording, tmp_path, options):
    pictures = recording.pictures[:60:2] + [recording.pictures[60]] * 40
    rows, summary = tracked(lesson, tmp_path, pictures, 30, **options)
    assert {(row["status"], row["reason"]) for row in rows[:27]} == {("tracked", "")}
    assert {(row["status"], row["reason"]) for row in rows[30:]} == {("doubtful", STOOD)}
    assert 40 <= summary.doubtful <= 43
    assert [int(row["frame"]) for row in rows] == list(range(70))


@pytest.mark.parametrize("fps", [60, 240])
def test_a_person_who_holds_still_for_a_second_is_not_called_a_still_picture(lesson, tmp_path, fps):
    actor = Actor(ActorOptions(seconds=1.0, fps=fps, seed=3))
    rows, _ = tracked(lesson, tmp_path, [actor.frame(n)[0] for n in range(fps)], fps, crf="28")
    assert STOOD not in {row["reason"] for row in rows}


@pytest.mark.parametrize(("every", "times"), [(1, 2), (1, 3), (4, 2)])
def test_frames_that_a_change_of_rate_repeats_are_reported_once_and_keep_their_status(
    lesson, recording, tmp_path, every, times
):
    """30 to 60 frames/s, 20 to 60, and 4 frames made 5."""
    pictures = [
        p for n, p in enumerate(recording.pictures[:180:3]) for _ in range(times if n % every == 0 else 1)
    ]
    rows, summary = tracked(lesson, tmp_path, pictures, 60, qp="0")
    assert {(row["status"], row["reason"]) for row in rows} == {("tracked", "")}
    assert summary.repeated == len(pictures) - 60


def test_a_repeat_of_a_doubtful_frame_is_doubtful_for_the_same_reason():
    hindsight, out = Hindsight(60, 1), []
    rng = np.random.default_rng(1)
    for number in range(240):
        picture = rng.integers(0, 255, (40, 120)).astype(np.uint8)
        seen = ("doubtful", "jump") if number // 2 % 5 == 0 else ("tracked", "")
        given = ("doubtful", FROZEN) if number % 2 else seen
        out += hindsight.push(picture, TrackedFrame(*given, EYE, np.ones(1), 1.0, 3))
    out += hindsight.flush()
    said = [(frame.status, frame.reason) for frame in out]
    assert said[1::2] == said[::2]
    assert said.count(("doubtful", "jump")) == 48
    assert hindsight.repeated == 120


def test_frames_repeated_here_and_there_are_doubtful_each(lesson, recording, tmp_path):
    again = {5, 6, 31, 50}
    pictures = [p for n, p in enumerate(recording.pictures[:60]) for _ in range(2 if n in again else 1)]
    rows, summary = tracked(lesson, tmp_path, pictures, 60, qp="0")
    assert [n for n, row in enumerate(rows) if row["reason"] == FROZEN] == [6, 8, 34, 54]
    assert summary.repeated == 0


@pytest.mark.parametrize(
    ("repeats", "even"),
    [
        (range(1, 40, 2), True),
        ([n for n in range(60) if n % 10], True),
        (range(25, 101, 25), True),
        (range(5), False),
        ([3, 4, 20, 21, 55], False),
        ([4, 8], False),
    ],
)
def test_even_repeats(repeats, even):
    assert evenly_repeated(list(repeats), 9 if len(repeats) > 50 else 3) == even


def test_pictures_are_alike_where_few_pixels_differ_by_much():
    one = np.full((20, 50), 100, np.uint8)
    other = one + np.uint8(3)
    assert pictures_alike(one, other, 3, 0.003)
    other[3, :4] = 104
    assert not pictures_alike(one, other, 3, 0.003)
    assert pictures_alike(one, other, 3, 0.004)


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


def test_two_seconds_start_over_after_a_frame_without_eyes():
    lids, eye = Stillness(FPS), np.arange(18.0).reshape(9, 2)
    assert [lids.after(eye) for _ in range(130)][119:] == [True] * 11
    lids.forget()
    assert not any(lids.after(eye) for _ in range(119))
    assert lids.after(eye)
