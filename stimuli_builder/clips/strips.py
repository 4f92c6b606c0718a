"""A character at closures from open to shut, one picture below the other, for the dashboard's blinks page.

The dashboard may not draw characters itself (docs/architecture.md), so it is given these files.
"""

import json
from collections.abc import Sequence
from io import BytesIO
from pathlib import Path

import numpy as np
from PIL import Image

from stimuli_builder.characters.writing import write_bytes
from stimuli_builder.clips.characters import find_character, geometry, shipped_names

STRIPS_FILE = "strips.json"
STEPS = 33
SIZE_PX = (480, 180)
QUALITY = 72


def strip(character: str, size_px: tuple[int, int] = SIZE_PX, steps: int = STEPS) -> bytes:
    """WebP of `steps` frames, closure 0 at the top to 1 at the bottom in equal steps."""
    levels = find_character(character).levels(size_px)
    frames = [levels.picture(float(closure)) for closure in np.linspace(0.0, 1.0, steps)]
    buffer = BytesIO()
    Image.fromarray(np.vstack(frames)).save(buffer, "WEBP", quality=QUALITY, method=4)
    return buffer.getvalue()


def strip_names(names: Sequence[str] = ()) -> tuple[str, ...]:
    """Characters, of the shipped ones or of `names`, whose whole frame has a strip's shape.

    A face from forehead to chin is left out: cut to a strip it would show what its eyes' character does.
    """
    shape = SIZE_PX[1] / SIZE_PX[0]
    sizes = {name: geometry(name).size_px for name in names or shipped_names()}
    return tuple(name for name, (width, height) in sizes.items() if height / width < 1.1 * shape)


def write_strips(folder: Path, characters: Sequence[str] = ()) -> list[tuple[str, int]]:
    """Write `NAME.webp` of each character (of `strip_names` where none is named) and, last, `strips.json`.

    Returns name and bytes of each.
    """
    written = []
    for name in characters or strip_names():
        content = strip(name)
        write_bytes(folder / f"{name}.webp", content)
        written.append((name, len(content)))
    declared = {
        "width_px": SIZE_PX[0],
        "height_px": SIZE_PX[1],
        "closures": np.linspace(0.0, 1.0, STEPS).tolist(),
        "characters": [name for name, _ in written],
    }
    write_bytes(folder / STRIPS_FILE, (json.dumps(declared, indent=2) + "\n").encode())
    return written
