"""`stimuli bake samples`: pictures with labels, drawn by number, rendered and written one after another."""

import json
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from experiments.errors import InputError
from experiments.files import says_full
from face_baking.assembly import STUDIO_EV
from face_baking.bake import NOTICE, RECIPE
from face_baking.development import develop, to_8_bit
from face_baking.environment import ensure_blender
from face_baking.identity import identity_of_seed
from face_baking.kit import FaceKit
from face_baking.renderer import Renderer, Setup, Shot
from face_baking.training.draw import PER_FACE, Sample, draw_sample, face_of
from face_baking.training.labels import labels_of
from face_baking.training.scene import SampleScene

LABELS_FILE, SETTINGS_FILE = "labels.jsonl", "samples.json"


@dataclass(frozen=True)
class SamplesOrder:
    """How many samples of which seed, how large and how well rendered, and where to."""

    count: int
    seed: int
    size_px: tuple[int, int]
    samples: int
    out: Path
    blender: Path
    device: str
    threads: int

    def settings(self, kit: FaceKit) -> dict[str, Any]:
        """What must be the same for a stopped run to go on; the count may grow."""
        return {
            "seed": self.seed,
            "size_px": list(self.size_px),
            "samples": self.samples,
            "kit": kit.fingerprint,
            "recipe": RECIPE,
        }


def make_samples(order: SamplesOrder, kit: FaceKit, report: Callable[[int, int, str], None]) -> None:
    """Render what is missing; a line of labels is written after its picture, so that every line has one.

    Raises
    ------
    InputError
        The folder holds samples of other settings, Blender cannot be had or failed, or the disk is full.
    """
    try:
        order.out.mkdir(parents=True, exist_ok=True)
        _check_settings(order, kit)
        done = _labelled(order.out)
        missing = [number for number in range(order.count) if number not in done]
        made = order.count - len(missing)
        report(made, order.count, "begin")
        for block in sorted({number // PER_FACE for number in missing}):
            numbers = [number for number in missing if number // PER_FACE == block]
            for number in _make_face(order, kit, numbers):
                made += 1
                report(made, order.count, f"{number:06d}")
    except (OSError, InputError) as error:
        if says_full(error):
            raise InputError(
                f"the disk is full: free up space and run again; finished samples stay in {order.out}"
            ) from error
        raise


def _check_settings(order: SamplesOrder, kit: FaceKit) -> None:
    file, ours = order.out / SETTINGS_FILE, order.settings(kit)
    if not file.exists():
        file.write_text(json.dumps(ours | {"geometry": NOTICE}) + "\n", encoding="utf-8")
        return
    try:
        theirs = json.loads(file.read_text(encoding="utf-8"))
    except ValueError as error:
        raise InputError(f"{file} is damaged; use another --out") from error
    for key, value in ours.items():
        if not isinstance(theirs, dict) or theirs.get(key) != value:
            was = theirs.get(key) if isinstance(theirs, dict) else theirs
            raise InputError(
                f"{order.out} has samples with {key} {was}, but {value} was requested; use another --out"
            )


def _labelled(folder: Path) -> set[int]:
    """Numbers that have a whole line; a line that was cut off is taken away."""
    file = folder / LABELS_FILE
    if not file.exists():
        return set()
    lines = file.read_bytes().split(b"\n")
    if lines[-1]:
        file.write_bytes(b"\n".join([*lines[:-1], b""]))
    return {int(json.loads(line)["number"]) for line in lines[:-1]}


def _make_face(order: SamplesOrder, kit: FaceKit, numbers: list[int]) -> Iterator[int]:
    """Render samples of one face; yields each number when its picture and its labels are written."""
    seed, light = face_of(order.seed, numbers[0])
    identity = identity_of_seed(seed)
    scene = SampleScene(kit, identity, order.size_px)
    python = ensure_blender(order.blender)
    setup = Setup(python, light, order.device, order.threads, order.out / "blender.log")
    with tempfile.TemporaryDirectory(prefix="samples-") as folder, Renderer(scene, setup) as renderer:
        for number in numbers:
            sample = draw_sample(order.seed, number)
            shot = Shot(
                Path(folder) / "shot.npz", sample.pose, {"all": (0, 0, *order.size_px)}, order.samples
            )
            renderer.render(shot)
            picture = photographed(shot.read()["all"], sample, identity.exposure_ev)
            name = f"{number:06d}.jpg"
            (order.out / name).write_bytes(picture)
            line = {
                "number": number,
                "file": name,
                "identity": seed,
                "light": light,
                **asdict(sample),
                "size_px": list(order.size_px),
                "px_per_mm": round(scene.view.px_per_mm, 4),
                **labels_of(scene, sample.pose),
            }
            with (order.out / LABELS_FILE).open("a", encoding="utf-8") as file:
                file.write(json.dumps(line) + "\n")
            yield number


def photographed(light: NDArray[np.float16], sample: Sample, exposure_ev: float) -> bytes:
    """JPEG bytes of (h, w, 3) scene light, exposed, tinted and compressed as the sample says."""
    tint = np.array([1 + sample.warmth, 1.0, 1 - sample.warmth], np.float32)
    developed = develop(light.astype(np.float32) * tint, exposure_ev + STUDIO_EV + sample.exposure_ev)
    buffer = BytesIO()
    Image.fromarray(to_8_bit(developed)).save(buffer, "JPEG", quality=sample.quality)
    return buffer.getvalue()
