"""Xvfb's frame buffer, as a memory-mapped XWD file (`Xvfb -fbdir`; decision 0350)."""

import mmap
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from screen_bench import bars

# Words of the XWD header (X11/XWDFile.h), big-endian; each color map entry takes 12 bytes.
HEADER_SIZE, WIDTH, HEIGHT, BITS_PER_PIXEL, BYTES_PER_LINE, COLOURS = 0, 4, 5, 11, 12, 19
HEADER_WORDS, COLOUR_BYTES = 25, 12
GREEN = 1


@dataclass(frozen=True)
class ClipArea:
    """Where the clip lies on the display, in display pixels."""

    left: float
    top: float
    width: float
    height: float


class FrameBuffer:
    """The display's pixels, read without asking the display."""

    def __init__(self, path: Path) -> None:
        with path.open("rb") as file:
            self._map = mmap.mmap(file.fileno(), 0, prot=mmap.PROT_READ)
        words = struct.unpack(f">{HEADER_WORDS}I", self._map[: 4 * HEADER_WORDS])
        if words[BITS_PER_PIXEL] != 32:
            raise ValueError(f"expected 32 bits per pixel in {path}, got {words[BITS_PER_PIXEL]}")
        self.width, self.height, self._line = words[WIDTH], words[HEIGHT], words[BYTES_PER_LINE]
        self._start = words[HEADER_SIZE] + words[COLOURS] * COLOUR_BYTES

    def row(self, area: ClipArea, share: float) -> list[int]:
        """Offsets of the middle of each bar in the row at `share` of the clip's height."""
        y = int(area.top + share * area.height)
        step = area.width / bars.BARS
        xs = [int(area.left + (bar + 0.5) * step) for bar in range(bars.BARS)]
        if not (0 <= y < self.height and xs[0] >= 0 and xs[-1] < self.width):
            raise ValueError(f"the clip at {area} lies outside the display of {self.width} x {self.height}")
        return [self._start + y * self._line + 4 * x + GREEN for x in xs]

    def values(self, row: Sequence[int]) -> tuple[int, ...]:
        """The gray values at the offsets."""
        return tuple(self._map[offset] for offset in row)
