"""One clip to be rendered: all that decides its bytes, the hash of that, and the rendering itself."""

import hashlib
import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from stimuli_builder.blinks.profile import PROFILE_FPS
from stimuli_builder.clips.curves import ClipCurve
from stimuli_builder.clips.geometry import AS_BAKED, Movement
from stimuli_builder.clips.life import LIFE_VERSION, draw_life

if TYPE_CHECKING:
    from stimuli_builder.clips.levels import LevelSet


RENDER_VERSION = 2
"""Raise this when the same inputs come to give other pictures; every clip is then built again."""


@dataclass(frozen=True)
class Look:
    """How a clip is rendered, apart from what moves in it.

    `character` is a name or a folder; `beside` the folder it may be relative to. `fingerprint` is the
    SHA-256 of all its pictures, `encoder` names the encoder and its settings, `movement` what of the face
    moves in addition to what those pictures show, `life` how strong the motion between blinks is.
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
    life: float = 0.0

    def hashed(self) -> dict[str, Any]:
        """What of it decides a clip's bytes, as JSON data; paths do not count, nor what is not declared."""
        values = asdict(self) | {"beside": None, "character": None}
        if not self.movement.declared:
            del values["movement"]
        if not self.life:
            del values["life"]
        return values

    def levels(self) -> "LevelSet":
        """The character's levels as they move, kept for the next clip."""

        from stimuli_builder.clips.face_movement import kept_levels

        return kept_levels(self.character, self.fingerprint, self.size_px, self.beside, self.movement)


@dataclass(frozen=True)
class ClipJob:
    """A clip to render."""

    look: Look
    curve: ClipCurve
    life_seed: int = 0

    @property
    def frames(self) -> int:
        """Number of frames of the clip."""
        return int(len(self.curve.closure) * self.look.fps / PROFILE_FPS + 1e-9)

    @property
    def input_hash(self) -> str:
        """SHA-256 over everything that decides the clip's bytes; paths do not count."""
        look = self.look.hashed() | {"render_version": RENDER_VERSION}
        if self.look.life:
            look |= {"life_seed": self.life_seed, "life_version": LIFE_VERSION}
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
    life = draw_life(len(job.curve.closure), look.life, job.life_seed) if look.life else None
    frames = painter.frames(job.curve, look.fps, look.motion_blur, look.barcode, life)
    return encode_clip(frames, look.size_px, look.fps)
