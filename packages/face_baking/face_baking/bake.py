"""Bake a face: render what is missing, coarse to fine, and write an atlas whenever a generation is whole."""

import hashlib
import platform
import sys
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cached_property
from importlib.metadata import version
from pathlib import Path
from typing import Any

from experiments.errors import InputError
from experiments.files import says_full
from face_baking.assembly import Assembly
from face_baking.development import LENS_PX
from face_baking.environment import BPY_VERSION, ensure_blender
from face_baking.identity import Identity
from face_baking.kit import FaceKit
from face_baking.plan import (
    LEVEL_COUNTS,
    LOWER_LID_AFTER,
    Samples,
    closures_of,
    frame_shot,
    level_shots,
    lower_lid_shots,
)
from face_baking.renderer import Renderer, Setup, Shot, load_light
from face_baking.scene import FaceScene

# Raise when geometry, textures, materials, lights, lens or a framing change: work of others is not resumed.
RECIPE = 38
NOTICE = "Rendered from ICT-FaceKit geometry, (c) 2020 USC Institute for Creative Technologies, MIT licence"


def character_name(face: str, framing: str, version: int = 1) -> str:
    """Name of the character that a framing of a face makes: `alder`, `alder-face`, or `alder@2`."""
    framed = face if framing == "eyes" else f"{face}-{framing}"
    return framed if version == 1 else f"{framed}@{version}"


@dataclass(frozen=True)
class FaceOrder:
    """What to bake and where; `work` keeps rendered shots so that a stopped bake goes on.

    Of the atlas's `levels`, `rendered` are rendered and the others moved in between; `denser_ends` renders as
    many again in the first and the last eighth.
    """

    name: str
    identity: Identity
    framing: str
    size_px: tuple[int, int]
    levels: int
    rendered: int
    samples: Samples
    lower_lid: bool
    light: str
    out: Path
    work: Path
    blender: Path
    device: str
    threads: int
    denser_ends: bool = False
    seed: int | None = None
    """The number that drew the face whole; None for one of the identities file."""
    version: int = 1
    """Counts the bakes of a face that were given to others."""

    @property
    def character(self) -> str:
        """Name of the character."""
        return character_name(self.name, self.framing, self.version)

    def work_folder(self, kit: FaceKit) -> Path:
        """Folder of this face's shots: another face, size, quality, kit or recipe has another."""
        key = f"{self.identity.model_dump_json()} {self.framing} {self.size_px} {self.samples} {self.light}"
        key += f" {load_light(self.light)} {kit.fingerprint} {RECIPE}"
        digest = hashlib.sha256(key.encode())
        return self.work / f"face-{self.name}-{digest.hexdigest()[:10]}"


class FaceBake:
    """One bake: its scene, the shots it needs and the atlas they make."""

    def __init__(self, order: FaceOrder, kit: FaceKit) -> None:
        self.order, self.kit, self.work = order, kit, order.work_folder(kit)

    @cached_property
    def scene(self) -> FaceScene:
        """The face's geometry."""
        return FaceScene(self.kit, self.order.identity, self.order.framing, self.order.size_px)

    @cached_property
    def frame(self) -> Shot:
        """The still frame's shot."""
        return frame_shot(self.work, self.order.size_px, self.order.samples)

    @cached_property
    def levels(self) -> list[Shot]:
        """The levels' shots, in the order of rendering."""
        order = self.order
        lids = self.scene.lid_boxes
        return level_shots(
            self.work, self.scene.boxes, order.samples, order.rendered, order.denser_ends, lids
        )

    @cached_property
    def lower(self) -> list[Shot]:
        """The shots of the lower lid's poses; none if it was not asked for."""
        if not self.order.lower_lid:
            return []
        return lower_lid_shots(self.work, self.scene.lower_lid_boxes, self.order.samples)

    @property
    def shots(self) -> list[Shot]:
        """Every shot in the order of rendering; the lower lid follows the ninth level."""
        first = [self.frame, *self.levels]
        return [*first[:LOWER_LID_AFTER], *self.lower, *first[LOWER_LID_AFTER:]]

    def run(self, report: Callable[[int, int, str], None]) -> None:
        """Render what is missing and write the atlas; `report(done, total, what)` after each shot.

        Raises
        ------
        InputError
            Blender cannot be had or failed, or the disk is full; what is rendered stays.
        """
        try:
            self.work.mkdir(parents=True, exist_ok=True)
            missing = [shot for shot in self.shots if not shot.file.exists()]
            report(len(self.shots) - len(missing), len(self.shots), "begin")
            if missing:
                self._render(missing, report)
            self.write()
        except (OSError, InputError) as error:
            if says_full(error):
                raise InputError(
                    f"the disk is full: free up space and bake again; rendered levels stay in {self.work}"
                ) from error
            raise

    def _render(self, missing: list[Shot], report: Callable[[int, int, str], None]) -> None:
        order = self.order
        python = ensure_blender(order.blender)
        setup = Setup(python, order.light, order.device, order.threads, self.work / "blender.log")
        done, whole = len(self.shots) - len(missing), self._whole_generation()
        with Renderer(self.scene, setup) as renderer:
            for shot in missing:
                renderer.render(shot)
                done += 1
                report(done, len(self.shots), f"{shot.file.stem} on {renderer.device}")
                if self._whole_generation() != whole:
                    whole = self._whole_generation()
                    self.write()

    def _whole_generation(self) -> int:
        """The most levels of an evenly spaced atlas whose every level is rendered."""
        have = set(self._rendered())
        return max((count for count in LEVEL_COUNTS if set(closures_of(count)) <= have), default=0)

    def _rendered(self) -> list[float]:
        return sorted(shot.pose.closure for shot in self.levels if shot.file.exists())

    def write(self) -> None:
        """Write the character from what is rendered; levels in between are moved, at most seven to a step.

        Raises
        ------
        InputError
            Not even the still frame and both ends are rendered.
        """
        rendered = self._rendered()
        if not self.frame.file.exists() or not {0.0, 1.0} <= set(rendered):
            raise InputError(
                "nothing to write: the still frame, the open and the closed level are not all in "
                f"{self.work}; bake them first"
            )
        bound = min(self.order.levels, 8 * (self._whole_generation() - 1) + 1)
        count = max(count for count in LEVEL_COUNTS if count <= bound)
        grid = set(closures_of(count))
        used = [closure for closure in rendered if closure in grid]
        assembly = Assembly(self.scene, self.frame, self.levels, self.lower, used)
        order = self.order
        assembly.write(order.out, order.character, count, self._provenance(count, used), order.version)

    def _provenance(self, levels: int, rendered: list[float]) -> dict[str, Any]:
        order, width, height = self.order, *self.order.size_px
        ends = " --denser-ends" if order.denser_ends else ""
        lids = f" --lid-samples {order.samples.lids}" if order.samples.lids else ""
        again = f" --version {order.version}" if order.version > 1 else ""
        face = f"--identity {order.name}" if order.seed is None else f"--seed {order.seed}"
        return {
            "command": f"stimuli bake face {face} --framing {order.framing} "
            f"--size {width}x{height} --levels {levels} --rendered {order.rendered}{ends} "
            f"--samples {order.samples.boxes} --frame-samples {order.samples.frame}{lids} "
            f"--light {order.light}{again}",
            "geometry": NOTICE,
            "recipe": RECIPE,
            "rendered_levels": len(rendered),
            "rendered_closures": rendered,
            "samples": order.samples.boxes,
            "frame_samples": order.samples.frame,
            "lid_samples": order.samples.lids or order.samples.boxes,
            "lens_px": LENS_PX,
            "moved_mm_at_closure_1": {k: round(v, 3) for k, v in self.scene.movement_mm().items()},
            "versions": {"palpebra": version("palpebra"), "bpy": BPY_VERSION, "numpy": version("numpy")},
            "platform": f"{sys.platform} {platform.machine()}",
            "date": datetime.now(UTC).date().isoformat(),
            "face": order.identity.model_dump(mode="json"),
        }
