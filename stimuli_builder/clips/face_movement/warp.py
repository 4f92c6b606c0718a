"""A character's levels with brow, cheek, squint and gaze moved in them: each is fetched along one field."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from experiments.errors import InputError
from stimuli_builder.clips.characters import DRAWN, Geometry
from stimuli_builder.clips.face_movement.amounts import Movement
from stimuli_builder.clips.face_movement.eyeball import (
    BESIDE_MM,
    IN_PER_DOWN,
    IRIS_MM,
    Fissure,
    Fissures,
    turning_share,
)
from stimuli_builder.clips.face_movement.skin import DRAWN_BROW, FIELDS
from stimuli_builder.clips.levels import LevelSet, Light, Window, window_inside
from stimuli_builder.clips.lower_lid import LowerLid

STILL_PX = 0.01
"""Displacements at closure 1 below which a pixel counts as still."""
Shift = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class _Eye:
    """Where one eye lies in the frame; `outwards` is 1 where its temple lies at the right."""

    outwards: int
    fissure: Fissure


def moved_levels(character: LevelSet, geometry: Geometry, movement: Movement) -> LevelSet:
    """The levels with what is declared moved in proportion to closure; the same object where nothing is.

    The picture at closure 0 stays. What comes in at the picture's edge, at most the declared mm, is skin
    mirrored there.

    Raises
    ------
    InputError
        No eye is found to move anything about.
    """
    added = movement.beyond(geometry.moved_mm)
    if not added:
        return character
    eyes = _eyes(character, geometry)
    skin = _skin_shift(character, eyes, added)
    gaze = added.get("gaze", 0.0)
    window = _window_of(character, skin)
    first = character.window.y - window.y, character.window.x - window.x
    levels = np.empty((len(character.levels), window.height, window.width, 3), np.uint16)
    levels[:] = character.base[window.slices]
    inside = tuple(slice(at, at + n) for at, n in zip(first, character.levels.shape[1:3], strict=True))
    levels[:, *inside] = character.levels
    skin = skin[window.slices]
    for index, closure in enumerate(character.closures):
        shift = np.float32(closure) * skin
        for eye in eyes if gaze else ():
            _add_gaze(shift, character, eye, float(closure) * gaze, float(closure), window)
        _fetch(levels[index], shift)
    return replace(character, levels=levels, window=window, read_lower=_placed(character, *first))


def _eyes(character: LevelSet, geometry: Geometry) -> list[_Eye]:
    eyes = []
    fissures = Fissures.of(character, geometry.opening_mm)
    half_px = geometry.inter_ocular_mm / 2 * character.px_per_mm
    for outwards in (-1, 1):
        column = character.size_px[0] / 2 + outwards * half_px
        fissure = fissures.at(column, outwards)
        if fissure is None:
            raise InputError(
                f"character '{character.name}': no eye that shuts lies {geometry.inter_ocular_mm / 2:g} mm "
                "beside the picture's middle; leave out brow_mm, cheek_mm, squint_mm and gaze_mm"
            )
        eyes.append(_Eye(outwards, fissure))
    return eyes


def _skin_shift(character: LevelSet, eyes: list[_Eye], added: Mapping[str, float]) -> Shift:
    """(height, width, 2) px to the right and down that the frame's skin moves at closure 1."""
    width, height = character.size_px
    shift = np.zeros((height, width, 2), np.float32)
    fields = FIELDS | ({"brow": DRAWN_BROW} if character.name in DRAWN else {})
    for eye in eyes:
        x = (
            (np.arange(width, dtype=np.float64) + 0.5 - eye.fissure.column)
            * eye.outwards
            / character.px_per_mm
        )
        y = (
            eye.fissure.middle_row - np.arange(height, dtype=np.float64)[:, None] - 0.5
        ) / character.px_per_mm
        for part, mm in added.items():
            if part in fields:
                px = mm * character.px_per_mm * fields[part].share(x, y)
                shift[..., 0] += px * fields[part].direction[0] * eye.outwards
                shift[..., 1] -= px * fields[part].direction[1]
    return shift


def _add_gaze(
    shift: Shift, character: LevelSet, eye: _Eye, down_mm: float, closure: float, window: Window
) -> None:
    """Add to a window's displacements in px what the eyeball turns, `down_mm` at the iris."""
    scale, fissure = character.px_per_mm, eye.fissure
    reach = (IRIS_MM + BESIDE_MM) * scale
    left, right = (int(at) - window.x for at in (fissure.column - reach, fissure.column + reach + 1))
    columns = slice(max(left, 0), min(right, window.width))
    x = (
        (np.arange(window.width, dtype=np.float64)[columns] + window.x + 0.5 - fissure.column)
        * eye.outwards
        / scale
    )
    ends = np.polyval(fissure.upper, x).min(), np.polyval(fissure.lower, x).max()
    rows = slice(max(int(ends[0]) - window.y, 0), min(int(ends[1]) + 1 - window.y, window.height))
    y = np.arange(window.height, dtype=np.float64)[rows, None] + window.y + 0.5
    down = down_mm * scale * turning_share(fissure, x, y, closure, scale)
    shift[rows, columns, 0] -= IN_PER_DOWN * eye.outwards * down
    shift[rows, columns, 1] += down


def _window_of(character: LevelSet, shift: Shift) -> Window:
    """The even window round the blink's and whatever else moves."""
    moves = np.abs(shift).max(axis=2) > STILL_PX
    if not moves.any():
        return character.window
    rows, columns = np.flatnonzero(moves.any(axis=1)), np.flatnonzero(moves.any(axis=0))
    now = character.window
    left, top = min(now.x, int(columns[0])), min(now.y, int(rows[0]))
    right = max(now.x + now.width, int(columns[-1]) + 1)
    bottom = max(now.y + now.height, int(rows[-1]) + 1)
    return window_inside(left, top, right - left, bottom - top, character.size_px)


def _fetch(level: Light, shift: Shift) -> None:
    """Bring each pixel of a level from where its displacement began; leave it where it is still.

    The displacement is small and smooth, so that of the place it ends at stands for that of its origin.
    """
    moves = np.abs(shift).max(axis=2) > STILL_PX
    rows = np.flatnonzero(moves.any(axis=1))
    if len(rows):
        part = slice(int(rows[0]), int(rows[-1]) + 1)
        at = _pixels(level.shape[:2])[part] - shift[part]
        fetched = cv2.remap(level, at, None, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT_101)
        np.copyto(level[part], fetched, where=moves[part, :, None])


@lru_cache(maxsize=1)
def _pixels(size: tuple[int, int]) -> Shift:
    """(height, width, 2) column and row of each pixel."""
    rows, columns = np.mgrid[0 : size[0], 0 : size[1]].astype(np.float32)
    return np.stack([columns, rows], -1)


def _placed(character: LevelSet, down: int, across: int) -> Callable[[], LowerLid] | None:
    """Reads the lower lid at its place in the greater window."""
    if character.read_lower is None:
        return None

    def read() -> LowerLid:
        lower = character.lower
        rows, columns = (
            slice(part.start + by, part.stop + by)
            for part, by in ((lower.rows, down), (lower.columns, across))
        )
        return replace(lower, rows=rows, columns=columns)

    return read
