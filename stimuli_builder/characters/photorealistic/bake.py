"""Bake a face: render what is missing, coarse to fine, and write an atlas after every generation."""

import hashlib
import platform
import sys
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

from experiments.errors import InputError
from stimuli_builder.characters.photorealistic.assembly import Assembly
from stimuli_builder.characters.photorealistic.environment import BPY_VERSION, ensure_blender
from stimuli_builder.characters.photorealistic.framing import Frame
from stimuli_builder.characters.photorealistic.parameters import Face
from stimuli_builder.characters.photorealistic.plan import Quality, stages
from stimuli_builder.characters.photorealistic.renderer import Renderer, describe
from stimuli_builder.characters.photorealistic.textures import write_textures

# Raise when geometry, textures, materials or lights change: work of another recipe is not resumed.
RECIPE = 1


@dataclass(frozen=True)
class BakeOrder:
    """What to bake and where; `work` keeps rendered shots so that a stopped bake goes on.

    Of the atlas's `levels`, `rendered` are rendered and the others moved between them (inbetween.py).
    """

    name: str
    face: Face
    frame: Frame
    levels: int
    rendered: int
    quality: Quality
    out: Path
    work: Path
    blender: Path
    threads: int

    def work_folder(self) -> Path:
        """Folder of this face's shots: another face, size, quality or recipe has another."""
        key = f"{describe(self.face)} {self.frame} {self.quality} {RECIPE}"
        return self.work / f"{self.name}-{hashlib.sha256(key.encode()).hexdigest()[:10]}"


def bake(order: BakeOrder, report: Callable[[int, int, str], None]) -> None:
    """Render and write the atlas; `report(done, total, what)` is called after each shot.

    Shots that are already there are not rendered again, whatever stopped the last bake.
    """
    work = order.work_folder()
    work.mkdir(parents=True, exist_ok=True)
    todo = stages(work, order.frame, order.quality, order.rendered)
    total = sum(len(stage.shots) for stage in todo)
    done = sum(shot.file.exists() for stage in todo for shot in stage.shots)
    report(done, total, "begin")
    if done == total:
        write_atlas(order)
        return
    python = ensure_blender(order.blender)
    _ensure_textures(work / "textures", order.face)
    with Renderer(
        python, order.face, order.frame, work / "textures", work / "blender.log", order.threads
    ) as renderer:
        for stage in todo:
            missing = [shot for shot in stage.shots if not shot.file.exists()]
            for shot in missing:
                renderer.render(shot)
                done += 1
                report(done, total, shot.file.stem)
            if missing or stage is todo[-1]:
                write_atlas(order, (stage.levels - 1) * _between(order) + 1)


def _between(order: BakeOrder) -> int:
    return (order.levels - 1) // (order.rendered - 1)


def write_atlas(order: BakeOrder, levels: int | None = None) -> None:
    """Write the character from the shots that are there; levels not rendered yet are moved in between.

    Raises
    ------
    InputError
        Not even the still frame and both end levels are rendered.
    """
    assembly = Assembly(order.work_folder(), order.face, order.frame, order.quality)
    count = levels or order.levels
    rendered = assembly.rendered(count)
    if not {0.0, 1.0} <= set(rendered):
        raise InputError(f"nothing to write: the open and the closed level are not in {order.work_folder()}")
    assembly.write(order.out, order.name, count, _provenance(order, count, rendered))


def _ensure_textures(folder: Path, face: Face) -> None:
    finished = folder / "finished"
    if not finished.exists():
        write_textures(folder, face)
        finished.touch()


def _provenance(order: BakeOrder, levels: int, rendered: list[float]) -> dict[str, Any]:
    size = f"{order.frame.width_px}x{order.frame.height_px}"
    return {
        "command": f"stimuli bake photorealistic --preset {order.name} --levels {levels} "
        f"--rendered {order.rendered} --size {size} --samples {order.quality.crop_samples} "
        f"--frame-samples {order.quality.frame_samples}",
        "recipe": RECIPE,
        "rendered_levels": len(rendered),
        "rendered_closures": rendered,
        "samples": order.quality.crop_samples,
        "frame_samples": order.quality.frame_samples,
        "versions": {
            "palpebra": version("palpebra"),
            "bpy": BPY_VERSION,
            "numpy": version("numpy"),
            "scipy": version("scipy"),
            "pillow": version("pillow"),
            "python": platform.python_version(),
        },
        "platform": f"{sys.platform} {platform.machine()}",
        "date": datetime.now(UTC).date().isoformat(),
        "face": order.face.model_dump(mode="json"),
    }
