"""Write a character's folder: pictures first, the declaration last, so a half-written one never loads."""

import hashlib
from io import BytesIO
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from experiments.files import whole_file
from stimuli_builder.characters.declaration import (
    DECLARATION_FILE,
    Declaration,
    Level,
    LowerLid,
    LowerLidPose,
    Picture,
    PictureOrFrame,
    declaration_toml,
)


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


# The smallest character there can be: what a lab with its own pictures writes (docs/how-to/own-character.md).

WIDTH, HEIGHT = 48, 24
CROP = (4, 4, 40, 16)
CLOSURES = (0.0, 0.25, 0.5, 1.0)


def draw_crop(closure: float, lift: int = 0) -> NDArray[np.uint8]:
    """Gray skin with one dark eye: the lid covers it from above, the lower lid lifts by whole pixels."""
    image = np.full((CROP[3], CROP[2], 3), 180, np.uint8)
    top = 2 + round(12 * closure)
    image[top : 14 - lift, 8:32] = (40, 60, 90)
    return image


def write_example_character(folder: Path, lower_lid: bool = True) -> Path:
    """Draw a 48 x 24 px character of four levels (2 x 3 lower-lid poses if wished) and return its folder."""
    levels = [
        Level(closure=w, **write_picture(folder, f"level_{w:.2f}.webp", draw_crop(w)).model_dump())
        for w in CLOSURES
    ]
    frame = np.full((HEIGHT, WIDTH, 3), 180, np.uint8)
    frame[CROP[1] : CROP[1] + CROP[3], CROP[0] : CROP[0] + CROP[2]] = draw_crop(0.0)
    layer = None
    if lower_lid:
        poses = [
            LowerLidPose(
                vertical_mm=v,
                horizontal_mm=h,
                **write_picture(folder, f"pose_{v}_{h}.webp", draw_crop(0.0, int(4 * v))).model_dump(),
            )
            for v in (0.0, 0.5, 1.0)
            for h in (0.0, 1.0)
        ]
        covered = [(w, np.full((CROP[3], CROP[2]), round(255 * w), np.uint8)) for w in (0.0, 1.0)]
        mattes = [
            Level(closure=w, **write_picture(folder, f"matte_{w}.webp", m).model_dump()) for w, m in covered
        ]
        layer = LowerLid(crop=CROP, poses=tuple(poses), mattes=tuple(mattes))
    declaration = Declaration(
        name="tiny",
        label="Tiny test character",
        size_px=(WIDTH, HEIGHT),
        px_per_mm=1.5,
        inter_ocular_mm=16.0,
        opening_mm=8.0,
        crop=CROP,
        base=PictureOrFrame(**write_picture(folder, "open.webp", frame).model_dump()),
        levels=tuple(levels),
        lower_lid=layer,
        provenance={"command": "tests", "versions": {"numpy": "2"}, "samples": 3},
    )
    write_declaration(folder, declaration)
    return folder
