"""ICT-FaceKit from its own OBJ files, as its repository holds them."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.errors import InputError

MISSING = (
    "there is no face kit: expected ict_facekit.npz or ICT-FaceKit's FaceXModel folder "
    "(generic_neutral_mesh.obj and its shapes, see docs/explanation/characters.md)"
)
NEUTRAL_FILE, INDEX_FILE = "generic_neutral_mesh.obj", "vertex_indices.json"


def read_obj_kit(
    folder: Path, expressions: Sequence[str], modes: int
) -> tuple[Any, Any, Any, dict[str, Any], Any]:
    """Neutral vertices, faces, identity displacements, expression displacements and landmark vertices."""
    model = folder / "FaceXModel" if (folder / "FaceXModel").is_dir() else folder
    if not (model / NEUTRAL_FILE).is_file():
        raise InputError(f"{folder}: {MISSING}")
    neutral = _vertices(model / NEUTRAL_FILE)
    moved = np.empty((modes, *neutral.shape))
    for k in range(modes):
        moved[k] = _displacement(model / f"identity{k:03d}.obj", neutral)
    shapes = {name: _displacement(model / f"{name}.obj", neutral) for name in expressions}
    return neutral, _faces(model / NEUTRAL_FILE), moved, shapes, _landmarks(model / INDEX_FILE)


def _displacement(file: Path, neutral: NDArray[np.float64]) -> NDArray[np.float64]:
    shape = _vertices(file)
    if shape.shape != neutral.shape:
        raise InputError(
            f"{file}: expected {len(neutral)} vertices like {NEUTRAL_FILE}, got {len(shape)}; "
            "use the kit unchanged"
        )
    return shape - neutral


def _vertices(file: Path) -> NDArray[np.float64]:
    rows = [line[2:].split()[:3] for line in _content(file).split(b"\n") if line.startswith(b"v ")]
    try:
        return np.array(rows, dtype=np.float64).reshape(len(rows), 3)
    except ValueError as error:
        raise InputError(
            f"{file}: expected OBJ vertices of three numbers, got others; copy it again"
        ) from error


def _faces(file: Path) -> NDArray[np.int64]:
    rows = []
    for line in _content(file).split(b"\n"):
        if line.startswith(b"f "):
            corners = [int(corner.split(b"/")[0]) - 1 for corner in line.split()[1:]]
            rows.append([*corners, -1][:4])
    return np.array(rows, dtype=np.int64).reshape(-1, 4)


def _landmarks(file: Path) -> NDArray[np.int64]:
    try:
        return np.array(json.loads(_content(file))["idx_to_landmark_verts"], dtype=np.int64)
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(f"{file}: expected the kit's landmark vertices, got none; copy it again") from error


def _content(file: Path) -> bytes:
    try:
        return file.read_bytes()
    except OSError as error:
        raise InputError(
            f"{file}: the face kit is incomplete because this file cannot be read; copy the whole kit"
        ) from error
