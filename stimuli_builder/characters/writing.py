"""Write a character's folder: pictures first, the declaration last, so a half-written one never loads."""

import hashlib
from io import BytesIO
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from experiments.files import whole_file
from stimuli_builder.characters.declaration import DECLARATION_FILE, Declaration, Picture, declaration_toml


def write_bytes(file: Path, content: bytes) -> None:
    """Write a file whole, in a folder that is made where it is not there."""
    file.parent.mkdir(parents=True, exist_ok=True)
    with whole_file(file) as temporary:
        temporary.write_bytes(content)


def write_picture(folder: Path, file: str, image: NDArray[np.uint8]) -> Picture:
    """Write (h, w, 3) or (h, w) code values as lossless WebP; return what the declaration says of it."""
    buffer = BytesIO()
    Image.fromarray(image).convert("RGB").save(buffer, "WEBP", lossless=True, quality=90, method=4)
    return write_bytes_declared(folder, file, buffer.getvalue())


def write_bytes_declared(folder: Path, file: str, content: bytes) -> Picture:
    """Write a file of the atlas; return what the declaration says of it."""
    write_bytes(folder / file, content)
    return Picture(file=file, sha256=hashlib.sha256(content).hexdigest())


def write_declaration(folder: Path, declaration: Declaration) -> None:
    """Write `character.toml`, which makes the folder a character."""
    write_bytes(folder / DECLARATION_FILE, declaration_toml(declaration).encode())
