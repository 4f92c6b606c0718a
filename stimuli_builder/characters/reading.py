"""Reading a character's pictures: as they were declared, or one clear line."""

import hashlib
from collections.abc import Sequence
from io import BytesIO
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError

from experiments.errors import InputError
from stimuli_builder.characters.declaration import REPAIR, Picture


def decode_picture(folder: Path, picture: Picture, size: Sequence[int], what: str) -> NDArray[np.uint8]:
    """(h, w, 3) sRGB code values of one picture; InputError where missing, damaged or the wrong size."""
    content = declared_bytes(folder, picture, what)
    try:
        image = Image.open(BytesIO(content)).convert("RGB")
    except (OSError, UnidentifiedImageError, ValueError) as error:
        raise InputError(f"{what} is damaged: cannot decode {picture.file}; {REPAIR}") from error
    if image.size != tuple(size):
        declared = " x ".join(str(n) for n in size)
        raise InputError(
            f"{what}: {picture.file} is {image.width} x {image.height} px, "
            f"the declaration asks for {declared} px"
        )
    return np.asarray(image, dtype=np.uint8)


def declared_bytes(folder: Path, picture: Picture, what: str) -> bytes:
    """Content of one declared file; InputError where it is missing or another than declared."""
    try:
        content = (folder / picture.file).read_bytes()
    except FileNotFoundError as error:
        raise InputError(f"{what} is missing: no {picture.file} in {folder}; {REPAIR}") from error
    except OSError as error:
        raise InputError(f"{what} is damaged: cannot decode {picture.file}; {REPAIR}") from error
    if picture.sha256 is not None and hashlib.sha256(content).hexdigest() != picture.sha256:
        raise InputError(f"{what} is damaged: {picture.file} does not match its declared sha256; {REPAIR}")
    return content


def slices(crop: tuple[int, int, int, int]) -> tuple[slice, slice]:
    """Rows and columns of an (x, y, width, height) box."""
    x, y, width, height = crop
    return slice(y, y + height), slice(x, x + width)
