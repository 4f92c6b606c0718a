"""One rule decides what is a clip: what it leaves as it is, and what it makes, both browsers' pages play.

Every combination of container, codec, depth, sampling, B-frames, edit list and rotation that FFmpeg can write
goes through `video_conversion` and through the participant page's own decoder in Chromium and Firefox.
"""

import functools
import itertools
import json
import shutil
import struct
import subprocess
import threading
from collections.abc import Callable, Iterator
from fractions import Fraction
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import av
import pytest
from av.error import FFmpegError

from tests.browser.conftest import REPOSITORY, system_chromium
from tests.helpers.videos import frame_of
from video_conversion.prepare import prepare
from video_conversion.prepared import Prepared
from video_conversion.video_file import NotAClip

pytestmark = [pytest.mark.browser, pytest.mark.firefox]

FRAMES, FPS, SIZE_PX = 12, 25, (128, 96)
MAX_GREY_ERROR = 3.0
QUIET = {"libx265": {"x265-params": "log-level=error"}, "libx264": {"x264-params": "log-level=error"}}
CODECS = {
    "h264": ("libx264", "yuv420p"),
    "h264-10": ("libx264", "yuv420p10le"),
    "h264-444": ("libx264", "yuv444p"),
    "h264-full": ("libx264", "yuvj420p"),
    "hevc": ("libx265", "yuv420p"),
    "hevc-10": ("libx265", "yuv420p10le"),
    "vp9": ("libvpx-vp9", "yuv420p"),
    "vp9-10": ("libvpx-vp9", "yuv420p10le"),
    "av1": ("libaom-av1", "yuv420p"),
}
CONTAINERS = ("mp4", "mov", "webm", "mkv", "qt.mp4", "fragmented.mp4", "end.mp4")
FLAGS = {"fragmented.mp4": "frag_keyframe+empty_moov", "end.mp4": "", "mov": ""}
B_FRAMES = {"b0": 0, "b3": 3}
ROTATIONS = {"upright": 0, "turned": 90}
CUTS = ("whole", "cut")


def write(
    path: Path, codec: str, pixels: str, b_frames: int, rotation_deg: int, options: dict[str, str]
) -> None:
    """Write a clip whose frames differ in brightness, with a key frame half way."""
    with av.open(str(path), "w", options=options) as container:
        stream: Any = container.add_stream(codec, rate=FPS)
        (stream.width, stream.height), stream.pix_fmt = SIZE_PX, pixels
        params = dict(QUIET.get(codec, {}))
        if codec in ("libx264", "libx265"):
            name = f"{codec[3:]}-params"
            params[name] = f"{params[name]}:bframes={b_frames}:keyint=6:scenecut=0:b-adapt=0"
        else:
            params |= {"deadline": "realtime", "cpu-used": "8"}
        stream.options = params
        if rotation_deg:
            stream.set_display_rotation(rotation_deg)
        for number in range(FRAMES):
            frame = frame_of(number, *SIZE_PX, pixels)
            frame.pts, frame.time_base = number, Fraction(1, FPS)
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))


def rename_brand(path: Path) -> None:
    """The major brand of QuickTime in a file that is named MP4."""
    content = bytearray(path.read_bytes())
    content[8:12] = b"qt  "
    path.write_bytes(content)


def cut_by_edit_list(path: Path) -> bool:
    """Let the edit list begin at the fourth frame; False where the file has none."""
    content = bytearray(path.read_bytes())
    place = content.find(b"elst")
    if place < 0:
        return False
    version, count = content[place + 4], struct.unpack_from(">I", content, place + 8)[0]
    assert (version, count) == (0, 1)
    duration, start = struct.unpack_from(">Ii", content, place + 12)
    timescale = struct.unpack_from(">I", content, content.index(b"mdhd") + 16)[0]
    movie = struct.unpack_from(">I", content, content.index(b"mvhd") + 16)[0]
    struct.pack_into(">Ii", content, place + 12, duration - 3 * movie // FPS, start + 3 * timescale // FPS)
    path.write_bytes(content)
    return True


def write_kind(path: Path, container: str, codec: str, b: str, rotation: str, cut: str) -> bool:
    """Write one combination; False where FFmpeg cannot, or it is the same file as another."""
    encoder, pixels = CODECS[codec]
    if (b == "b3" and encoder not in ("libx264", "libx265")) or (
        cut == "cut" and container in ("webm", "mkv")
    ):
        return False
    if cut == "cut" and container == "fragmented.mp4":
        return False
    flags = {"fragmented.mp4": "frag_keyframe+empty_moov", "end.mp4": "", "mov": ""}.get(
        container, "faststart"
    )
    options = {} if container in ("webm", "mkv") or not flags else {"movflags": flags}
    try:
        write(path, encoder, pixels, B_FRAMES[b], ROTATIONS[rotation], options)
    except (FFmpegError, ValueError):
        path.unlink(missing_ok=True)
        return False
    if container == "qt.mp4":
        rename_brand(path)
    return cut == "whole" or cut_by_edit_list(path)


def shown_greys(path: Path) -> list[float]:
    """Mean grey of every frame that is to be shown, by FFmpeg, which applies edit lists."""
    with av.open(str(path)) as container:
        pictures = [
            frame.reformat(format="gray", dst_color_range="JPEG") for frame in container.decode(video=0)
        ]
    return [sum(bytes(one.planes[0])) / len(bytes(one.planes[0])) for one in pictures]


def differences(decision: dict[str, Any], path: Path, size_px: tuple[int, int]) -> list[str]:
    """In what a browser's decision is not what FFmpeg shows."""
    if decision["problem"] is not None:
        return [decision["problem"]]
    greys = shown_greys(path)
    if not decision["greys"]:  # of a long clip, decoded while it is shown
        greys = []
    elif decision["frames"] != len(greys):
        return [f"{decision['frames']} frames for {len(greys)}"]
    if (decision["width"], decision["height"]) != size_px:
        return [f"{decision['width']} x {decision['height']} for {size_px}"]
    off = max((abs(a - b) for a, b in zip(decision["greys"], greys, strict=True)), default=0.0)
    return [f"frames off by {off:.0f}"] if off > MAX_GREY_ERROR else []


class Browsers:
    """The participant page's decoder in both browsers, over a folder that is served to them."""

    def __init__(self, folder: Path, address: str, programs: dict[str, str]) -> None:
        self.folder, self._address, self._programs = folder, address, programs

    def decide(self, names: list[str]) -> dict[str, dict[str, Any]]:
        """By browser and file: what its page makes of it."""
        return {name: self._ask(name, program, names) for name, program in self._programs.items()}

    def _ask(self, name: str, program: str, names: list[str]) -> dict[str, Any]:
        command = ["node", "tests/playback/decide.mjs", name, program, self._address, *names]
        done = subprocess.run(
            command, cwd=REPOSITORY / "frontend", capture_output=True, text=True, timeout=600, check=False
        )
        assert done.returncode == 0, done.stderr[-3000:]
        decisions: dict[str, Any] = json.loads(done.stdout.strip().splitlines()[-1])
        return decisions


@pytest.fixture(scope="module")
def browsers(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browsers]:
    firefox = next((path for name in ("firefox-esr", "firefox") if (path := shutil.which(name))), None)
    chromium = system_chromium()
    if firefox is None or chromium is None:
        pytest.skip("no Firefox or Chromium here: sudo apt-get install firefox-esr chromium")
    if not (REPOSITORY / "frontend" / "node_modules" / "puppeteer-core").is_dir():
        pytest.skip("the frontend's packages are not installed: run `make setup-test`")
    folder = tmp_path_factory.mktemp("decided")
    build = ["npx", "vite", "build", "-c", "tests/playback/vite.config.ts", "--logLevel", "error"]
    subprocess.run([*build, "--outDir", str(folder)], cwd=REPOSITORY / "frontend", check=True)
    (folder / "index.html").write_text('<!doctype html><script type="module" src="page.js"></script>')

    class Quiet(SimpleHTTPRequestHandler):
        def log_message(self, format: str, *args: Any) -> None:
            """Say nothing."""

    handler = functools.partial(Quiet, directory=str(folder))
    server = ThreadingHTTPServer(("127.0.0.1", 0), handler)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield Browsers(
        folder, f"http://127.0.0.1:{server.server_port}/", {"chromium": chromium, "firefox": firefox}
    )
    server.shutdown()
    server.server_close()


def outcome(path: Path, folder: Path) -> Prepared | NotAClip:
    try:
        return prepare(path, folder / "clips", None)
    except NotAClip as refused:
        return refused


def test_what_the_rule_leaves_as_it_is_and_what_it_makes_both_pages_play(browsers: Browsers) -> None:
    folder = browsers.folder
    combinations = itertools.product(CONTAINERS, CODECS, B_FRAMES, ROTATIONS, CUTS)
    names = []
    for container, codec, *rest in combinations:
        name = f"{'-'.join([codec, *rest])}.{container}"
        if write_kind(folder / name, container, codec, *rest):
            names.append(name)
        else:
            (folder / name).unlink(missing_ok=True)
    made, refused = check(browsers, names)
    assert len(names) > 120
    assert refused == {}
    kept = {name for name, record in made.items() if record.source is None}
    for b_frames in B_FRAMES:
        assert f"h264-{b_frames}-upright-whole.mp4" in kept
        for container in ("mov", "qt.mp4"):  # whose pictures stay as they are encoded
            source = made[f"h264-{b_frames}-upright-whole.{container}"].source
            assert source is not None
            assert not source.encoded_again


def replaced(path: Path, old: bytes, new: bytes) -> None:
    content = path.read_bytes()
    assert len(old) == len(new)
    assert old in content
    path.write_bytes(content.replace(old, new, 1))


def two_edits(path: Path) -> None:
    """An edit list that shows the second half first, of as many frames as are stored."""
    content = bytearray(path.read_bytes())
    place = content.index(b"elst") - 4
    movie = struct.unpack_from(">I", content, content.index(b"mvhd") + 16)[0]
    half, middle = (
        movie * FRAMES // FPS // 2,
        struct.unpack_from(">I", content, content.index(b"mdhd") + 16)[0] * FRAMES // FPS // 2,
    )
    first = struct.unpack_from(">i", content, place + 20)[0]
    entry = struct.pack(">IiI", half, first + middle, 1 << 16) + struct.pack(">IiI", half, first, 1 << 16)
    box = struct.pack(">I", 16 + len(entry)) + b"elst" + struct.pack(">II", 0, 2) + entry
    content[place : place + 28] = box
    for name in (b"edts", b"trak", b"moov"):
        at = content.index(name) - 4
        struct.pack_into(">I", content, at, struct.unpack_from(">I", content, at)[0] + 12)
    path.write_bytes(content)


def late(path: Path) -> None:
    """Cut out of a stream with open groups of pictures: it begins with a picture that is not an IDR."""
    longer = path.with_suffix(".whole.mp4")
    plain(longer, "bframes=3:keyint=6:open-gop=1:b-adapt=0", frames=24)
    with av.open(str(longer)) as whole, av.open(str(path), "w") as cut:
        stream = whole.streams.video[0]
        copied, keys = cut.add_stream_from_template(stream), 0
        for packet in whole.demux(stream):
            keys += packet.is_keyframe and packet.size > 0
            if keys > 1 and packet.dts is not None:
                packet.stream = copied
                cut.mux(packet)
    longer.unlink()


def plain(path: Path, params: str = "", *, frames: int = FRAMES, profile: str = "high", **sizes: Any) -> Path:
    """An H.264 clip with parameters of x264."""
    with av.open(str(path), "w") as container:
        stream: Any = container.add_stream("libx264", rate=sizes.get("fps", FPS))
        (stream.width, stream.height), stream.pix_fmt = sizes.get("size_px", SIZE_PX), "yuv420p"
        stream.options = {
            "profile": profile,
            "x264-params": f"log-level=error:{params}",
            "preset": "ultrafast",
        }
        for number in range(frames):
            frame = frame_of(number, stream.width, stream.height)
            frame.pts, frame.time_base = number, 1 / Fraction(sizes.get("fps", FPS))
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
    return path


def add_garbage(path: Path) -> None:
    with path.open("ab") as stream:
        stream.write(bytes(999))


def altered(change: Callable[[Path], None]) -> Callable[[Path], Any]:
    """A plain clip with a change to its bytes."""
    return lambda path: change(plain(path))


FURTHER: dict[str, Callable[[Path], Any]] = {
    "baseline": lambda path: plain(path, profile="baseline"),
    "main": lambda path: plain(path, "bframes=2", profile="main"),
    "low level": lambda path: plain(path, "level=1.1"),
    "high level": lambda path: plain(path, "level=6.2"),
    "many references": lambda path: plain(path, "ref=16:bframes=8:b-pyramid=normal"),
    "intra refresh": lambda path: plain(path, "intra-refresh=1:keyint=6"),
    "slices": lambda path: plain(path, "slices=4"),
    "odd sides": lambda path: plain(path, size_px=(126, 94)),
    "one frame": lambda path: plain(path, frames=1),
    "large": lambda path: plain(path, frames=2, size_px=(4096, 2160)),
    "largest": lambda path: plain(path, frames=2, size_px=(4096, 4096)),
    "a high rate": lambda path: plain(path, fps=240),
    "long": lambda path: plain(path, "bframes=3", frames=950, size_px=(64, 48), fps=60),
    "longest": lambda path: plain(path, frames=5_000, size_px=(64, 48), fps=60),
    "too long": lambda path: plain(path, frames=5_001, size_px=(64, 48), fps=60),
    "no brand": altered(lambda path: replaced(path, b"ftyp", b"free")),
    "brand mp42": altered(lambda path: replaced(path, b"ftypisom", b"ftypmp42")),
    "brand M4V": altered(lambda path: replaced(path, b"ftypisom", b"ftypM4V ")),
    "brand 3gp": altered(lambda path: replaced(path, b"ftypisom", b"ftyp3gp4")),
    "second half first": altered(two_edits),
    "begins with no IDR": late,
    "garbage behind": altered(add_garbage),
}  # fmt: skip


def test_further_kinds_of_h264(browsers: Browsers) -> None:
    names = []
    for kind, write_one in FURTHER.items():
        name = f"{kind.replace(' ', '_')}.mp4"
        write_one(browsers.folder / name)
        names.append(name)
    made, refused = check(browsers, names)
    assert set(refused) <= {"too_long.mp4", "begins_with_no_IDR.mp4"}
    assert "at most 5000 frames" in refused["too_long.mp4"]
    assert made["second_half_first.mp4"].source is not None
    assert made["no_brand.mp4"].source is not None


def check(browsers: Browsers, names: list[str]) -> tuple[dict[str, Prepared], dict[str, str]]:
    """Every clip, unchanged or once converted, is for both pages what the rule says; clips and refusals."""
    folder = browsers.folder
    outcomes = {name: outcome(folder / name, folder) for name in names}
    made = {name: record for name, record in outcomes.items() if isinstance(record, Prepared)}
    decisions = browsers.decide(sorted({record.clip for record in made.values()}))
    wrong = {}
    for browser, told in decisions.items():
        for name, record in made.items():
            size_px = (record.width_px, record.height_px)
            found = differences(told[record.clip], folder / record.clip, size_px)
            if record.frames != told[record.clip]["frames"]:
                found.append(f"the rule says {record.frames} frames")
            if found:
                wrong[browser, name, "as it is" if record.source is None else "converted"] = found
    assert wrong == {}
    return made, {name: str(why) for name, why in outcomes.items() if isinstance(why, NotAClip)}
