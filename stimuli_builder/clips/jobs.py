"""One clip to be rendered: all that decides its bytes, the hash of that, and the rendering itself."""

import hashlib
import json
from dataclasses import asdict, dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from stimuli_builder.blinks.profile import PROFILE_FPS
from stimuli_builder.clips.characters import find_character
from stimuli_builder.clips.curves import ClipCurve
from stimuli_builder.clips.face_movement import AS_BAKED, Movement, moved_levels
from stimuli_builder.clips.levels import LevelSet

if TYPE_CHECKING:
    from stimuli_builder.clips.levels import LevelSet


RENDER_VERSION = 2
"""Raise this when the same inputs come to give other pictures; every clip is then built again."""


@dataclass(frozen=True)
class Look:
    """How a clip is rendered, apart from what moves in it.

    `character` is a name or a folder; `beside` the folder it may be relative to. `fingerprint` is the
    SHA-256 of all its pictures, `encoder` names the encoder and its settings, `movement` what of the face
    moves beside what those pictures show.
    """

    character: str
    fingerprint: str
    encoder: str
    size_px: tuple[int, int]
    fps: float
    motion_blur: bool
    barcode: bool = False
    beside: Path | None = None
    movement: Movement = AS_BAKED

    def hashed(self) -> dict[str, Any]:
        """What of it decides a clip's bytes, as JSON data; paths do not count, nor what is not declared."""
        values = asdict(self) | {"beside": None, "character": None}
        if not self.movement.declared:
            del values["movement"]
        return values

    def levels(self) -> "LevelSet":
        """The character's levels as they move, kept for the next clip."""

        return kept_levels(self.character, self.fingerprint, self.size_px, self.beside, self.movement)


@dataclass(frozen=True)
class ClipJob:
    """A clip to render."""

    look: Look
    curve: ClipCurve

    @property
    def frames(self) -> int:
        """Number of frames of the clip."""
        return int(len(self.curve.closure) * self.look.fps / PROFILE_FPS + 1e-9)

    @property
    def input_hash(self) -> str:
        """SHA-256 over everything that decides the clip's bytes; paths do not count."""
        look = self.look.hashed() | {"render_version": RENDER_VERSION}
        digest = hashlib.sha256(json.dumps(look, sort_keys=True).encode())
        curve = self.curve
        for name in ("closure", "closure_other", "lower_vertical_mm", "lower_horizontal_mm"):
            values = getattr(curve, name)
            digest.update(name.encode())
            if values is not None:
                # Whole millionths: the same on every machine, whatever its last bits of rounding.
                digest.update(np.round(values * 1e6).astype("<i8").tobytes())
        return digest.hexdigest()


def render(job: ClipJob) -> bytes:
    """Render and encode a clip; returns the bytes of its MP4 file."""
    from stimuli_builder.clips.encode import encode_clip
    from stimuli_builder.clips.frames import FramePainter

    look = job.look
    painter = FramePainter(look.levels())
    frames = painter.frames(job.curve, look.fps, look.motion_blur, look.barcode)
    return encode_clip(frames, look.size_px, look.fps)


# The levels that a process keeps while it renders: the last characters at their sizes and movements.

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
    # Every core is already taken by a process of its own.
    cv2.setNumThreads(1)
    if size_px[0] > ROOMY_WIDTH_PX:
        kept_levels.cache_clear()
    shown = find_character(character, beside)
    return moved_levels(shown.levels(size_px), shown.geometry, movement)
