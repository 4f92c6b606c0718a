"""One Cycles process that takes jobs: the package's side of cycles_worker.py."""

import json
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.errors import InputError
from stimuli_builder.characters.photorealistic import framing
from stimuli_builder.characters.photorealistic.eyelid_skin import LidPose
from stimuli_builder.characters.photorealistic.framing import Box, Frame
from stimuli_builder.characters.photorealistic.parameters import Face
from stimuli_builder.characters.photorealistic.scene_file import write_scene

WORKER = Path(__file__).with_name("cycles_worker.py")
MARGIN_COLOUR, FLESH_COLOUR = (0.60, 0.30, 0.25), (0.66, 0.27, 0.23)
STUDIO_STRENGTH = 0.75


@dataclass(frozen=True)
class Shot:
    """One picture to render: a pose, what of it (`beauty` or `eye_mask`), where to, which boxes."""

    file: Path
    pose: LidPose
    boxes: dict[str, Box]
    samples: int
    kind: str = "beauty"

    def read(self) -> dict[str, NDArray[np.float16]]:
        """(h, w, 3) scene-linear light of each box."""
        with np.load(self.file) as stored:
            return {name: stored[name] for name in stored.files}


class Renderer:
    """Context manager round the Blender process; one shot at a time."""

    def __init__(
        self, python: Path, face: Face, frame: Frame, textures: Path, log: Path, threads: int
    ) -> None:
        self._face, self._log = face, log
        self._folder = tempfile.TemporaryDirectory(prefix="bake-")
        self._settings = _settings(face, frame, textures, threads)
        settings = Path(self._folder.name) / "settings.json"
        settings.write_text(json.dumps(self._settings))
        self._log_file = log.open("a")
        self._process = subprocess.Popen(  # noqa: S603 - our own worker
            [str(python), str(WORKER), str(settings)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._log_file,
            text=True,
        )

    def __enter__(self) -> "Renderer":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._process.stdin is not None:
            self._process.stdin.close()
        if error is not None:
            self._process.kill()
        self._process.wait()
        if self._process.stdout is not None:
            self._process.stdout.close()
        self._log_file.close()
        self._folder.cleanup()

    def render(self, shot: Shot) -> None:
        """Render one shot to its file; InputError with the log's place if Blender fails."""
        scene = Path(self._folder.name) / "scene.npz"
        write_scene(scene, self._face, shot.pose)
        job = {"scene": str(scene), "out": str(shot.file.resolve()), "kind": shot.kind}
        job |= {"samples": shot.samples, "crops": shot.boxes}  # type: ignore[dict-item]
        answer = ""
        if (
            self._process.stdin is not None
            and self._process.stdout is not None
            and self._process.poll() is None
        ):
            self._process.stdin.write(json.dumps(job) + "\n")
            self._process.stdin.flush()
            answer = self._process.stdout.readline()
        if not answer:
            raise InputError(
                f"Blender stopped while rendering {shot.file.name}: see {self._log} and bake again"
            )


def _settings(face: Face, frame: Frame, textures: Path, threads: int) -> dict[str, Any]:
    return {
        "size_px": [frame.width_px, frame.height_px],
        "distance_mm": framing.DISTANCE_MM,
        "width_mm": framing.WIDTH_MM,
        "centre_y_mm": framing.CENTRE_Y_MM,
        "plane_z_mm": framing.PLANE_Z_MM,
        "textures": str(textures.resolve()),
        "margin_colour": [c * f for c, f in zip(MARGIN_COLOUR, _margin_tint(face), strict=True)],
        "flesh_colour": FLESH_COLOUR,
        "lash_colour": face.hair.lash_colour,
        "brow_colour": face.hair.brow_colour,
        "studio": STUDIO_STRENGTH,
        "seed": 0,
        "threads": threads,
    }


def _margin_tint(face: Face) -> tuple[float, float, float]:
    """Lid margins darken with the skin, but less."""
    extra = face.skin.melanin - 1
    return (float(np.exp(-0.10 * extra)), float(np.exp(-0.18 * extra)), float(np.exp(-0.25 * extra)))


def describe(face: Face) -> str:
    """JSON of everything that decides a face's look, for the key of resumable work."""
    return json.dumps(face.model_dump(), sort_keys=True)
