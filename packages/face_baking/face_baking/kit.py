"""ICT-FaceKit as arrays: a head's vertices, faces, identity modes and the expressions that a blink uses.

The geometry never ships with Palpebra: users name their own copy, the kit's OBJ files or a packed .npz.
Source: Li et al. 2020, "Learning Formation of Physically-Based Face Attributes", CVPR; MIT license.
"""

import hashlib
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from experiments.errors import InputError
from face_baking.kit_obj import MISSING, read_obj_kit

Array = NDArray[np.float64]
Index = NDArray[np.int64]
PACKED_FILE = "ict_facekit.npz"
VERTICES, FACES, SKIN_FACES, RIM_FACES = 26719, 26384, 11144, 9230
"""Vertices and faces of the whole kit; faces of face, head and neck; faces whose border is the lids' rim."""
MODES = 40
"""Identity modes used: the first of the kit's, by the variance they explain."""
EXPRESSIONS = tuple(
    f"{name}_{side}" for name in ("eyeBlink", "eyeSquint", "cheekSquint", "browDown") for side in "LR"
)
EYEBALLS = {1: (21451, 22221), -1: (23021, 23791)}
"""Vertices of sclera and cornea by side: 1 is the person's left."""


@dataclass(frozen=True, eq=False)
class FaceKit:
    """The part of the kit that faces are made of.

    Attributes
    ----------
    neutral : float64 array (26719, 3)
        Vertices of the mean face, cm.
    faces : int64 array (26384, 4)
        Corners; a triangle has -1 last.
    modes : float64 array (40, 26719, 3)
        Displacement for one standard deviation of each identity mode, cm.
    expressions : mapping
        Displacement (26719, 3) of each of `EXPRESSIONS` at weight 1, cm.
    landmarks : int64 array (68,)
        Vertex of each Multi-PIE landmark.
    """

    neutral: Array
    faces: Index
    modes: Array
    expressions: Mapping[str, Array]
    landmarks: Index

    @cached_property
    def fingerprint(self) -> str:
        """SHA-256 of the geometry to a micrometre: OBJ files and their packed copy have nearly always one."""
        digest = hashlib.sha256(np.round(self.neutral, 3).astype(np.float32).tobytes())
        digest.update(self.faces.astype(np.int32).tobytes())
        return digest.hexdigest()

    @cached_property
    def edges(self) -> Index:
        """(n, 2) edges of the face's mesh without head and neck, each once."""
        return np.asarray(np.unique(np.sort(self._corner_pairs, axis=1), axis=0))

    @cached_property
    def rim(self) -> Index:
        """Vertices on the border of the face's mesh, those round the eyes among them."""
        pairs, counts = np.unique(np.sort(self._corner_pairs, axis=1), axis=0, return_counts=True)
        return np.asarray(np.unique(pairs[counts == 1]))

    @cached_property
    def _corner_pairs(self) -> Index:
        narrow = self.faces[:RIM_FACES]
        last = np.where(narrow[:, 3] >= 0, narrow[:, 3], narrow[:, 2])
        around = np.stack([narrow[:, 0], narrow[:, 1], narrow[:, 2], last], -1)
        pairs = np.concatenate([around[:, [k, (k + 1) % 4]] for k in range(4)])
        return np.asarray(pairs[pairs[:, 0] != pairs[:, 1]])


def load_facekit(folder: Path) -> FaceKit:
    """Read the kit from a folder (packed, or the kit's OBJ files) or from a packed file.

    Raises
    ------
    InputError
        There is no kit, it is not the whole of it, or it is another mesh.
    """
    packed = folder if folder.suffix == ".npz" else folder / PACKED_FILE
    if packed.is_file():
        kit = _read_packed(packed)
    elif folder.is_dir():
        kit = _kit(folder, *read_obj_kit(folder, EXPRESSIONS, MODES))
    else:
        raise InputError(f"{folder}: {MISSING}")
    return kit


def _read_packed(file: Path) -> FaceKit:
    try:
        with file.open("rb") as content, np.load(content) as stored:
            neutral = stored["neutral"].astype(np.float64)
            faces, landmarks = stored["faces"].astype(np.int64), stored["landmarks68"].astype(np.int64)
            names = [str(name) for name in stored["expression_names"]]
            start, vertex = stored["expression_start"], stored["expression_vertex"].astype(np.int64)
            value, scale = stored["expression_value"], stored["expression_scale"]
            modes = stored["identity_value"][:MODES].astype(np.float64)
            modes *= stored["identity_scale"][:MODES, None, None]
    except KeyError as error:
        raise InputError(
            f"{file}: the packed face kit lacks an array ({error.args[0]}); pack it again"
        ) from error
    except (OSError, ValueError, zipfile.BadZipFile) as error:
        raise InputError(f"{file}: expected a packed face kit (.npz), got another kind of file") from error
    expressions = {}
    for name in EXPRESSIONS:
        if name not in names:
            raise InputError(f"{file}: the packed face kit lacks the expression {name}; pack the whole kit")
        k = names.index(name)
        span = slice(int(start[k]), int(start[k + 1]))
        expressions[name] = np.zeros_like(neutral)
        expressions[name][vertex[span]] = value[span].astype(np.float64) * float(scale[k])
    return _kit(file, neutral, faces, modes, expressions, landmarks)


def _kit(
    folder: Path,
    neutral: Array,
    faces: Index,
    modes: Array,
    expressions: Mapping[str, Array],
    landmarks: Index,
) -> FaceKit:
    """The kit, once its sizes are those that the vertex numbers of this package mean."""
    if neutral.shape != (VERTICES, 3) or faces.shape != (FACES, 4):
        raise InputError(
            f"{folder}: expected ICT-FaceKit's {VERTICES} vertices and {FACES} faces, got "
            f"{len(neutral)} and {len(faces)}; use 'ICT Face Model Light' unchanged"
        )
    if modes.shape != (MODES, VERTICES, 3):
        raise InputError(
            f"{folder}: expected {MODES} identity modes of that mesh, got {len(modes)}; use the whole kit"
        )
    if len(landmarks) != 68 or not (landmarks.min() >= 0 and landmarks.max() < VERTICES):
        raise InputError(f"{folder}: expected 68 landmark vertices, got {len(landmarks)}; use the whole kit")
    if not np.isfinite(neutral).all():
        raise InputError(f"{folder}: the kit's mesh has non-finite numbers; use the unchanged kit")
    return FaceKit(neutral, faces, modes, expressions, landmarks)
