"""The poller as a process, on a frame buffer written by the test."""

import json
import struct
import time
from pathlib import Path

import numpy as np
import pytest
from screen_bench import bars
from screen_bench.framebuffer import ClipArea, FrameBuffer
from screen_bench.measure import poller

WIDTH, HEIGHT, HEAD_BYTES = 1000, 400, 160
AREA = ClipArea(20, 30, bars.WIDTH_PX, bars.HEIGHT_PX)


def write_display(path: Path, bits: int = 32) -> np.memmap:
    """An empty gray display; what is written into the array is on it."""
    words = [0] * 25
    words[0], words[4], words[5], words[11], words[12] = HEAD_BYTES, WIDTH, HEIGHT, bits, 4 * WIDTH
    path.write_bytes(struct.pack(">25I", *words).ljust(HEAD_BYTES, b"\0") + b"\x80" * (4 * WIDTH * HEIGHT))
    return np.memmap(path, np.uint8, "r+", HEAD_BYTES, (HEIGHT, WIDTH, 4))


def test_what_is_written_is_read(tmp_path: Path) -> None:
    pixels = write_display(tmp_path / "screen")
    with poller(tmp_path / "screen", AREA, tmp_path / "log.json"):
        for number in (0, 1, 63):
            rows = np.repeat(bars.planes(number)[: bars.HEIGHT_PX, :, None], 4, axis=2)
            pixels[30 : 30 + bars.HEIGHT_PX, 20 : 20 + bars.WIDTH_PX] = rows
            time.sleep(0.4)  # longer than a loaded machine holds up the poller
    log = json.loads((tmp_path / "log.json").read_text())
    states = [upper for _, upper, lower in log["changes"] if upper == lower and upper != bars.UNREADABLE]
    assert states == [bars.SURROUND, 0, 1, 63]
    assert log["polls"] > 10


def test_a_clip_outside_the_display_is_refused(tmp_path: Path) -> None:
    write_display(tmp_path / "screen")
    with pytest.raises(ValueError, match="lies outside the display of 1000 x 400"):
        FrameBuffer(tmp_path / "screen").row(ClipArea(100, 30, bars.WIDTH_PX, bars.HEIGHT_PX), 0.5)


def test_a_display_of_other_depth_is_refused(tmp_path: Path) -> None:
    write_display(tmp_path / "screen", bits=16)
    with pytest.raises(ValueError, match="expected 32 bits per pixel"):
        FrameBuffer(tmp_path / "screen")
