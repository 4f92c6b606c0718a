"""The levels that a process keeps while it renders: the last characters at their sizes and movements."""

from functools import lru_cache
from pathlib import Path

import cv2

from stimuli_builder.clips.characters import find_character
from stimuli_builder.clips.face_movement import moved_levels
from stimuli_builder.clips.geometry import AS_BAKED, Movement
from stimuli_builder.clips.levels import LevelSet

ROOMY_WIDTH_PX = 1200
"""Up to this width a process keeps two characters; two at the largest size would pass 1.5 GB."""


@lru_cache(maxsize=2)
def kept_levels(
    character: str,
    fingerprint: str,  # noqa: ARG001 - part of the key: a character baked anew is read anew
    size_px: tuple[int, int],
    beside: Path | None,
    movement: Movement = AS_BAKED,
) -> LevelSet:
    """A character (a name, or a folder relative to `beside`) at a picture size, (width, height), as it moves.

    The last two are kept; at great sizes only the last one.
    """
    # Every core is already used by a separate process.
    cv2.setNumThreads(1)
    if size_px[0] > ROOMY_WIDTH_PX:
        kept_levels.cache_clear()
    shown = find_character(character, beside)
    return moved_levels(shown.levels(size_px), shown.geometry, movement)
