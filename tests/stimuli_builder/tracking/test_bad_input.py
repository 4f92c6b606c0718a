"""What `stimuli track` refuses: one line, exit code 2, nothing under the final name."""

import json
from fractions import Fraction

import av
import cv2
import numpy as np
import pytest

from stimuli_builder.tracking.labels import load_labels
from stimuli_builder.tracking.model import save_model
from stimuli_builder.video import VideoWriter, open_video, scan_video


def write_frames(path, pictures, stamps=None, fps=100, options=None):
    """Write grey pictures with time stamps in milliseconds."""
    with av.open(str(path), "w", options=options or {}) as container:
        stream = container.add_stream("libx264", rate=fps)
        stream.height, stream.width = pictures[0].shape
        stream.pix_fmt = "yuv420p"
        stream.options = {"crf": "20", "preset": "ultrafast", "bf": "0", "x264-params": "log-level=error"}
        if stamps is not None:
            stream.codec_context.time_base = Fraction(1, 1000)
        for number, picture in enumerate(pictures):
            frame = av.VideoFrame.from_ndarray(picture, format="gray").reformat(format="yuv420p")
            if stamps is not None:
                frame.pts, frame.time_base = int(stamps[number]), Fraction(1, 1000)
            for packet in stream.encode(frame):
                container.mux(packet)
        for packet in stream.encode(None):
            container.mux(packet)


@pytest.fixture
def refused(stimuli, tmp_path, recording):
    """Run track and expect one error line, exit code 2 and no output, not even a temporary one."""

    def run(video=None, labels=None, *more):
        out = tmp_path / "out" / "track.csv"
        out.parent.mkdir(exist_ok=True)
        chosen = ("--labels", labels or recording.labels) if "--model" not in more else ()
        code, _, error = stimuli("track", video or recording.video, *chosen, "--out", out, *more)
        assert code == 2
        assert error.startswith("error: ")
        assert error.count("\n") == 1
        assert list(out.parent.iterdir()) == []
        return error

    return run


def test_labels_for_another_video_size(refused, document, tmp_path):
    document["image_size_px"] = [640, 480]
    path = tmp_path / "labels.json"
    path.write_text(json.dumps(document))
    assert "made on 640 x 480 pixels, but the video has 512 x 384" in refused(labels=path)


def test_two_eye_labels_with_one_eye_and_the_reverse(refused, document, tmp_path):
    assert "remove --one-eye" in refused(None, None, "--one-eye")
    document["frames"] = {key: points[:9] for key, points in document["frames"].items()}
    del document["mid_upper"], document["mid_lower"]
    path = tmp_path / "labels.json"
    path.write_text(json.dumps(document))
    assert "add --one-eye" in refused(labels=path)


def test_missing_unreadable_and_soundless_videos(refused, tmp_path):
    assert "there is no such video file" in refused(tmp_path / "none.mp4")
    text = tmp_path / "text.mp4"
    text.write_text("this is not a video")
    assert "not a video that can be read" in refused(text)
    empty = tmp_path / "empty.mp4"
    empty.write_bytes(b"")
    assert "not a video that can be read" in refused(empty)
    assert "; the file is empty" in refused(empty)
    picture = tmp_path / "picture.png"
    cv2.imwrite(str(picture), np.zeros((24, 32, 3), np.uint8))
    assert "picture.png: expected a video, but this is a single picture" in refused(picture)


def test_pictures_that_follow_one_another_in_a_file_are_a_video(tmp_path):
    stream = tmp_path / "camera.mjpeg"
    jpeg = cv2.imencode(".jpg", np.zeros((24, 32, 3), np.uint8))[1].tobytes()
    stream.write_bytes(jpeg * 20)
    with open_video(stream) as (container, _):
        assert sum(1 for _ in container.decode(video=0)) == 20


def test_a_file_cut_off_before_its_index(refused, recording, tmp_path):
    cut = tmp_path / "cut.mp4"
    cut.write_bytes(recording.video.read_bytes()[:20_000])
    assert "not a video that can be read" in refused(cut)


def test_a_file_cut_off_after_its_index(refused, recording, tmp_path):
    whole = tmp_path / "whole.mp4"
    write_frames(whole, recording.pictures[:80], options={"movflags": "faststart"})
    cut = tmp_path / "cut.mp4"
    cut.write_bytes(whole.read_bytes()[: whole.stat().st_size * 6 // 10])
    assert "truncated" in refused(cut)


def test_a_file_that_counts_no_frames_cut_off(refused, recording, tmp_path):
    whole, cut = tmp_path / "whole.mkv", tmp_path / "cut.mkv"
    write_frames(whole, recording.pictures[:120])
    assert scan_video(whole).frame_count == 120
    cut.write_bytes(whole.read_bytes()[: whole.stat().st_size * 6 // 10])
    assert "truncated, it declares 1.2 s and ends after" in refused(cut)


def test_a_video_without_a_face(refused, recording, tmp_path, stimuli):
    model = tmp_path / "model.npz"
    assert (
        stimuli("train", recording.video, "--labels", recording.labels, "--out", model, "--no-refine")[0] == 0
    )
    rng = np.random.default_rng(5)
    wall = [np.clip(rng.normal(130, 12, (384, 512)), 0, 255).astype(np.uint8) for _ in range(12)]
    path = tmp_path / "wall.mp4"
    write_frames(path, wall)
    error = refused(path, None, "--model", model)
    assert "no eyes like the labeled ones were found in its 12 frames" in error


def test_variable_frame_rate_is_refused_or_accepted_by_name(refused, recording, tmp_path, stimuli):
    stamps = np.cumsum([0] + [5, 5, 20] * 67)[:200]
    path = tmp_path / "variable.mp4"
    write_frames(path, recording.pictures[:200], stamps)
    assert "variable frame rate, steps of 5.0 to 20.0 ms" in refused(path)
    out = tmp_path / "track.csv"
    labels = load_labels(recording.labels)
    assert max(labels.frames) < 200
    code, _, error = stimuli(
        "track", path, "--labels", recording.labels, "--out", out, "--accept-variable-rate", "--no-refine"
    )
    assert (code, error) == (0, "")
    assert [line.split(",")[1] for line in out.read_text().splitlines()[1:5]] == [
        "0.000000",
        "0.005000",
        "0.010000",
        "0.030000",
    ]


def test_a_model_for_another_size_or_no_model(refused, recording, tmp_path, lesson):
    from stimuli_builder.tracking.model import save_model

    model, small = tmp_path / "model.npz", tmp_path / "small.mp4"
    save_model(lesson.model, model)
    with VideoWriter(small, 100, (256, 192)) as writer:
        for picture in recording.pictures[:5]:
            writer.write(np.ascontiguousarray(picture[::2, ::2]))
    assert "256 x 192 pixels, but the model was trained on 512 x 384" in refused(
        small, None, "--model", model
    )
    assert "not a model from 'stimuli train'" in refused(None, None, "--model", recording.truth)
    assert "there is no such model file" in refused(None, None, "--model", tmp_path / "none.npz")


def test_labels_and_model_are_not_given_together(stimuli, recording, tmp_path):
    both = ("--labels", recording.labels, "--model", tmp_path / "m.npz")
    code, _, error = stimuli("track", recording.video, "--out", tmp_path / "track.csv", *both)
    assert code == 2
    assert "not both" in error


def test_relabelling_belongs_to_tracking_without_labels(stimuli, recording, tmp_path):
    given = ("--labels", recording.labels, "--relabel", tmp_path / "worst.json")
    code, _, error = stimuli("track", recording.video, "--out", tmp_path / "track.csv", *given)
    assert code == 2
    assert "--relabel is for" in error


@pytest.mark.parametrize(
    ("name", "option", "message"),
    [
        ("preview.txt", "--preview", "use a name in .mp4"),
        ("plot.gif", "--plot", "'gif' is not a figure format"),
        ("track.csv", "--preview", "a unique name"),
    ],
)
def test_a_second_output_that_cannot_be_written_is_refused_first(refused, tmp_path, name, option, message):
    assert message in refused(None, None, option, tmp_path / "out" / name)


def test_no_output_takes_the_place_of_an_input(stimuli, recording, tmp_path):
    video, labels = tmp_path / "a.mp4", tmp_path / "l.json"
    video.write_bytes(recording.video.read_bytes())
    labels.write_bytes(recording.labels.read_bytes())
    (tmp_path / "x").mkdir()
    calls = [
        ("track", video, "--labels", labels, "--out", video),
        ("track", video, "--labels", labels, "--out", labels),
        ("train", video, "--labels", labels, "--out", tmp_path / "x" / ".." / "l.json"),
        ("label", video, "--out", video),
        ("actor", "--seconds", 0.1, "--out", video, "--truth", video),
    ]
    for call in calls:
        code, _, error = stimuli(*call)
        assert (code, error.count("\n")) == (2, 1)
        assert "a unique name" in error
    assert video.read_bytes() == recording.video.read_bytes()
    assert labels.read_bytes() == recording.labels.read_bytes()


def test_outputs_that_cannot_be_written_are_refused_first(stimuli, recording, tmp_path):
    code, _, error = stimuli(
        "track", recording.video, "--labels", recording.labels, "--out", recording.labels / "track.csv"
    )
    assert code == 2
    assert "expected a folder" in error


@pytest.fixture
def folder(recording, lesson, tmp_path):
    """A folder of two videos of which one is none, and a model for the other."""
    path = tmp_path / "recordings"
    path.mkdir()
    (path / "a.mp4").write_bytes(recording.video.read_bytes())
    (path / "b.mov").write_bytes(b"no video")
    (path / "notes.txt").write_text("left alone")
    save_model(lesson.model, tmp_path / "m.npz")
    return path


def test_a_folder_is_tracked_and_goes_on_where_it_stopped(stimuli, folder, tmp_path):
    given = ("track", folder, "--model", tmp_path / "m.npz", "--out", tmp_path / "tracks")
    code, said, error = stimuli(*given)
    assert code == 2
    assert [path.name for path in (tmp_path / "tracks").iterdir()] == ["a.csv"]
    assert "b.mov: not a video that can be read" in error
    assert error.strip().splitlines()[-1].startswith("error: 1 of 2 videos could not be tracked")
    before = (tmp_path / "tracks" / "a.csv").stat().st_mtime_ns
    (folder / "b.mov").unlink()
    code, said, error = stimuli(*given)
    assert (code, error) == (0, "")
    assert "already exists" in said
    assert (tmp_path / "tracks" / "a.csv").stat().st_mtime_ns == before


def test_videos_of_one_name_in_a_folder_have_a_track_each(stimuli, folder, tmp_path):
    """a.mkv was taken for the a.mp4 that was tracked already, and left out."""
    (folder / "b.mov").unlink()
    (folder / "a.mkv").write_bytes((folder / "a.mp4").read_bytes())
    code, _, error = stimuli("track", folder, "--model", tmp_path / "m.npz", "--out", tmp_path / "tracks")
    assert (code, error) == (0, "")
    assert sorted(path.name for path in (tmp_path / "tracks").iterdir()) == ["a.mkv.csv", "a.mp4.csv"]


def test_a_folder_takes_no_options_of_one_video(stimuli, folder, recording, tmp_path):
    one = ("--labels", recording.labels)
    assert "need a single video" in stimuli("track", folder, "--out", tmp_path / "tracks", *one)[2]
    (tmp_path / "none").mkdir()
    assert "no video in this folder" in stimuli("track", tmp_path / "none", "--out", tmp_path / "t")[2]
    assert not (tmp_path / "tracks").exists()
    below_a_file = recording.labels / "tracks"
    assert "expected a folder" in stimuli("track", folder, "--out", below_a_file)[2]


def test_accuracy_of_files_that_do_not_belong_together(stimuli, recording, tmp_path):
    other = tmp_path / "other.csv"
    other.write_text("\n".join(recording.truth.read_text().splitlines()[:50]) + "\n")
    code, _, error = stimuli("accuracy", other, recording.truth)
    assert code == 2
    assert "compare a track with its own ground truth" in error
    assert "expected a list of objects" in stimuli("accuracy", recording.labels, recording.truth)[2]


@pytest.mark.parametrize(
    ("command", "option", "name", "line"),
    [
        ("track", "--out", "t.mp4", "a track: expected a name that ends in .csv, got 't.mp4'"),
        ("track", "--out", "t", "a track: expected a name that ends in .csv, got 't'"),
        (
            "track",
            "--relabel",
            "worst.csv",
            "the label file of --relabel: expected a name that ends in .json, got 'worst.csv'",
        ),
        ("train", "--out", "model.json", "a model: expected a name that ends in .npz, got 'model.json'"),
        (
            "label",
            "--out",
            "labels.csv",
            "a label file: expected a name that ends in .json, got 'labels.csv'",
        ),
        (
            "iris",
            "--out",
            "iris.json",
            "the table of irises: expected a name that ends in .csv, got 'iris.json'",
        ),
    ],
)
def test_a_name_of_another_kind_of_file_is_refused_before_work(
    stimuli, recording, tmp_path, command, option, name, line
):
    given = {"iris": (recording.truth,), "train": ("--labels", recording.labels)}.get(command, ())
    more = ("--out", tmp_path / "t.csv") if option == "--relabel" else ()
    code, _, error = stimuli(command, recording.video, *given, *more, option, tmp_path / name)
    assert code == 2
    assert line in error
    assert error.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_a_track_too_short_for_a_plot_is_written_and_the_plot_is_reported(stimuli, recording, tmp_path):
    write_frames(tmp_path / "short.mp4", recording.pictures[:30], fps=200)
    model, out, plot = tmp_path / "m.npz", tmp_path / "t.csv", tmp_path / "p.png"
    fast = ("--no-refine", "--folds", 2, "--base-pixels", 1000)
    stimuli("train", recording.video, "--labels", recording.labels, "--out", model, *fast)
    code, said, error = stimuli(
        "track", tmp_path / "short.mp4", "--model", model, "--out", out, "--plot", plot
    )
    assert code == 0
    assert "30 frames" in said
    assert error.startswith(
        f"warning: {plot}: the track was written, but not the plot (t.csv: 30 frames at 200 fps are"
    )
    assert error.count("\n") == 1
    assert out.exists()
    assert not plot.exists()
