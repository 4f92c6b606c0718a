"""A baked character as clips need it: its atlas at its own size, or resampled in linear light."""

from functools import cached_property
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from stimuli_builder.characters.atlas import Atlas, load_atlas
from stimuli_builder.characters.colour import srgb_to_linear
from stimuli_builder.characters.declaration import LowerLid as DeclaredLowerLid
from stimuli_builder.clips.characters import Geometry
from stimuli_builder.clips.levels import LevelSet, Window, quantised, window_inside
from stimuli_builder.clips.lower_lid import LowerLid

MARGIN_PX = 4


class BakedCharacter:
    """A folder of pictures with a declaration (docs/own-character.md)."""

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
        )

    @cached_property
    def fingerprint(self) -> str:
        """SHA-256 of the declaration and every picture."""
        return load_atlas(self.folder).fingerprint()

    def levels(self, size_px: tuple[int, int]) -> LevelSet:
        """The atlas at a size: the width scales it, a lower height cuts skin above and below."""
        return atlas_levels(load_atlas(self.folder), self.geometry, size_px)


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
        character.name,
    )
    frame = character.base_linear()
    levels = np.empty((len(character.closures), window.height, window.width, 3), np.uint16)
    for index in range(len(levels)):
        frame[rows, columns] = srgb_to_linear(character.level_srgb(index))
        scaled_frame = _resized(frame, scaled)[top : top + size_px[1]]
        levels[index] = quantised(scaled_frame[window.slices])
        if index == 0:
            base = quantised(scaled_frame)
    px_per_mm = character.declaration.px_per_mm * scale
    lower = _scaled_lower_lid(character, scaled, top, window) if character.has_lower_lid else None
    return LevelSet(character.name, base, levels, character.closures, window, px_per_mm, lower)


def _scaled_lower_lid(character: Atlas, scaled: tuple[int, int], top: int, window: Window) -> LowerLid:
    crop, native = character.crop, character.size_px

    def to_window(part: NDArray[np.float32]) -> NDArray[np.float32]:
        frame = np.zeros((native[1], native[0], 3), np.float32)
        frame[crop] = part
        shifted = _resized(frame, scaled)[top:]
        return np.ascontiguousarray(shifted[window.slices])

    return LowerLid.of_character(character, to_window)


def _resized(frame: NDArray[np.float32], size_px: tuple[int, int]) -> NDArray[np.float32]:
    if (frame.shape[1], frame.shape[0]) == size_px:
        return frame
    method = cv2.INTER_AREA if size_px[0] < frame.shape[1] else cv2.INTER_LANCZOS4
    return np.asarray(cv2.resize(frame, size_px, interpolation=method), np.float32)
