"""Recordings that go wrong on the way: each ends in one line, or in frames that say why they are lost."""

import csv
import re
from fractions import Fraction
from itertools import islice

import av
import cv2
import numpy as np
import pytest

from experiments.errors import InputError
from stimuli_builder.tracking.detector.mesh import cache_folder
from stimuli_builder.tracking.model import save_model
from stimuli_builder.tracking.survey import survey
from stimuli_builder.tracking.track import track_video
from stimuli_builder.video import declared_frames, frames, scan_before_damage, scan_video
from tests.stimuli_builder.tracking.test_bad_input import write_frames
from tests.stimuli_builder.tracking.test_files_as_they_come import written

SIZE = (640, 360)


@pytest.fixture
def tracked(lesson, recording, tmp_path):
    """Write pictures as a video and track it with the actor's model: rows of the track, and the summary."""

    def run(pictures, fps=200):
        video, out = tmp_path / "spoilt.mp4", tmp_path / "spoilt.csv"
        written(video, pictures, fps=fps)
        summary = track_video(lesson.model, scan_video(video), out)
        with out.open() as stream:
            return list(csv.DictReader(stream)), summary

    return run


def off_px(row, truth):
    """Root mean square distance of one row's points from the truth in px."""
    points = np.array([[float(row[f"{axis}{n:02d}"]) for axis in "xy"] for n in range(1, 19)])
    return float(np.sqrt(((points - truth) ** 2).sum(1).mean()))


def assert_gap(rows, first, end):
    """Frames first to end are lost with a reason and without a number; those around them are not."""
    for number, row in enumerate(rows):
        lost = first <= number < end
        assert (row["status"] == "lost") == lost, (number, row["status"], row["reason"])
        assert bool(row["x01"]) == bool(row["left_distance_px"]) == (not lost)
        assert row["reason"] or not lost
    assert rows[end]["status"] == "reinitialised"
    assert rows[end]["reason"].startswith("found again after")


def test_blank_frames_are_a_gap_with_its_reason(tracked, recording):
    pictures = [picture.copy() for picture in recording.pictures[:40]]
    for number in range(15, 22):
        pictures[number][:] = 16 if number % 2 else 235
    rows, summary = tracked(pictures)
    assert_gap(rows, 15, 22)
    assert {row["reason"] for row in rows[15:22]} == {"a black or empty frame"}
    assert summary.lost == 7
    assert max(off_px(rows[n], recording.points[n]) for n in (0, 14, 22, 39)) < 1


def test_a_face_that_leaves_and_returns_is_a_gap(tracked, recording):
    rng = np.random.default_rng(2)
    pictures = list(recording.pictures[:60])
    for number in range(20, 40):
        pictures[number] = np.clip(rng.normal(130, 6, (384, 512)), 0, 255).astype(np.uint8)
    rows, summary = tracked(pictures)
    assert_gap(rows, 20, 40)
    assert summary.reinitialised == 1
    assert max(off_px(row, recording.points[n]) for n, row in enumerate(rows) if row["x01"]) < 1


def test_glare_over_an_eye_is_never_called_tracked(tracked, recording):
    pictures = [picture.copy() for picture in recording.pictures[:40]]
    for number in range(12, 24):
        centre = recording.points[number, :9].mean(0).round().astype(int)
        cv2.ellipse(pictures[number], centre.tolist(), (34, 20), 15, 0, 360, 250, -1)
    rows, _ = tracked(pictures)
    assert all(row["status"] in {"lost", "doubtful"} and row["reason"] for row in rows[12:24])
    for number in (0, 11, 39):
        assert off_px(rows[number], recording.points[number]) < 1


def test_five_frames_a_second_are_tracked_without_a_wrong_number(tracked, recording):
    every = range(0, 200, 40)
    rows, summary = tracked([recording.pictures[n] for n in every], fps=5)
    assert [float(row["time_s"]) for row in rows] == pytest.approx([0, 0.2, 0.4, 0.6, 0.8])
    assert summary.frames == 5
    for number, row in zip(every, rows, strict=True):
        if row["status"] in {"tracked", "reinitialised"}:
            assert off_px(row, recording.points[number]) < 1
        else:
            assert row["reason"]
    assert sum(row["status"] in {"tracked", "reinitialised"} for row in rows) >= 3


@pytest.fixture(scope="module", params=["mp4", "mkv"])
def cut(request, recording, tmp_path_factory):
    """A recording of 120 frames of which the last 40% of bytes are missing."""
    folder = tmp_path_factory.mktemp("cut")
    whole, path = folder / f"whole.{request.param}", folder / f"cut.{request.param}"
    options = {"movflags": "faststart"} if request.param == "mp4" else {}
    written(whole, recording.pictures[:120], fps=100, options=options)
    path.write_bytes(whole.read_bytes()[: whole.stat().st_size * 6 // 10])
    return path


def test_a_damaged_end_is_refused_and_says_how_to_take_it(cut, lesson, stimuli, tmp_path):
    model, out = tmp_path / "m.npz", tmp_path / "t.csv"
    save_model(lesson.model, model)
    code, _, error = stimuli("track", cut, "--model", model, "--out", out)
    assert (code, error.count("\n")) == (2, 1)
    assert "truncated" in error
    assert "--accept-damaged-end" in error
    assert not out.exists()


def test_a_damaged_end_is_left_out_where_that_is_accepted(cut, lesson, recording, stimuli, tmp_path):
    model, out, preview = tmp_path / "m.npz", tmp_path / "t.csv", tmp_path / "p.mp4"
    save_model(lesson.model, model)
    given = ("track", cut, "--model", model, "--out", out, "--preview", preview)
    code, said, error = stimuli(*given, "--accept-damaged-end")
    assert (code, error) == (0, "")
    with out.open() as stream:
        rows = list(csv.DictReader(stream))
    assert 40 < len(rows) < 119
    assert f"{len(rows)} frames" in said
    assert "of about 120 declared; the rest could not be read" in said
    assert max(off_px(row, recording.points[n]) for n, row in enumerate(rows)) < 1
    assert scan_video(preview).frame_count == len(rows)


def test_a_whole_file_is_the_same_whether_a_damaged_end_is_accepted(recording):
    whole, taken = scan_video(recording.video), scan_before_damage(recording.video)
    assert (taken.size_px, taken.fps, taken.variable) == (whole.size_px, whole.fps, whole.variable)
    assert taken.times_s == pytest.approx(whole.times_s)
    assert (taken.stamps == whole.stamps).all()


def recorded(path, pictures, left_out=(), sound_s=0.0):
    """A video of 100 frames/s, without some of its frames, with a silent sound stream of another length."""
    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=100)
        stream.height, stream.width = pictures[0].shape
        stream.pix_fmt = "yuv420p"
        sound = container.add_stream("pcm_s16le", rate=8000, layout="mono") if sound_s else None
        for number, picture in enumerate(pictures):
            if number not in left_out:
                chroma = np.full((picture.shape[0] // 2, picture.shape[1]), 128, np.uint8)
                frame = av.VideoFrame.from_ndarray(np.concatenate([picture, chroma]), format="yuv420p")
                frame.pts, frame.time_base = number, Fraction(1, 100)
                container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
        for start in range(0, round(sound_s * 8000), 800) if sound else ():
            samples = av.AudioFrame.from_ndarray(np.zeros((1, 800), np.int16), format="s16", layout="mono")
            samples.sample_rate, samples.pts, samples.time_base = 8000, start, Fraction(1, 8000)
            container.mux(sound.encode(samples))
        if sound:
            container.mux(sound.encode(None))
    return path


@pytest.mark.parametrize("suffix", ["mp4", "mkv"])
def test_a_dropped_frame_near_the_end_is_not_damage(recording, tmp_path, suffix):
    path = recorded(tmp_path / f"gap.{suffix}", recording.pictures[:101], left_out={95})
    taken = scan_before_damage(path)
    assert (taken.frame_count, taken.damaged) == (100, False)


@pytest.mark.parametrize("sound_s", [0.8, 1.2])
def test_sound_of_another_length_is_not_damage(recording, lesson, stimuli, tmp_path, sound_s):
    path = recorded(tmp_path / "sound.mkv", recording.pictures[:100], sound_s=sound_s)
    model, out = tmp_path / "m.npz", tmp_path / "t.csv"
    save_model(lesson.model, model)
    code, said, error = stimuli("track", path, "--model", model, "--out", out, "--accept-damaged-end")
    assert (code, error) == (0, "")
    assert "100 frames (0.99 s) read" in said
    assert "declared" not in said


def test_only_the_video_s_own_length_shows_how_many_frames_are_missing(recording, tmp_path):
    whole = recorded(tmp_path / "whole.mkv", recording.pictures[:100], sound_s=1.4)
    path = tmp_path / "cut.mkv"
    path.write_bytes(whole.read_bytes()[: whole.stat().st_size // 2])
    taken = scan_before_damage(path)
    assert taken.damaged
    assert taken.frame_count < 100
    assert declared_frames(taken) == 100


def flipped(whole, path, share):
    """Write a copy of an MP4 with three bytes flipped, that share into its pictures."""
    content = bytearray(whole.read_bytes())
    start = content.index(b"mdat") + 4
    at = start + int((len(content) - start) * share)
    content[at : at + 3] = bytes(255 - value for value in content[at : at + 3])
    path.write_bytes(bytes(content))
    return path


@pytest.fixture(scope="module")
def whole(recording, tmp_path_factory):
    return written(
        tmp_path_factory.mktemp("whole") / "w.mp4",
        recording.pictures,
        fps=100,
        options={"movflags": "faststart"},
    )


@pytest.mark.parametrize("share", [0.3, 0.5, 0.7])
def test_no_frame_that_the_decoder_patched_is_taken(whole, recording, tmp_path, share):
    path = flipped(whole, tmp_path / "flipped.mp4", share)
    taken = scan_before_damage(path).frame_count
    assert 0 < taken < len(recording.pictures)
    for spoilt, exact in islice(zip(frames(path), frames(whole), strict=False), taken):
        assert (spoilt == exact).all()


def test_bytes_spoilt_in_the_middle_are_refused_and_the_refusal_says_where(whole, lesson, stimuli, tmp_path):
    path = flipped(whole, tmp_path / "flipped.mp4", 0.5)
    model, out = tmp_path / "m.npz", tmp_path / "t.csv"
    save_model(lesson.model, model)
    given = ("track", path, "--model", model, "--out", out)
    code, _, error = stimuli(*given)
    assert (code, error.count("\n")) == (2, 1)
    assert re.search(r"damaged, frame \d+ holds bytes that cannot be decoded; copy the file again", error)
    assert "--accept-damaged-end" in error
    assert not out.exists()
    code, said, error = stimuli(*given, "--accept-damaged-end")
    assert (code, error) == (0, "")
    assert "before the damage; the rest could not be read" in said or "declared; the rest" in said


@pytest.mark.parametrize("groups", ["open-gop=1:keyint=20:bframes=3", "intra-refresh=1:keyint=20"])
def test_frames_that_lean_on_others_across_groups_are_not_damage(recording, tmp_path, groups):
    path = tmp_path / "groups.mp4"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=100, options={"x264-params": groups})
        stream.height, stream.width = recording.pictures[0].shape
        stream.pix_fmt = "yuv420p"
        for picture in recording.pictures[:60]:
            container.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="gray")))
        container.mux(stream.encode(None))
    assert sum(1 for _ in frames(path)) == 60


def test_a_file_without_a_readable_frame_is_refused_even_so(recording, tmp_path):
    head = tmp_path / "head.mp4"
    write_frames(head, recording.pictures[:20], options={"movflags": "faststart"})
    content = bytearray(head.read_bytes())
    start = content.index(b"mdat") + 4
    head.write_bytes(bytes(content[:start]))
    with pytest.raises(InputError, match=r"holds no video frame; .* copy the file again") as refused:
        scan_before_damage(head)
    assert "\n" not in str(refused.value)


@pytest.fixture
def face(shared_data, monkeypatch):
    """Frames of a real face; few are looked at, so that the detector is quick."""
    if not (cache_folder() / "face-mesh-0.10.21" / "ready").exists():
        pytest.skip(
            "the face detector's environment is not made; 'stimuli track VIDEO' without labels makes it"
        )
    monkeypatch.setattr("stimuli_builder.tracking.survey.LOOKED_AT", 12)
    return list(frames(shared_data / "face_video" / "single_face.mp4"))


def test_of_two_faces_the_larger_is_taken_and_counted(face, tmp_path):
    video = tmp_path / "two.mp4"
    wide = [np.full((360, 640), 128, np.uint8) for _ in face]
    for picture, one in zip(wide, face, strict=True):
        picture[:, :360] = one[:, 110:470]
        picture[40:320, 360:] = cv2.resize(one[:, 110:470], (280, 280), interpolation=cv2.INTER_AREA)
    write_frames(video, wide, fps=30)
    alone = tmp_path / "one.mp4"
    write_frames(alone, face, fps=30)
    seen, one = survey(scan_video(video), one_eye=False), survey(scan_video(alone), one_eye=False)
    assert seen.several_faces > 0
    for number, points in seen.points.items():
        assert points + np.array([110, 0]) == pytest.approx(one.points[number], abs=3)


def test_of_two_faces_that_change_size_one_is_tracked_throughout(face, tmp_path):
    video = tmp_path / "crossing.mp4"
    wide = [np.full((360, 640), 128, np.uint8) for _ in face]
    for number, (picture, one) in enumerate(zip(wide, face, strict=True)):
        for start, share in ((0, 1 - number / 71), (320, number / 71)):
            side = 2 * round(120 + 40 * share)
            shown = cv2.resize(one[:, 140:460], (side, side), interpolation=cv2.INTER_AREA)
            picture[20 : 20 + side, start : start + side] = shown
    write_frames(video, wide, fps=30)
    seen = survey(scan_video(video), one_eye=False)
    assert seen.several_faces > 6
    assert len({points.mean(0)[0] > 320 for points in seen.points.values()}) == 1


@pytest.mark.parametrize("quarters", [1, 3])
def test_a_face_on_its_side_is_refused_in_one_line(face, tmp_path, quarters):
    video = tmp_path / "turned.mp4"
    write_frames(video, [np.ascontiguousarray(np.rot90(picture, -quarters)) for picture in face], fps=30)
    with pytest.raises(InputError) as refused:
        survey(scan_video(video), one_eye=False)
    line = str(refused.value)
    assert f"the face is turned by {90 * quarters} degrees clockwise" in line or "a face was found in" in line
    assert "\n" not in line


def test_a_covered_eye_is_doubtful_and_the_reason_is_printed(face, tmp_path, stimuli):
    covered = slice(30, 45)
    pictures = [picture.copy() for picture in face]
    for picture in pictures[covered]:
        picture[135:195, 222:290] = 105
    video, out = tmp_path / "spoilt.mp4", tmp_path / "t.csv"
    write_frames(video, pictures, fps=30)
    code, said, error = stimuli("track", video, "--out", out, "--no-refine")
    assert (code, error) == (0, "")
    with out.open() as stream:
        rows = list(csv.DictReader(stream))
    assert {row["status"] for row in rows[covered]} <= {"doubtful", "lost"}
    assert all(row["reason"].startswith("left eye covered") for row in rows[covered])
    for number in (*range(23), *range(48, len(rows))):  # without the blink, 23 to 29
        assert rows[number]["status"] in {"tracked", "reinitialised"}, (number, rows[number]["reason"])
    assert re.search(r"\d frames? (doubtful|lost), the first is \d+: left eye covered", said)


def test_a_recording_that_shows_a_face_on_few_frames_is_refused_with_their_number(face, tmp_path):
    video = tmp_path / "few.mp4"
    rng = np.random.default_rng(3)
    walls = [np.clip(rng.normal(120, 8, (360, 640)), 0, 255).astype(np.uint8) for _ in range(60)]
    write_frames(video, face[:12] + walls, fps=30)
    with pytest.raises(InputError, match="a face was found in 2 of 12 frames") as refused:
        survey(scan_video(video), one_eye=False)
    assert "\n" not in str(refused.value)
