"""The cartoon as clips need it: drawn anew at every size."""

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from stimuli_builder.characters import cartoon
from stimuli_builder.characters.cartoon_face import BROW_DROP_MM
from stimuli_builder.clips.characters import Geometry
from stimuli_builder.clips.levels import LevelSet, Light, quantised, window_inside

NAME = "cartoon"
NATIVE_WIDTH_PX = 960
SPARE_PX = 4
"""Rows of the crop, above and below, in which nothing moves."""


class CartoonCharacter:
    """The vector drawing of `stimuli_builder.characters.cartoon`; it has no lower-lid layer."""

    @cached_property
    def geometry(self) -> Geometry:
        """Size and scale at its native width."""
        height = round(NATIVE_WIDTH_PX * cartoon.FRAME_MM[1] / cartoon.FRAME_MM[0])
        scale = NATIVE_WIDTH_PX / cartoon.FRAME_MM[0]
        size = (NATIVE_WIDTH_PX, height)
        _, first, _, rows = cartoon.crop_px(size)
        return Geometry(
            NAME,
            size,
            scale,
            cartoon.INTER_OCULAR_MM,
            cartoon.OPENING_MM,
            lower_range_mm=None,
            moved_mm={"brow": BROW_DROP_MM},
            blink_rows=(first + SPARE_PX, first + rows - SPARE_PX),
        )

    @cached_property
    def fingerprint(self) -> str:
        """SHA-256 of the drawing's source and library."""
        return cartoon.fingerprint()

    def levels(self, size_px: tuple[int, int]) -> LevelSet:
        """The cartoon at a size: the width scales it, a lower height cuts skin above and below."""
        scaled, top = self.geometry.scaled(*size_px)
        x, y, width, height = cartoon.crop_px(scaled)
        window = window_inside(x, y - top, width, height, size_px)
        closures = np.linspace(0.0, 1.0, cartoon.LEVELS)
        levels = np.empty((len(closures), window.height, window.width, 3), np.uint16)
        rectangle = (window.x, window.y + top, window.width, window.height)
        opened = cartoon.draw_frame(0.0, scaled, rectangle)
        levels[:] = _light_of_code(opened)
        for level, closure in zip(levels[1:], closures[1:], strict=True):
            drawn = cartoon.draw_frame(float(closure), scaled, rectangle)
            # Skin stands still, and a power costs more than a comparison.
            moved = np.flatnonzero(drawn != opened)
            level.reshape(-1)[moved] = _light_of_code(drawn.reshape(-1)[moved])
        base = _light_of_code(cartoon.draw_frame(0.0, scaled, (0, top, *size_px)))
        base[window.slices] = levels[0]
        return LevelSet(NAME, base, levels, closures, window, scaled[0] / cartoon.FRAME_MM[0])


def _light_of_code(code: NDArray[np.float32]) -> Light:
    """16-bit linear light of gamma-encoded sRGB in 0-1."""
    code = np.clip(code, 0.0, 1.0)
    linear = np.where(code <= 0.04045, code / 12.92, ((code + np.float32(0.055)) / np.float32(1.055)) ** 2.4)
    return quantised(linear.astype(np.float32))
