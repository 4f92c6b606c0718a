"""Videos of every kind become clips whose frames are those of the original, or are refused in one line."""

import subprocess
import sys
from pathlib import Path
from typing import Any

import av
import pytest

from tests.helpers.videos import FRAMES, write_sound, write_video
from video_conversion.prepare import prepare
from video_conversion.prepared import Prepared
from video_conversion.video_file import NotAClip, examine

MAX_GREY_ERROR = 4.0
"""Of a frame's mean grey, of 255: encoder, colour range and turning together."""


def prepared(folder: Path, path: Path, fps: float | None = None) -> tuple[Prepared, Path]:
    record = prepare(path, folder / "clips", fps)
    return record, folder / record.clip if record.source is None else folder / "clips" / Path(
        record.clip
    ).name


def mean_greys(path: Path) -> list[float]:
    """The mean of full-range grey of every frame."""
    with av.open(str(path)) as container:
        pictures = [
            frame.reformat(format="gray", dst_color_range="JPEG") for frame in container.decode(video=0)
        ]
    return [sum(data) / len(data) for data in (bytes(picture.planes[0]) for picture in pictures)]


def test_a_clip_that_browsers_play_is_left_as_it_is(tmp_path: Path) -> None:
    path = write_video(tmp_path / "a.mp4")
    record, clip = prepared(tmp_path, path)
    assert (record.source, record.clip, record.frames, record.fps) == (None, "a.mp4", FRAMES, 25)
    assert clip.read_bytes() == path.read_bytes()


KINDS: dict[str, tuple[str, dict[str, Any], str]] = {
    "vp9": ("a.webm", {"codec": "libvpx-vp9"}, "encoded as H.264, was vp9"),
    "hevc": ("a.mp4", {"codec": "libx265", "options": {"x265-params": "log-level=error"}}, "was hevc"),
    "4:4:4": ("a.mp4", {"pixels": "yuv444p"}, "4:2:0 with 8 bits, were yuv444p"),
    "ten bits": ("a.mp4", {"pixels": "yuv420p10le"}, "were yuv420p10le"),
    "full range": ("a.mp4", {"pixels": "yuvj420p"}, "colour range from full to limited"),
    "odd sides": ("a.mkv", {"codec": "ffv1", "size_px": (63, 47)}, "cut to even sides, 62 x 46"),
    "gif": ("a.gif", {"codec": "gif", "pixels": "rgb8"}, "was gif"),
    "avi": ("a.avi", {"codec": "mpeg4"}, "was mpeg4"),
    "prores": ("a.mov", {"codec": "prores_ks", "pixels": "yuv422p10le"}, "was prores"),
}


@pytest.mark.parametrize("kind", KINDS)
def test_each_frame_of_the_original_is_in_the_clip(tmp_path: Path, kind: str) -> None:
    name, settings, words = KINDS[kind]
    path = write_video(tmp_path / name, **settings)
    record, clip = prepared(tmp_path, path)
    source = record.source
    assert source is not None
    assert any(words in change for change in source.changes), source.changes
    assert (source.file, source.frame_map, source.encoded_again) == (name, (), True)
    assert source.lowest_psnr_db is None or source.lowest_psnr_db > 35
    shown, original = mean_greys(clip), mean_greys(path)
    assert len(shown) == len(original) == FRAMES
    assert max(abs(a - b) for a, b in zip(shown, original, strict=True)) < MAX_GREY_ERROR
    made = examine(clip)
    assert (made.codec, made.pixel_format, made.colour_range, made.rate) == ("h264", "yuv420p", "limited", 25)


def test_a_variable_rate_becomes_constant_and_the_frame_map_says_which_frame_is_which(tmp_path: Path) -> None:
    path = write_video(tmp_path / "vfr.mp4", shown_at=[0, 1, 2, 5, 6, 7, 11, 12, 13, 14])
    record, clip = prepared(tmp_path, path)
    assert record.source is not None
    assert record.source.variable_rate
    assert record.source.frame_map == (0, 1, 2, 2, 2, 3, 4, 5, 5, 5, 5, 6, 7, 8, 9)
    assert record.source.changes == ("a variable rate to 25 fps: 5 frames repeated, 0 left out",)
    shown, original = mean_greys(clip), mean_greys(path)
    for grey, number in zip(shown, record.source.frame_map, strict=True):
        assert abs(grey - original[number]) < MAX_GREY_ERROR


def test_one_rate_may_be_asked_for(tmp_path: Path) -> None:
    record, clip = prepared(tmp_path, write_video(tmp_path / "a.mp4", fps=50), fps=25)
    assert record.source is not None
    assert (record.source.frame_map, record.fps) == ((1, 3, 5, 7, 9), 25)
    assert len(mean_greys(clip)) == 5


@pytest.mark.parametrize(("rotation", "size"), [(90, (48, 64)), (180, (64, 48)), (-90, (48, 64))])
def test_a_turned_video_is_turned(tmp_path: Path, rotation: int, size: tuple[int, int]) -> None:
    record, clip = prepared(tmp_path, write_video(tmp_path / "a.mp4", rotation_deg=rotation))
    assert (record.width_px, record.height_px) == size
    assert examine(clip).rotation_deg == 0


def test_sound_is_left_out_and_pictures_are_copied_as_they_are(tmp_path: Path) -> None:
    path = write_video(tmp_path / "a.mp4", sound=True)
    record, clip = prepared(tmp_path, path)
    assert record.source is not None
    assert (record.source.changes, record.source.encoded_again) == (("sound left out",), False)
    assert packets(clip) == packets(path)
    assert examine(clip).other_streams == ()


@pytest.mark.parametrize("name", ["a.mov", "a.mp4"])
@pytest.mark.parametrize("b_frames", [0, 3])
def test_a_quicktime_file_becomes_an_mp4_file_and_its_pictures_are_copied(
    tmp_path: Path, name: str, b_frames: int
) -> None:
    options = {"x264-params": f"bframes={b_frames}:b-adapt=0:log-level=error"}
    written = write_video(tmp_path / "written.mov", options=options)
    path = written.rename(tmp_path / name)
    assert path.read_bytes()[8:12] == b"qt  "
    record, clip = prepared(tmp_path, path)
    assert record.source is not None
    assert record.source.changes == ("written as an MP4 file, was QuickTime",)
    assert not record.source.encoded_again
    assert packets(clip) == packets(path)
    content = clip.read_bytes()
    assert content[4:12] == b"ftypisom"
    assert content.index(b"moov") < content.index(b"mdat")


def packets(path: Path) -> list[bytes]:
    with av.open(str(path)) as container:
        return [bytes(packet) for packet in container.demux(video=0) if packet.size]


def test_the_same_file_gives_the_same_clip(tmp_path: Path) -> None:
    path = write_video(tmp_path / "a.webm", "libvpx-vp9")
    assert prepared(tmp_path, path)[0] == prepared(tmp_path, path)[0]


REPEATED = """
import random, sys
from pathlib import Path
from experiments.manifest import file_sha256
from video_conversion.conversion import conversion_of, encode
from video_conversion.video_file import examine
video, clip = Path(sys.argv[1]), Path(sys.argv[2])
conversion, made, blocks = conversion_of(examine(video), None), set(), {}
chance = random.Random(1)
for _ in range(400):
    for _ in range(20):
        blocks[chance.randrange(60)] = chance.randbytes(int(2 ** chance.uniform(4, 16)))
    encode(video, conversion, clip)
    made.add(file_sha256(clip))
print(len(made))
"""


def test_the_same_file_gives_the_same_clip_in_memory_used_before(tmp_path: Path) -> None:
    """Memory that is handed out again holds old data, which libx264 must not read."""
    path = write_video(tmp_path / "a.webm", "libvpx-vp9")
    command = [sys.executable, "-c", REPEATED, str(path), str(tmp_path / "clip.mp4")]
    made = subprocess.run(command, capture_output=True, text=True, check=True)
    assert made.stdout.strip() == "1"


def cut_short(path: Path) -> Path:
    path.write_bytes(write_video(path).read_bytes()[:1500])
    return path


def scrambled(path: Path) -> Path:
    content = bytearray(write_video(path, frames=40, size_px=(256, 192)).read_bytes())
    middle = content.index(b"mdat") + len(content) // 3
    content[middle : middle + 600] = bytes(range(200)) * 3
    path.write_bytes(content)
    return path


def playlist(path: Path) -> Path:
    write_video(path.with_name("other.mp4"))
    path.write_text("ffconcat version 1.0\nfile other.mp4\n")
    return path


def stream_list(path: Path) -> Path:
    path.write_text("#EXTM3U\n#EXT-X-TARGETDURATION:1\n#EXTINF:1,\nhttp://127.0.0.1:9/a.ts\n#EXT-X-ENDLIST\n")
    return path


HDR = "transfer=smpte2084:colorprim=bt2020:colormatrix=bt2020nc"
MINUTES = [0, 60, 130]
REFUSED: dict[str, tuple[Any, str]] = {
    "cut short": (cut_short, "cannot be read as a video"),
    "scrambled": (scrambled, "damaged|cannot be decoded after its frame"),
    "sound alone": (write_sound, "it holds audio and no picture"),
    "too large": (lambda path: write_video(path, size_px=(4098, 16), frames=1), "scale it to at most 4096"),
    "too long": (lambda path: write_video(path, fps=1, shown_at=MINUTES), "cut it to at most 120 s"),
    "HDR": (lambda path: write_video(path, options={"x264-params": HDR}), "HDR or wide-gamut"),
    "interlaced": (lambda path: write_video(path, options={"x264-params": "tff=1"}), "bwdif"),
    "a list of other files": (playlist, "cannot be read as a video"),
    "a list of addresses": (stream_list, "cannot be read as a video"),
}  # fmt: skip


@pytest.mark.parametrize("kind", REFUSED)
def test_what_cannot_be_a_clip_is_refused_in_one_line_with_what_to_do(tmp_path: Path, kind: str) -> None:
    write, words = REFUSED[kind]
    path = write(tmp_path / "a.mp4")
    with pytest.raises(NotAClip, match=words) as refusal:
        prepare(path, tmp_path / "clips", None)
    assert "\n" not in str(refusal.value)
    assert not list((tmp_path / "clips").glob("*")) if (tmp_path / "clips").exists() else True


def test_a_rate_out_of_bounds_needs_another(tmp_path: Path) -> None:
    path = write_video(tmp_path / "a.mp4", fps=480)
    with pytest.raises(NotAClip, match="choose a rate of 1 to 240"):
        prepare(path, tmp_path / "clips", None)
    assert prepared(tmp_path, path, fps=120)[0].fps == 120
