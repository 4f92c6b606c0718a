"""A character at one picture size, ready to be blended: its levels as 16-bit linear light."""

from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from experiments.errors import InputError
from stimuli_builder.characters.atlas import Character
from stimuli_builder.characters.colour import linear_to_srgb, srgb_to_linear
from stimuli_builder.clips.characters import CARTOON, find_character, geometry
from stimuli_builder.clips.kernels import FULL_SCALE
from stimuli_builder.clips.lower_lid import LowerLid

Light = NDArray[np.uint16]
MARGIN_PX = 4
ROOMY_WIDTH_PX = 1200
"""Up to this width a process keeps two characters; two at the largest size would pass 1.5 GB."""


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
    lower : LowerLid or None
        The lower lid's layer where the character has one.
    """

    name: str
    base: Light
    levels: Light
    closures: NDArray[np.float64]
    window: Window
    px_per_mm: float
    lower: LowerLid | None = None

    @property
    def size_px(self) -> tuple[int, int]:
        """(width, height) of the frame."""
        return self.base.shape[1], self.base.shape[0]

    def level_weights(self, closures: NDArray[np.float64]) -> NDArray[np.float64]:
        """(m, n) weights over levels of m closures: linear between the two neighbours."""
        upper = np.clip(np.searchsorted(self.closures, closures, side="left"), 1, len(self.closures) - 1)
        low, high = self.closures[upper - 1], self.closures[upper]
        share = (closures - low) / (high - low)
        weights = np.zeros((len(closures), len(self.closures)))
        rows = np.arange(len(closures))
        weights[rows, upper - 1] = 1.0 - share
        weights[rows, upper] += share
        return weights

    def thinned(self, step: int) -> "LevelSet":
        """Every `step`th pixel of the window both ways, to measure by; `window` and `base` stay."""
        lower = None if self.lower is None else self.lower.thinned(step)
        return replace(self, levels=np.ascontiguousarray(self.levels[:, ::step, ::step]), lower=lower)

    def picture(self, closure: float) -> NDArray[np.uint8]:
        """(height, width, 3) sRGB code values of the still frame at a closure."""
        weights = self.level_weights(np.array([closure]))[0]
        light = self.base.astype(np.float32)
        light[self.window.slices] = np.tensordot(weights, self.levels, axes=1)
        return linear_to_srgb(light / np.float32(FULL_SCALE))


def load_levels(character: str, size_px: tuple[int, int], beside: Path | None = None) -> LevelSet:
    """Draw or decode a character at a picture size.

    Parameters
    ----------
    character : str
        `cartoon`, a shipped character's name, or a character folder (relative to `beside`).
    size_px : (width, height)
        The width scales the character; a lower height cuts skin above and below.
    """
    if character == CARTOON:
        return cartoon_levels(size_px)
    return atlas_levels(find_character(character, beside), size_px)


@lru_cache(maxsize=2)
def kept_levels(
    character: str,
    fingerprint: str,  # noqa: ARG001 - part of the key: a character baked anew is read anew
    size_px: tuple[int, int],
    beside: Path | None,
) -> LevelSet:
    """`load_levels`, the last two kept; at great sizes only the last one."""
    # Every core is already taken by a process of its own.
    cv2.setNumThreads(1)
    if size_px[0] > ROOMY_WIDTH_PX:
        kept_levels.cache_clear()
    return load_levels(character, size_px, beside)


def cartoon_levels(size_px: tuple[int, int]) -> LevelSet:
    """The cartoon drawn anew at a size."""
    from stimuli_builder.characters import cartoon

    scaled, top = geometry(CARTOON).scaled(*size_px)
    x, y, width, height = cartoon.crop_px(scaled)
    window = _window_inside(x, y - top, width, height, size_px, CARTOON)
    closures = np.linspace(0.0, 1.0, cartoon.LEVELS)
    levels = np.empty((len(closures), window.height, window.width, 3), np.uint16)
    place = (window.x, window.y + top, window.width, window.height)
    for index, closure in enumerate(closures):
        levels[index] = _light_of_code(cartoon.draw_frame(float(closure), scaled, place))
    base = _light_of_code(cartoon.draw_frame(0.0, scaled, (0, top, *size_px)))
    base[window.slices] = levels[0]
    return LevelSet(CARTOON, base, levels, closures, window, scaled[0] / cartoon.FRAME_MM[0])


def atlas_levels(character: Character, size_px: tuple[int, int]) -> LevelSet:
    """A baked character at a size; other sizes than its own are resampled in linear light."""
    native = character.size_px
    scaled, top = geometry(str(character.folder)).scaled(*size_px)
    scale = scaled[0] / native[0]
    rows, columns = character.crop
    window = _window_inside(
        columns.start * scale - MARGIN_PX,
        rows.start * scale - MARGIN_PX - top,
        (columns.stop - columns.start) * scale + 2 * MARGIN_PX,
        (rows.stop - rows.start) * scale + 2 * MARGIN_PX,
        size_px,
        character.name,
    )
    frame = character.base_linear()
    levels = np.empty((len(character.closures), window.height, window.width, 3), np.uint16)
    for index in range(len(levels)):
        frame[rows, columns] = srgb_to_linear(character.level_srgb(index))
        scaled_frame = _resized(frame, scaled)[top : top + size_px[1]]
        levels[index] = _quantised(scaled_frame[window.slices])
        if index == 0:
            base = _quantised(scaled_frame)
    px_per_mm = character.declaration.px_per_mm * scale
    lower = _scaled_lower_lid(character, scaled, top, window) if character.has_lower_lid else None
    return LevelSet(character.name, base, levels, character.closures, window, px_per_mm, lower)


def _scaled_lower_lid(character: Character, scaled: tuple[int, int], top: int, window: Window) -> LowerLid:
    crop, native = character.crop, character.size_px

    def to_window(part: NDArray[np.float32]) -> NDArray[np.float32]:
        frame = np.zeros((native[1], native[0], 3), np.float32)
        frame[crop] = part
        shifted = _resized(frame, scaled)[top:]
        return np.ascontiguousarray(shifted[window.slices])

    return LowerLid.of_character(character, to_window)


def _window_inside(
    x: float, y: float, width: float, height: float, size_px: tuple[int, int], name: str
) -> Window:
    """The even window around a region; InputError where the picture would cut it above or below."""
    if y + MARGIN_PX < 0 or y + height - MARGIN_PX > size_px[1]:
        raise InputError(
            f"a picture of {size_px[0]} x {size_px[1]} px cuts off what moves in a blink of '{name}'; "
            "ask for a greater height"
        )
    x0, y0 = max(0, 2 * int(x // 2)), max(0, 2 * int(y // 2))
    x1 = min(size_px[0], 2 * int(np.ceil((x + width) / 2)))
    y1 = min(size_px[1], 2 * int(np.ceil((y + height) / 2)))
    return Window(x0, y0, x1 - x0, y1 - y0)


def _resized(frame: NDArray[np.float32], size_px: tuple[int, int]) -> NDArray[np.float32]:
    if (frame.shape[1], frame.shape[0]) == size_px:
        return frame
    method = cv2.INTER_AREA if size_px[0] < frame.shape[1] else cv2.INTER_LANCZOS4
    return np.asarray(cv2.resize(frame, size_px, interpolation=method), np.float32)


def _quantised(light: NDArray[np.float32]) -> Light:
    return (np.clip(light, 0.0, 1.0) * np.float32(FULL_SCALE) + np.float32(0.5)).astype(np.uint16)


def _light_of_code(code: NDArray[np.float32]) -> Light:
    """16-bit linear light of gamma-encoded sRGB in 0-1."""
    code = np.clip(code, 0.0, 1.0)
    linear = np.where(code <= 0.04045, code / 12.92, ((code + np.float32(0.055)) / np.float32(1.055)) ** 2.4)
    return _quantised(linear.astype(np.float32))
