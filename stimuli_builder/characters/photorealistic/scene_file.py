"""The scene of one pose as plain arrays in an .npz, so that the renderer needs nothing of this package.

The file holds `header` (JSON: parts with kind, name, material, place and tilt) and each part's arrays under
`<index>_<field>`. The renderer (cycles_worker.py) runs in an environment of its own, with Blender's numpy.
"""

import json
from pathlib import Path
from typing import Any

import numpy as np

from stimuli_builder.characters.photorealistic import anatomy
from stimuli_builder.characters.photorealistic.eyeball import Mesh, cornea, eyeball, flesh, tear_film
from stimuli_builder.characters.photorealistic.eyelid_skin import LidPose, build_skin
from stimuli_builder.characters.photorealistic.hair import Strand, brow, lashes
from stimuli_builder.characters.photorealistic.parameters import Face

CONVERGENCE_DEGREES = 1.0


class _Scene:
    def __init__(self) -> None:
        self.parts: list[dict[str, Any]] = []
        self.arrays: dict[str, Any] = {}

    def add_mesh(
        self,
        name: str,
        material: str,
        mesh: Mesh,
        place: tuple[float, float, float] = (0, 0, 0),
        turn: float = 0.0,
    ) -> None:
        """Add a mesh; `turn` is degrees about the vertical axis."""
        arrays = {"vertices": mesh.vertices.astype(np.float32), "quads": mesh.quads.astype(np.int32)}
        if mesh.uv is not None:
            arrays["uv"] = mesh.uv.astype(np.float32)
        arrays |= {f"value_{key}": value.astype(np.float32) for key, value in mesh.values.items()}
        self._add("mesh", name, material, arrays, place=place, turn=turn)

    def add_hair(self, name: str, material: str, strands: list[Strand]) -> None:
        """Add hairs that all have the same number of points."""
        if strands:
            points = np.stack([strand[0] for strand in strands]).astype(np.float32)
            self._add(
                "hair",
                name,
                material,
                {"points": points, "radii": np.array([s[1] for s in strands], np.float32)},
            )

    def _add(self, kind: str, name: str, material: str, arrays: dict[str, Any], **more: Any) -> None:
        index = len(self.parts)
        fields = sorted(arrays)
        self.parts.append({"kind": kind, "name": name, "material": material, "fields": fields, **more})
        self.arrays |= {f"{index}_{field}": array for field, array in arrays.items()}


def write_scene(file: Path, face: Face, pose: LidPose) -> None:
    """Build every mesh and hair of a pose and write them."""
    scene = _Scene()
    skin = build_skin(pose)
    values = {"margin": skin.margin, "upper": skin.upper}
    scene.add_mesh("skin", "skin", Mesh(skin.vertices, skin.quads, skin.uv, values))
    ball, cap = eyeball(), cornea()
    for side in (-1, 1):
        place = (side * anatomy.EYE_X_MM, 0.0, 0.0)
        scene.add_mesh("eye", "eye", ball, place, -side * CONVERGENCE_DEGREES)
        scene.add_mesh("cornea", "cornea", cap, place, -side * CONVERGENCE_DEGREES)
        for mesh, at in flesh(side, face.seed + 3 + side):
            scene.add_mesh("flesh", "flesh", mesh, at)
        if pose.closure < 0.95:
            scene.add_mesh("tear", "tear", tear_film(skin.edges, side))
        upper, lower = lashes(skin.edges, side, face.hair, face.seed + 3 + side)
        scene.add_hair("upper_lashes", "lash", upper)
        scene.add_hair("lower_lashes", "lash", lower)
        scene.add_hair("brow", "brow", brow(side, face.hair, face.seed + 8 + side))
    header = np.frombuffer(json.dumps(scene.parts).encode(), dtype=np.uint8)
    np.savez(file, header=header, **scene.arrays)
