"""A character at one picture size, ready to be blended: its levels as 16-bit linear light."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from experiments.errors import InputError
from stimuli_builder.characters.colour import linear_to_srgb
from stimuli_builder.characters.interpolation import level_weights
from stimuli_builder.clips.kernels import FULL_SCALE, GAMMA, Planes, split_planes, to_yuv
from stimuli_builder.clips.lower_lid import LowerLid

Light = NDArray[np.uint16]


@dataclass(frozen=True)
class Window:
    """A part of the frame in px, all numbers even."""

    x: int
    y: int
    width: int
    height: int

    @property
    def slices(self) -> tuple[slice, slice]:
        """Rows and columns."""
        return slice(self.y, self.y + self.height), slice(self.x, self.x + self.width)


@dataclass(frozen=True, eq=False)
class LevelSet:
    """Pictures of one character at one size, in linear light (0 to 65535).

    Attributes
    ----------
    base : uint16 array (height, width, 3)
        The whole frame with open eyes.
    levels : uint16 array (n, h, w, 3)
        What `window` shows at each of `closures`; its outermost pixels never change.
    closures : float64 array (n,)
        Ascending from 0 to 1.
    read_lower : function or None
        Reads the lower lid's layer where the character has one; clips in which it moves need it.
    """

    name: str
    base: Light
    levels: Light
    closures: NDArray[np.float64]
    window: Window
    px_per_mm: float
    read_lower: Callable[[], LowerLid] | None = None

    @cached_property
    def lower(self) -> LowerLid:
        """The lower lid's layer, read when it is first asked for; InputError where there is none."""
        if self.read_lower is None:
            raise InputError(f"character '{self.name}' has no lower-lid layer: use lower_lid = 'none'")
        return self.read_lower()

    @cached_property
    def base_planes(self) -> Planes:
        """(height * 3 / 2, width) 4:2:0 planes of `base`, converted once for all clips."""
        width, height = self.size_px
        planes = np.empty((height * 3 // 2, width), np.uint8)
        to_yuv(self.base.astype(np.float32), GAMMA, *split_planes(planes, width, height))
        return planes

    @property
    def size_px(self) -> tuple[int, int]:
        """(width, height) of the frame."""
        return self.base.shape[1], self.base.shape[0]

    def level_weights(self, closures: NDArray[np.float64]) -> NDArray[np.float64]:
        """(m, n) weights over levels of m closures: linear between the two neighbours."""
        return level_weights(self.closures, closures)

    def thinned(self, step: int) -> "LevelSet":
        """Every `step`th pixel of the window both ways, to measure by; `window` and `base` stay."""
        lower = None if self.read_lower is None else lambda: self.lower.thinned(step)
        return replace(self, levels=np.ascontiguousarray(self.levels[:, ::step, ::step]), read_lower=lower)

    def picture(self, closure: float) -> NDArray[np.uint8]:
        """(height, width, 3) sRGB code values of the still frame at a closure."""
        weights = self.level_weights(np.array([closure]))[0]
        light = self.base.astype(np.float32)
        light[self.window.slices] = np.tensordot(weights, self.levels, axes=1)
        return linear_to_srgb(light / np.float32(FULL_SCALE))


def window_inside(x: float, y: float, width: float, height: float, size_px: tuple[int, int]) -> Window:
    """The even window around a region, as far as it lies in the picture."""
    x0, y0 = max(0, 2 * int(x // 2)), max(0, 2 * int(y // 2))
    x1 = min(size_px[0], 2 * int(np.ceil((x + width) / 2)))
    y1 = min(size_px[1], 2 * int(np.ceil((y + height) / 2)))
    return Window(x0, y0, x1 - x0, y1 - y0)


def quantised(light: NDArray[np.float32]) -> Light:
    """16-bit code of linear light in 0-1, clipped."""
    return (np.clip(light, 0.0, 1.0) * np.float32(FULL_SCALE) + np.float32(0.5)).astype(np.uint16)
