"""Video in and out: sizes, rates, pixel formats, rotation, seeking, and files that break off."""

from fractions import Fraction

import av
import numpy as np
import pytest

from experiments.errors import InputError
from stimuli_builder.video import VideoWriter, clock_of, frames, read_frames, rgb, scan_video


def ramp(number, width=64, height=48):
    """A picture that shows its frame number and which way is up."""
    picture = np.full((height, width), 20 + 4 * number % 200, np.uint8)
    picture[: height // 4, : width // 4] = 230
    return picture


def write(path, codec="libx264", pix_fmt="yuv420p", count=20, fps=30, size=(64, 48)):
    with av.open(str(path), "w") as container:
        stream = container.add_stream(codec, rate=Fraction(fps).limit_denominator(1001))
        stream.width, stream.height = size
        stream.pix_fmt = pix_fmt
        for number in range(count):
            frame = av.VideoFrame.from_ndarray(ramp(number, *size), format="gray").reformat(format=pix_fmt)
            for packet in stream.encode(frame):
                container.mux(packet)
        for packet in stream.encode(None):
            container.mux(packet)
    return path


@pytest.mark.parametrize(
    ("name", "codec", "pix_fmt", "fps"),
    [
        ("a.mp4", "libx264", "yuv420p", 30),
        ("b.mp4", "libx264", "yuv444p", 300),
        ("c.mkv", "libx264", "gray", 24),
        ("d.mkv", "ffv1", "yuv420p10le", 120),
        ("e.mkv", "ffv1", "gray", 60),
        ("f.avi", "mpeg4", "yuv420p", 25),
        ("g.webm", "libvpx-vp9", "yuv420p", 50),
        ("h.mkv", "ffv1", "bgr0", 1000 / 1001 * 30),
    ],
)
def test_any_format_is_read_in_order_as_grey(tmp_path, name, codec, pix_fmt, fps):
    path = write(tmp_path / name, codec, pix_fmt, fps=fps)
    info = scan_video(path)
    assert (info.size_px, info.frame_count, info.variable) == ((64, 48), 20, False)
    assert info.fps == pytest.approx(fps, rel=0.02)
    levels = [int(picture[40, 50]) for picture in frames(path)]
    assert len(levels) == 20
    assert (np.diff(levels) >= 0).all()
    assert levels[-1] - levels[0] > 55


@pytest.mark.parametrize("fps", [77.9, 240.0, 300.0, 400.0])
def test_a_constant_rate_in_whole_milliseconds_is_constant(fps):
    # Matroska and WebM count milliseconds: 300 frames/s are stamped 3, 3 and 4 ms apart.
    exact = np.arange(900) * 1000 / fps
    for stamps in (np.round(exact), np.floor(exact)):
        clock = clock_of(stamps.astype(np.int64) + 7, 0.001, 1 / fps)
        assert not clock.variable
        assert clock.fps == pytest.approx(fps, rel=1e-3)
        assert clock.times_s == pytest.approx(exact / 1000, abs=0.0011)
        assert np.ptp(np.diff(clock.times_s)) < 1e-9


def test_dropped_frames_make_a_rate_variable():
    for tick_s in (1 / 30, 1 / 60, 1 / 15360):
        ticks = round(1 / 30 / tick_s)
        kept = np.flatnonzero(np.arange(400) % 4 != 3) * ticks
        assert clock_of(kept, tick_s, 1 / 30).variable


def test_frames_are_found_by_number(tmp_path):
    path = write(tmp_path / "a.mp4", count=40)
    everything = list(frames(path))
    wanted = read_frames(scan_video(path), [39, 0, 17])
    assert list(wanted) == [0, 17, 39]
    assert all(np.array_equal(wanted[n], everything[n]) for n in wanted)
    with pytest.raises(InputError, match="the video has frames 0 to 39"):
        read_frames(scan_video(path), [40])


MATRICES = {
    90: (0, 1, -1, 0),
    180: (-1, 0, 0, -1),
    270: (0, -1, 1, 0),
}


@pytest.mark.parametrize("degrees", MATRICES)
def test_a_rotated_phone_video_is_read_upright(tmp_path, degrees):
    """The rotation is written where phones write it: into the matrix of the MP4 track header."""
    path = write(tmp_path / "phone.mp4")
    data = bytearray(path.read_bytes())
    at = data.index(b"tkhd") + 4 + 40
    a, b, c, d = (int(value * 65536) for value in MATRICES[degrees])
    values = (a, b, 0, c, d, 0, 0, 0, 1 << 30)
    data[at : at + 36] = b"".join(value.to_bytes(4, "big", signed=True) for value in values)
    path.write_bytes(bytes(data))
    info = scan_video(path)
    assert info.size_px == ((64, 48) if degrees == 180 else (48, 64))
    picture, colours = next(iter(frames(path))), next(iter(frames(path, read=rgb)))
    assert colours.shape == (*picture.shape, 3)
    assert np.abs(colours.mean(2) - picture).max() < 40
    corner = {90: (5, -5), 180: (-5, -5), 270: (-5, 5)}[degrees]
    assert picture[corner] > 180
    assert picture.shape == info.size_px[::-1]
    assert picture[picture.shape[0] // 2, picture.shape[1] // 2] < 60


def test_an_unfinished_video_is_never_left(tmp_path):
    path = tmp_path / "out.mp4"
    with pytest.raises(ValueError), VideoWriter(path, 30, (64, 48)) as writer:
        writer.write(np.zeros((3, 3, 9), np.uint8))
    assert list(tmp_path.iterdir()) == []


def test_written_frames_come_back(tmp_path):
    path = tmp_path / "out.mp4"
    with VideoWriter(path, 240, (64, 48)) as writer:
        for number in range(10):
            writer.write(np.repeat(ramp(number)[:, :, None], 3, axis=2))
    info = scan_video(path)
    assert info.frame_count == 10
    assert info.fps == pytest.approx(240)


def test_a_reader_that_stops_early_ends_its_thread(tmp_path):
    import threading

    path = write(tmp_path / "a.mp4", count=200)
    reader = frames(path)
    next(reader)
    reader.close()
    assert not [thread for thread in threading.enumerate() if thread.name == "decoder"]


def trimmed(source, path, hidden, fps=25):
    """The same packets with the first frames hidden by an edit list, as phones and editors trim."""
    with (
        av.open(str(source)) as given,
        av.open(str(path), "w", options={"avoid_negative_ts": "disabled", "use_editlist": "1"}) as made,
    ):
        stream = given.streams.video[0]
        copied = made.add_stream_from_template(stream)
        for packet in given.demux(stream):
            if packet.size:
                shift = int(Fraction(hidden, fps) / packet.time_base)
                packet.pts, packet.dts, packet.stream = packet.pts - shift, packet.dts - shift, copied
                made.mux(packet)
    return path


@pytest.mark.parametrize("name", ["a.mp4", "a.mov"])
@pytest.mark.parametrize("hidden", [1, 4, 11])
def test_frames_that_an_edit_list_hides_do_not_make_a_file_truncated(tmp_path, name, hidden):
    whole = write(tmp_path / f"whole-{name}", count=60, fps=25)
    path = trimmed(whole, tmp_path / name, hidden)
    with av.open(str(path)) as container:
        assert container.streams.video[0].frames == 60  # what the file declares
    info = scan_video(path)
    assert info.frame_count == 60 - hidden
    assert info.times_s[0] == 0
    assert info.fps == pytest.approx(25)
    assert not info.damaged
    pictures = list(frames(path))
    assert len(pictures) == info.frame_count
    assert np.array_equal(pictures[0], list(frames(whole))[hidden])


def test_a_trimmed_file_that_breaks_off_is_still_truncated(tmp_path):
    path = trimmed(write(tmp_path / "whole.mov", count=60, fps=25), tmp_path / "a.mov", 4)
    fast = tmp_path / "fast.mov"
    with (
        av.open(str(path), options={"ignore_editlist": "1"}) as given,
        av.open(str(fast), "w", options={"movflags": "faststart"}) as made,
    ):
        copied = made.add_stream_from_template(given.streams.video[0])
        for packet in given.demux(video=0):
            if packet.size:
                packet.stream = copied
                made.mux(packet)
    fast.write_bytes(fast.read_bytes()[: int(0.7 * fast.stat().st_size)])
    with pytest.raises(InputError, match="truncated"):
        scan_video(fast)
