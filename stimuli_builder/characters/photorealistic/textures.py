"""Write a face's textures as the PNG files the renderer reads."""

from pathlib import Path

import cv2
import numpy as np

from experiments.errors import InputError
from stimuli_builder.characters.colour import linear_to_srgb
from stimuli_builder.characters.photorealistic.eye_texture import eye_maps
from stimuli_builder.characters.photorealistic.noise import Field, Plane
from stimuli_builder.characters.photorealistic.parameters import Face
from stimuli_builder.characters.photorealistic.skin_texture import skin_maps

SKIN_PX_PER_MM = 16
# Heights are stored as 16-bit shares of a span of 1 mm that begins 0.6 mm below the mean skin.
HEIGHT_OFFSET_MM, HEIGHT_SPAN_MM = 0.6, 1.0


def write_textures(folder: Path, face: Face, px_per_mm: int = SKIN_PX_PER_MM) -> None:
    """Draw skin and eye textures of a face into `folder`."""
    folder.mkdir(parents=True, exist_ok=True)
    skin = skin_maps(Plane(px_per_mm, face.seed), face.skin)
    _write_png(folder / "skin_colour.png", linear_to_srgb(skin.albedo))
    _write_png(folder / "skin_height.png", _as_16_bit((skin.height_mm + HEIGHT_OFFSET_MM) / HEIGHT_SPAN_MM))
    _write_png(folder / "skin_roughness.png", (skin.roughness * 255).astype(np.uint8))
    colour, height = eye_maps(face.iris, face.seed)
    _write_png(folder / "eye_colour.png", linear_to_srgb(colour))
    _write_png(folder / "eye_height.png", _as_16_bit(height))


def _as_16_bit(share: Field) -> np.ndarray:
    return (np.clip(share, 0, 1) * 65535).astype(np.uint16)


def _write_png(file: Path, image: np.ndarray) -> None:
    """Rows are turned over: texture coordinate v = 0 is the lowest row, a PNG begins with the highest."""
    upright = image[::-1]
    if upright.ndim == 3:
        upright = upright[..., ::-1]
    if not cv2.imwrite(str(file), np.ascontiguousarray(upright)):
        raise InputError(f"cannot write {file}: is the disk full?")
