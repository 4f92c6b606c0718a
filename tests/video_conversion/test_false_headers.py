"""Files whose header promises far more than they hold cost neither memory nor time."""

import resource
import struct
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import av
import numpy as np
import pytest

MAX_MEGABYTES = 400
"""Of address space beyond what the libraries take; the promised pictures would need thousands."""
PROGRAM = """
import resource, sys
from pathlib import Path
from video_conversion.prepare import prepare
from video_conversion.video_file import NotAClip
path = Path(sys.argv[1])
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
try:
    record = prepare(path, path.parent, None)
    said = f"{record.width_px} {record.height_px} {record.frames} {record.problem}"
except NotAClip as refused:
    said = f"refused: {refused}"
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before, said)
"""


def clip(path: Path, codec: str, size: tuple[int, int]) -> bytes:
    """A clip of 30 grey frames."""
    with av.open(str(path), "w") as container:
        stream = container.add_stream(codec, rate=30)
        stream.width, stream.height, stream.pix_fmt = *size, "yuv420p"
        for number in range(30):
            grey = np.full((size[1], size[0], 3), 8 * number, np.uint8)
            container.mux(stream.encode(av.VideoFrame.from_ndarray(grey, "rgb24")))
        container.mux(stream.encode(None))
    return path.read_bytes()


def put(content: bytearray, box: bytes, offset: int, form: str, *values: int) -> None:
    """Write numbers so many bytes behind the name of a box of MP4."""
    struct.pack_into(form, content, content.index(box) + 4 + offset, *values)


def wide(content: bytearray) -> None:
    put(content, b"avc1", 24, ">HH", 65535, 65535)


def many_samples(content: bytearray) -> None:
    put(content, b"stsz", 4, ">II", 1, 10**9)


def many_times(content: bytearray) -> None:
    put(content, b"stts", 8, ">I", 10**9)


def all_of_it(content: bytearray) -> None:
    wide(content)
    many_samples(content)
    many_times(content)
    put(content, b"stsc", 12, ">I", 10**9)


@pytest.mark.parametrize("lie", [wide, many_samples, many_times, all_of_it])
def test_an_mp4_that_promises_too_much(tmp_path: Path, lie: Callable[[bytearray], None]) -> None:
    content = bytearray(clip(tmp_path / "good.mp4", "libx264", (64, 48)))
    lie(content)
    path = tmp_path / "lie.mp4"
    path.write_bytes(content)
    examine(path)


def test_a_matroska_file_of_65535_x_65535_pixels(tmp_path: Path) -> None:
    content = bytearray(clip(tmp_path / "good.mkv", "ffv1", (640, 480)))
    for name, held in ((b"\xb0\x82", 640), (b"\xba\x82", 480)):
        place = content.index(name + struct.pack(">H", held)) + 2
        struct.pack_into(">H", content, place, 65535)
    path = tmp_path / "lie.mkv"
    path.write_bytes(content)
    assert examine(path).startswith("refused: ")


def test_a_header_of_100000_x_100000_pixels(tmp_path: Path) -> None:
    path = tmp_path / "lie.y4m"
    path.write_bytes(b"YUV4MPEG2 W100000 H100000 F30:1 Ip C420\nFRAME\n" + bytes(1000))
    assert examine(path).startswith("refused: ")


def examine(path: Path) -> str:
    """Prepare a file in a separate process, which may not take the memory that the file promises."""

    def bounded() -> None:
        resource.setrlimit(resource.RLIMIT_AS, (8 << 30, 8 << 30))

    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, str(path)],
        capture_output=True,
        text=True,
        check=True,
        preexec_fn=bounded,
    )
    grown, _, said = done.stdout.strip().partition(" ")
    assert int(grown) / 1024 < MAX_MEGABYTES
    return said
