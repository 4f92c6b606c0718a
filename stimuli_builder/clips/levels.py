"""A character at one picture size, ready to be blended: its levels as 16-bit linear light."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from experiments.errors import InputError
from stimuli_builder.characters.atlas import Atlas, LevelCodes, LowerLidLayer
from stimuli_builder.characters.colour import level_weights, linear_to_srgb
from stimuli_builder.clips.kernels import FULL_SCALE, GAMMA, Planes, add_products, split_planes, to_yuv

# The lower lid's layer at one picture size, added to blended frames for many samples at once.

CHANGE_STEP, FACTOR_STEP = 2.0, 2.0**-15
Array = NDArray[np.float64]
Picture = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class LowerLid:
    """Changes of the open eye by lower-lid pose, and how much of them shows at each closure.

    I(w, v, h) = I(w) + factor(w) change(v, h), bilinear in pose and linear in closure; so the mean over
    the samples of a shutter time is a sum over few (pose, matte) pairs.

    Attributes
    ----------
    vertical_mm, horizontal_mm, closures : float64 array
        Ascending grids of poses and mattes.
    changes : int16 array (vertical x horizontal, h, w, 3)
        In CHANGE_STEP of 65535.
    factors : uint16 array (mattes, h, w, 3)
        In FACTOR_STEP. Floats would take 200 MB more at most.
    rows, columns : slice
        Place in the character's window.
    """

    vertical_mm: Array
    horizontal_mm: Array
    closures: Array
    changes: NDArray[np.int16]
    factors: NDArray[np.uint16]
    rows: slice
    columns: slice

    @classmethod
    def of_character(
        cls, character: Atlas, to_window: Callable[[Picture], Picture], level_srgb: LevelCodes | None = None
    ) -> "LowerLid":
        """Decode a character's layer; `to_window` brings a picture of its crop to the size in use."""
        layer = LowerLidLayer(character, level_srgb)
        vertical, horizontal, closures = layer.vertical_mm, layer.horizontal_mm, layer.matte_closures
        shape = (character.declaration.crop[3], character.declaration.crop[2], 3)

        def placed(part: Picture) -> Picture:
            whole = np.zeros(shape, np.float32)
            whole[layer.window] = part
            return to_window(whole)

        # Cut as they come: whole windows of all poses at once would take 1 GB at the largest size.
        rows, columns = _where_any(placed(np.ones(layer.shape, np.float32)))
        array_shape = (rows.stop - rows.start, columns.stop - columns.start, 3)
        changes = np.empty((len(vertical) * len(horizontal), *array_shape), np.int16)
        for index, change in enumerate(layer.each_change()):
            part = placed(change)[rows, columns] * np.float32(FULL_SCALE / CHANGE_STEP)
            changes[index] = np.clip(np.rint(part), -32767, 32767)
        # Free the memory of the poses' video before the factors are made: their shade needs only the levels'
        # video.
        character.forget_poses()
        factors = np.empty((len(closures), *array_shape), np.uint16)
        for index in range(len(closures)):
            part = placed(layer.factor_at(index))[rows, columns] / np.float32(FACTOR_STEP)
            factors[index] = np.clip(np.rint(part), 0, FULL_SCALE)
        return cls(vertical, horizontal, closures, changes, factors, rows, columns)

    def limited(self, vertical_mm: Array, horizontal_mm: Array) -> tuple[Array, Array]:
        """The signals held within the poses that exist."""
        return (
            np.clip(vertical_mm, self.vertical_mm[0], self.vertical_mm[-1]),
            np.clip(horizontal_mm, self.horizontal_mm[0], self.horizontal_mm[-1]),
        )

    def thinned(self, step: int) -> "LowerLid":
        """Every `step`th pixel both ways, counted from the window's first."""
        # The first pixel of the layer that lies on the grid of the window.
        first = [-part.start % step for part in (self.rows, self.columns)]
        inside = slice(first[0], None, step), slice(first[1], None, step)
        changes = np.ascontiguousarray(self.changes[:, *inside])
        starts = (self.rows.start + first[0]) // step, (self.columns.start + first[1]) // step
        rows, columns = (slice(a, a + n) for a, n in zip(starts, changes.shape[1:3], strict=True))
        factors = np.ascontiguousarray(self.factors[:, *inside])
        return replace(self, changes=changes, factors=factors, rows=rows, columns=columns)

    def add(
        self, light: Picture, weights: Array, closure: Array, vertical_mm: Array, horizontal_mm: Array
    ) -> None:
        """Add the weighted mean over samples of the moved lower lid to `light` (h, w, 3), of 65535."""
        vertical, horizontal = self.limited(vertical_mm, horizontal_mm)
        across = _hat(self.vertical_mm, vertical)
        along = _hat(self.horizontal_mm, horizontal)
        covered = _hat(self.closures, np.clip(closure, self.closures[0], self.closures[-1]))
        # Summed over the samples before any pixel is touched: a frame costs the same at 10 samples and at
        # 12.5.
        shares = np.einsum("s,sv,sh,sm->vhm", weights, across, along, covered)
        steps = CHANGE_STEP * FACTOR_STEP
        # The integers' units come back here, once per pose and matte.
        table = (steps * shares.reshape(-1, shares.shape[2])).astype(np.float32)
        part = np.zeros((*self.changes.shape[1:3], 3), np.float32)
        add_products(self.changes, self.factors, table, part)
        light[self.rows, self.columns] += part


def _hat(grid: Array, values: Array) -> Array:
    """(samples, grid) shares of the two neighbors of each value."""
    if len(grid) == 1:
        return np.ones((len(values), 1))
    # The last grid point belongs to the last interval, with a share of 1.
    index = np.clip(np.searchsorted(grid, values, side="right") - 1, 0, len(grid) - 2)
    share = (values - grid[index]) / (grid[index + 1] - grid[index])
    hat = np.zeros((len(values), len(grid)))
    rows = np.arange(len(values))
    hat[rows, index] = 1.0 - share
    hat[rows, index + 1] = share
    return hat


def _where_any(picture: Picture) -> tuple[slice, slice]:
    """Rows and columns that hold all of a (h, w, 3) picture that is not 0."""
    seen = np.any(picture != 0.0, axis=2)
    rows, columns = np.flatnonzero(seen.any(axis=1)), np.flatnonzero(seen.any(axis=0))
    return slice(int(rows[0]), int(rows[-1]) + 1), slice(int(columns[0]), int(columns[-1]) + 1)


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
        """(m, n) weights over levels of m closures: linear between the two neighbors."""
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
    # Even, as one chroma sample covers two by two pixels: a window may not cut one.
    x0, y0 = max(0, 2 * int(x // 2)), max(0, 2 * int(y // 2))
    x1 = min(size_px[0], 2 * int(np.ceil((x + width) / 2)))
    y1 = min(size_px[1], 2 * int(np.ceil((y + height) / 2)))
    return Window(x0, y0, x1 - x0, y1 - y0)


def quantise_light(light: NDArray[np.float32]) -> Light:
    """16-bit code of linear light in 0-1, clipped."""
    # Add half a step, because astype truncates.
    return (np.clip(light, 0.0, 1.0) * np.float32(FULL_SCALE) + np.float32(0.5)).astype(np.uint16)
