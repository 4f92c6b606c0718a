"""One face's scene as plain arrays: what stays, and the positions of each closure.

The renderer (cycles_face_worker.py) runs in a separate environment with Blender's numpy, so it gets .npz
files: `header` (JSON: parts with kind, name, material and fields) and each part's arrays under
`<index>_<field>`.
"""

import json
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from face_baking.blink_path import BlinkPath
from face_baking.eye_texture import eye_maps, white_of
from face_baking.eyes import Mesh, corner_floor, eyeball, tear_line, wet_film
from face_baking.framing import FRAMINGS, Box, Framing, View
from face_baking.hair import Brow, Lashes, Strands
from face_baking.identity import Identity
from face_baking.kit import Array, FaceKit
from face_baking.lid_loops import SIDES
from face_baking.lid_pose import HORIZONTAL_MM, OPEN, SHUT, VERTICAL_MM, LidPose
from face_baking.lid_skin import FaceSkin, face_part, lid_skin
from face_baking.pigments import Pigments
from face_baking.subdivision import subdivide

SIDE_NAMES = {1: "left", -1: "right"}
MOVES_CM = 0.004
LIDS_MOVE_CM = 0.10
"""What moves farther is lid or lash: there noise is not the open eye's, and needs separate samples."""
MOVING = ("points", "vertices", "value_shade", "value_flush")
SMALL_WIDTH_PX = 480
"""Below this width a pixel is larger than the quads of one subdivision less."""
TEXTURE_SHARE = 1400 / 960
"""Width of the eye's texture over that of the picture: six texels to a pixel of the iris."""


@dataclass(frozen=True, eq=False)
class Part:
    """A mesh or a bunch of hair with its material."""

    name: str
    material: str
    shape: Mesh | Strands

    def arrays(self) -> dict[str, Any]:
        """Everything a renderer needs to build it."""
        if isinstance(self.shape, Strands):
            return {"points": _single(self.shape.points), "radii": _single(self.shape.radii)}
        out = {"vertices": _single(self.shape.vertices), "quads": self.shape.quads.astype(np.int32)}
        if self.shape.uv is not None:
            out["uv"] = _single(self.shape.uv)
        return out | {f"value_{name}": _single(value) for name, value in self.shape.values.items()}

    def moving(self) -> dict[str, Any]:
        """What differs from pose to pose; what lies on an eye's white does not turn with its gaze."""
        arrays = self.arrays()
        return {name: arrays[name] for name in MOVING if name in arrays}


class FaceScene:
    """One identity in one framing, posed at any closure."""

    def __init__(
        self, kit: FaceKit, identity: Identity, framing: str | Framing, size_px: tuple[int, int]
    ) -> None:
        self.identity = identity
        self.framing = FRAMINGS[framing] if isinstance(framing, str) else framing
        self.path = BlinkPath(kit, identity.rest(kit), identity.movement)
        self.strokes = lid_skin(self.path, identity).strokes
        levels = self.framing.levels - (size_px[0] < SMALL_WIDTH_PX)
        faces = face_part(kit, self.framing.low, self.framing.high)
        self.skin = FaceSkin(self.path, identity, subdivide(faces, levels), self.strokes)
        globes = self.path.globes
        self.view = View.of(self.framing, size_px, globes[1].centre, globes[-1].centre)
        self._brows = {side: Brow(self.skin, side) for side in SIDES}
        self._lashes = [
            (
                f"{'upper' if upper else 'lower'}_lashes_{SIDE_NAMES[side]}",
                Lashes(self.path, identity.hair, side, upper, identity.seed),
            )
            for side in SIDES
            for upper in (True, False)
        ]

    @cached_property
    def _values(self) -> dict[str, Array]:
        return Pigments(self.skin).values()

    def parts(self, pose: LidPose) -> list[Part]:
        """Every part in a pose, always in the same order, with what colors it."""
        first, *others = self.shapes(pose)
        skin = replace(first.shape, values=self._values) if isinstance(first.shape, Mesh) else first.shape
        return [replace(first, shape=skin), *others]

    def shapes(self, pose: LidPose) -> list[Part]:
        """The parts without the skin's colors."""
        strokes, coarse, posed = self.strokes_of(pose), self._coarse(pose), self.posed_skin(pose)
        parts = [Part("skin", "skin", Mesh(posed, self.skin.fine.quads))]
        melanin = self.identity.skin.melanin
        for side, name in SIDE_NAMES.items():
            stroke = strokes[side]
            parts += [
                Part(f"eye_{name}", "eye", eyeball(self.path, coarse, side, stroke)),
                *(
                    Part(
                        f"{end}_{name}", "eye", corner_floor(self.path, coarse, side, stroke, nasal, melanin)
                    )
                    for end, nasal in (("corner", True), ("temple", False))
                ),
                Part(f"film_{name}", "film", wet_film(self.path, side, stroke)),
                Part(f"tear_{name}", "tear", tear_line(self.path, coarse, side, stroke)),
                Part(f"brow_{name}", "brow", self._brows[side].at(posed)),
            ]
        return parts + [Part(name, "lash", row.at(coarse, strokes[row.side])) for name, row in self._lashes]

    def strokes_of(self, pose: LidPose) -> dict[int, float]:
        """The stroke of each side's lid."""
        return self.strokes.of(pose.closure)

    def posed_skin(self, pose: LidPose) -> Array:
        """(n, 3) vertices of the refined skin."""
        return self.skin.at_strokes(self.strokes_of(pose), self._lower_cm(pose))

    def _coarse(self, pose: LidPose) -> Array:
        return self.path.at(self.strokes_of(pose), self._lower_cm(pose))

    def _lower_cm(self, pose: LidPose) -> tuple[float, float]:
        return pose.vertical_mm / self.view.mm_per_cm, pose.horizontal_mm / self.view.mm_per_cm

    def write(self, file: Path, pose: LidPose) -> None:
        """Write the whole scene."""
        parts = self.parts(pose)
        self._write(file, parts, [part.arrays() for part in parts])

    def write_pose(self, file: Path, pose: LidPose) -> None:
        """Write the moving arrays alone."""
        parts = self.shapes(pose)
        self._write(file, parts, [part.moving() for part in parts])

    @staticmethod
    def _write(file: Path, parts: list[Part], content: list[dict[str, Any]]) -> None:
        header = [
            {
                "name": part.name,
                "material": part.material,
                "kind": "hair" if isinstance(part.shape, Strands) else "mesh",
                "fields": sorted(arrays),
            }
            for part, arrays in zip(parts, content, strict=True)
        ]
        named = {f"{k}_{field}": value for k, arrays in enumerate(content) for field, value in arrays.items()}
        np.savez(file, header=np.frombuffer(json.dumps(header).encode(), np.uint8), **named)

    def write_textures(self, file: Path) -> None:
        """Write the eye's maps: `colour` linear albedo, `height` in 0-1; lowest row first."""
        size = round(TEXTURE_SHARE * self.view.size_px[0])
        white = white_of(self.identity.skin.melanin)
        colour, height = eye_maps(self.identity.iris, self.identity.seed + 3, white, size)
        np.savez(file, colour=colour, height=height)

    @cached_property
    def boxes(self) -> dict[str, Box]:
        """What a blink changes in the picture, by side of the person."""
        return self._boxes_between(SHUT)

    @cached_property
    def lower_lid_boxes(self) -> dict[str, Box]:
        """What the lower lid's greatest movement changes, within `boxes`."""
        between = self._boxes_between(LidPose(0.0, VERTICAL_MM[-1], HORIZONTAL_MM[-1]))
        return {name: _overlap(box, self.boxes[name]) for name, box in between.items()}

    @cached_property
    def lid_boxes(self) -> dict[str, Box]:
        """What of `boxes` the lids and lashes pass over, by side of the person."""
        between = self._boxes_between(SHUT, LIDS_MOVE_CM)
        return {name: _overlap(box, self.boxes[name]) for name, box in between.items()}

    def _boxes_between(self, pose: LidPose, moves_cm: float = MOVES_CM) -> dict[str, Box]:
        before, after = self.shapes(OPEN), self.shapes(pose)
        out = {}
        for side, name in SIDE_NAMES.items():
            points = []
            for a, b in zip(before, after, strict=True):
                if a.material == "skin" or (a.material in ("lash", "brow") and a.name.endswith(name)):
                    # However little the lower lashes move, a box's rim must not cut them.
                    points.append(_moved_points(a, b, side, 0.0 if a.material == "lash" else moves_cm))
            out[name] = self.view.box_round(np.concatenate(points))
        return out

    @property
    def opening_mm(self) -> float:
        """Mean height of the open eyes at the pupils, in declared mm."""
        return float(np.mean(list(self.strokes.open_cm.values()))) * self.view.mm_per_cm

    def movement_mm(self) -> dict[str, float]:
        """The largest displacement of each named part of the face between open and shut, in declared mm."""
        at, rest, shut = self.skin.coordinates, self.skin.at(0.0), self.skin.at(1.0)
        moved = np.linalg.norm(shut - rest, axis=1) * self.view.mm_per_cm
        lower_edge = (at.upper < 0.5) & (np.abs(at.loop - 3) < 0.5) & (np.abs(at.azimuth) < 0.3)
        change = (shut - rest) * self.view.mm_per_cm
        far = at.loop > 13.5
        height = rest[:, 1] - self.path.globes[1].centre[1]
        return {
            "lower_lid_up": float(np.median(change[lower_edge, 1])),
            "lower_lid_nasal": float(np.median(-change[lower_edge, 0] * at.side[lower_edge])),
            "brow": float(moved[far & (height > 1.5)].max(initial=0.0)),
            "cheek": float(moved[far & (height < -1.0)].max(initial=0.0)),
        }


def _overlap(box: Box, other: Box) -> Box:
    left, top = max(box[0], other[0]), max(box[1], other[1])
    right = min(box[0] + box[2], other[0] + other[2])
    bottom = min(box[1] + box[3], other[1] + other[3])
    return left, top, right - left, bottom - top


def _moved_points(opened: Part, shut: Part, side: int, moves_cm: float) -> Array:
    key = "points" if isinstance(opened.shape, Strands) else "vertices"
    a, b = (part.arrays()[key].reshape(-1, 3).astype(np.float64) for part in (opened, shut))
    moved = (np.abs(a - b).max(1) > moves_cm) & (a[:, 0] * side > 0)
    return np.concatenate([a[moved], b[moved]])


def _single(values: Array) -> Any:
    return values.astype(np.float32)
