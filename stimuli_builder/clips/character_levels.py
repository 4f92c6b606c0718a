"""Characters as levels that clips blend: baked pictures at any size, and the cartoon, drawn at every size."""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from stimuli_builder.characters import cartoon
from stimuli_builder.characters.atlas import Atlas, LevelCodes, load_atlas
from stimuli_builder.characters.cartoon_eye import OPENING_MM
from stimuli_builder.characters.cartoon_face import BROW_DROP_MM
from stimuli_builder.characters.cartoon_pen import CARTOON, LOOKS, CartoonLook
from stimuli_builder.characters.colour import LINEAR_OF_CODE, srgb_to_linear
from stimuli_builder.characters.declaration import LowerLid as DeclaredLowerLid
from stimuli_builder.clips.geometry import Geometry
from stimuli_builder.clips.kernels import FULL_SCALE
from stimuli_builder.clips.levels import LevelSet, Light, LowerLid, Window, quantise_light, window_inside

# A baked character as clips need it: its atlas at its own size, or resampled in linear light.

MARGIN_PX = 4
LIGHT_OF_CODE = quantise_light(LINEAR_OF_CODE)
"""16-bit linear light of every sRGB code value."""
CODE_OF_LIGHT = np.searchsorted(LIGHT_OF_CODE, np.arange(FULL_SCALE + 1)).astype(np.uint8)
"""The code value of every 16-bit linear light that `LIGHT_OF_CODE` holds."""


class BakedCharacter:
    """A folder of pictures with a declaration (docs/how-to/own-character.md)."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    @cached_property
    def geometry(self) -> Geometry:
        """Size and scale as declared."""
        declared = load_atlas(self.folder).declaration
        return Geometry(
            declared.name,
            declared.size_px,
            declared.px_per_mm,
            declared.inter_ocular_mm,
            declared.opening_mm,
            None if declared.lower_lid is None else _ends(declared.lower_lid),
            measured_movement(declared.provenance),
            blink_rows=(declared.crop[1], declared.crop[1] + declared.crop[3]),
        )

    @cached_property
    def fingerprint(self) -> str:
        """SHA-256 of the declaration and every picture."""
        return load_atlas(self.folder).fingerprint()

    def levels(self, size_px: tuple[int, int]) -> LevelSet:
        """The atlas at a size: the width scales it, a lower height cuts skin above and below."""
        return atlas_levels(load_atlas(self.folder), self.geometry, size_px)


def measured_movement(provenance: Mapping[str, Any]) -> dict[str, float]:
    """Millimeters by part of the face, as its bake measured them; empty for characters made elsewhere."""
    measured = provenance.get("moved_mm_at_closure_1")
    if not isinstance(measured, Mapping):
        return {}
    return {str(part): float(mm) for part, mm in measured.items() if isinstance(mm, int | float)}


def _ends(lid: DeclaredLowerLid) -> tuple[tuple[float, float], tuple[float, float]]:
    vertical, horizontal = lid.vertical_mm, lid.horizontal_mm
    return (vertical[0], vertical[-1]), (horizontal[0], horizontal[-1])


def atlas_levels(character: Atlas, geometry: Geometry, size_px: tuple[int, int]) -> LevelSet:
    """A baked character at a size; other sizes than its own are resampled in linear light."""
    native = character.size_px
    scaled, top = geometry.scaled(*size_px)
    scale = scaled[0] / native[0]
    rows, columns = character.crop
    window = window_inside(
        columns.start * scale - MARGIN_PX,
        rows.start * scale - MARGIN_PX - top,
        (columns.stop - columns.start) * scale + 2 * MARGIN_PX,
        (rows.stop - rows.start) * scale + 2 * MARGIN_PX,
        size_px,
    )
    read = _read_at_own_size if scaled == native else _read_resized
    content = read(character, scaled, slice(top, top + size_px[1]), window)
    px_per_mm = character.declaration.px_per_mm * scale

    def lower() -> LowerLid:
        return _scaled_lower_lid(load_atlas(character.folder), scaled, top, window, content.level_srgb)

    read_lower = lower if character.has_lower_lid else None
    return LevelSet(
        character.name, content.base, content.levels, character.closures, window, px_per_mm, read_lower
    )


@dataclass(frozen=True, eq=False)
class _LevelContents:
    """The whole frame and the window's levels; `level_srgb` where code values can be had from them."""

    base: Light
    levels: Light
    level_srgb: LevelCodes | None = None


def _read_at_own_size(character: Atlas, _: tuple[int, int], shown: slice, window: Window) -> _LevelContents:
    """Each code value has one value of light, so a table gives it, and the code value again."""
    rows, columns = character.crop
    base = quantise_light(character.base_linear())
    levels = np.empty((len(character.closures), window.height, window.width, 3), np.uint16)
    levels[:] = base[shown][window.slices]
    first_row, first_column = shown.start + window.y, window.x
    crops = levels[
        :,
        rows.start - first_row : rows.stop - first_row,
        columns.start - first_column : columns.stop - first_column,
    ]
    character.read_levels(crops, LIGHT_OF_CODE.__getitem__)
    base[rows, columns] = crops[0]

    def level_srgb(index: int) -> NDArray[np.uint8]:
        codes: NDArray[np.uint8] = CODE_OF_LIGHT[crops[index]]
        return codes

    return _LevelContents(np.ascontiguousarray(base[shown]), levels, level_srgb)


def _read_resized(character: Atlas, scaled: tuple[int, int], shown: slice, window: Window) -> _LevelContents:
    frame = character.base_linear()
    levels = np.empty((len(character.closures), window.height, window.width, 3), np.uint16)
    for index in range(len(levels)):
        # The whole frame each time: a crop scaled by itself would end otherwise at its edges.
        frame[character.crop] = srgb_to_linear(character.level_srgb(index))
        scaled_frame = _resized(frame, scaled)[shown]
        levels[index] = quantise_light(scaled_frame[window.slices])
        if index == 0:
            base = quantise_light(scaled_frame)
    return _LevelContents(base, levels)


def _scaled_lower_lid(
    character: Atlas,
    scaled: tuple[int, int],
    top: int,
    window: Window,
    level_srgb: LevelCodes | None,
) -> LowerLid:
    crop, native = character.crop, character.size_px

    def to_window(part: NDArray[np.float32]) -> NDArray[np.float32]:
        frame = np.zeros((native[1], native[0], 3), np.float32)
        frame[crop] = part
        shifted = _resized(frame, scaled)[top:]
        return np.ascontiguousarray(shifted[window.slices])

    return LowerLid.of_character(character, to_window, level_srgb)


def _resized(frame: NDArray[np.float32], size_px: tuple[int, int]) -> NDArray[np.float32]:
    if (frame.shape[1], frame.shape[0]) == size_px:
        return frame
    # Means over areas where it shrinks, since an interpolation would pass over pixels.
    method = cv2.INTER_AREA if size_px[0] < frame.shape[1] else cv2.INTER_LANCZOS4
    return np.asarray(cv2.resize(frame, size_px, interpolation=method), np.float32)


# Drawn characters as clips need them: drawn again at every size.

NATIVE_WIDTH_PX = 960
SPARE_PX = 4
"""Rows of the crop, above and below, in which nothing moves."""

# Here and not with the other looks: the fingerprint of `cartoon`, which studies have, covers their files.
CARTOON_2 = replace(
    CARTOON,
    name="cartoon@2",
    eyes=(replace(CARTOON.eyes[0], lead=0.025), replace(CARTOON.eyes[1], lead=-0.025)),
    darkens=True,
)
"""The first drawn character with eyes that differ at half closure and no line of iris between shut lids."""
DRAWN_LOOKS = LOOKS | {CARTOON_2.name: CARTOON_2}


class CartoonCharacter:
    """A vector drawing of `stimuli_builder.characters.cartoon`; it has no lower-lid layer."""

    def __init__(self, look: CartoonLook) -> None:
        self._look = look

    @cached_property
    def geometry(self) -> Geometry:
        """Size and scale at its native width."""
        height = round(NATIVE_WIDTH_PX * cartoon.FRAME_MM[1] / cartoon.FRAME_MM[0])
        scale = NATIVE_WIDTH_PX / cartoon.FRAME_MM[0]
        size = (NATIVE_WIDTH_PX, height)
        _, first, _, rows = cartoon.crop_px(size)
        return Geometry(
            self._look.name,
            size,
            scale,
            cartoon.INTER_OCULAR_MM,
            OPENING_MM,
            lower_range_mm=None,
            moved_mm={"brow": BROW_DROP_MM},
            blink_rows=(first + SPARE_PX, first + rows - SPARE_PX),
        )

    @cached_property
    def fingerprint(self) -> str:
        """SHA-256 of the drawing's source and library, and of a look that the source does not contain."""
        source = cartoon.fingerprint(self._look)
        if self._look.name in LOOKS:
            return source
        return hashlib.sha256(f"{source} {self._look!r}".encode()).hexdigest()

    def levels(self, size_px: tuple[int, int]) -> LevelSet:
        """The drawing at a size: the width scales it, a lower height cuts skin above and below."""
        scaled, top = self.geometry.scaled(*size_px)
        x, y, width, height = cartoon.crop_px(scaled)
        window = window_inside(x, y - top, width, height, size_px)
        closures = np.linspace(0.0, 1.0, cartoon.LEVELS)
        levels = np.empty((len(closures), window.height, window.width, 3), np.uint16)
        rectangle = (window.x, window.y + top, window.width, window.height)
        opened = cartoon.draw_frame(0.0, scaled, rectangle, self._look)
        levels[:] = _light_of_code(opened)
        for level, closure in zip(levels[1:], closures[1:], strict=True):
            drawn = cartoon.draw_frame(float(closure), scaled, rectangle, self._look)
            # Skin stands still, and a power costs more than a comparison.
            moved = np.flatnonzero(drawn != opened)
            level.reshape(-1)[moved] = _light_of_code(drawn.reshape(-1)[moved])
        base = _light_of_code(cartoon.draw_frame(0.0, scaled, (0, top, *size_px), self._look))
        base[window.slices] = levels[0]
        return LevelSet(self._look.name, base, levels, closures, window, scaled[0] / cartoon.FRAME_MM[0])


def _light_of_code(code: NDArray[np.float32]) -> Light:
    """16-bit linear light of gamma-encoded sRGB in 0-1."""
    code = np.clip(code, 0.0, 1.0)
    linear = np.where(code <= 0.04045, code / 12.92, ((code + np.float32(0.055)) / np.float32(1.055)) ** 2.4)
    return quantise_light(linear.astype(np.float32))
