"""One Cycles process that renders poses of one face: the package's side of cycles_face_worker.py."""

import json
import signal
import subprocess
import sys
import tempfile
import tomllib
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Any
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from experiments.errors import InputError, did_you_mean
from face_baking import framing
from face_baking.framing import Box
from face_baking.lid_pose import OPEN, LidPose
from face_baking.scene import FaceScene

WORKER = Path(__file__).with_name("cycles_face_worker.py")
LIGHTS_FILE = Path(__file__).with_name("lights.toml")
DEVICES = ("auto", "cpu", "gpu")


@dataclass(frozen=True)
class Shot:
    """One picture to render: a pose, which boxes of the frame, and where to; `finer` boxes' own samples."""

    file: Path
    pose: LidPose
    boxes: dict[str, Box]
    samples: int
    finer: dict[str, int] = field(default_factory=dict)

    def read(self) -> dict[str, NDArray[np.float16]]:
        """(h, w, 3) scene-linear light of each box; InputError where it is damaged or another bake's."""
        try:
            with self.file.open("rb") as content, np.load(content) as stored:
                light = {name: stored[name] for name in stored.files}
        except (OSError, ValueError, EOFError, BadZipFile) as error:
            raise InputError(f"{self.file} is damaged: delete it and bake again; the others stay") from error
        expected = {name: (box[3], box[2], 3) for name, box in self.boxes.items()}
        if {name: picture.shape for name, picture in light.items()} != expected:
            raise InputError(f"{self.file} holds other boxes than this bake's: delete it and bake again")
        return light


@dataclass(frozen=True)
class Setup:
    """How a face is rendered: Blender's Python, light preset, device, threads, where chatter goes, seed."""

    python: Path
    light: str
    device: str
    threads: int
    log: Path
    seed: int = 1
    """Of the noise: one for all that a character is made of."""


class Renderer:
    """Context manager round the Blender process; one shot at a time."""

    def __init__(self, scene: FaceScene, setup: Setup) -> None:
        self._scene, self._setup = scene, setup
        self._folder = tempfile.TemporaryDirectory(prefix="bake-")
        here = Path(self._folder.name)
        scene.write(here / "scene.npz", OPEN)
        scene.write_textures(here / "textures.npz")
        (here / "settings.json").write_text(json.dumps(_settings(scene, setup, here)))
        self._log_file = setup.log.open("a")
        self._process = subprocess.Popen(  # noqa: S603 - our own worker
            [str(setup.python), str(WORKER), str(here / "settings.json")],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._log_file,
            text=True,
        )
        self.device = ""

    def __enter__(self) -> "Renderer":
        # Else a bake that is asked to end would leave Blender at work on its picture for minutes.
        self._before = signal.signal(signal.SIGTERM, lambda number, _frame: sys.exit(128 + number))
        try:
            self.device = str(self._answer("starting")["device"])
        except BaseException as error:
            self.__exit__(type(error), error, None)
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        signal.signal(signal.SIGTERM, self._before)
        if error is not None:
            self._process.kill()
        for stream in (self._process.stdin, self._process.stdout):
            if stream is not None:
                with suppress(BrokenPipeError):
                    stream.close()
        self._process.wait()
        self._log_file.close()
        self._folder.cleanup()

    def render(self, shot: Shot) -> float:
        """Render one shot to its file and return the seconds it took.

        Raises
        ------
        InputError
            Blender failed or ended, say because the GPU went away or the disk is full.
        """
        pose = Path(self._folder.name) / "pose.npz"
        self._scene.write_pose(pose, shot.pose)
        samples = {name: shot.finer.get(name, shot.samples) for name in shot.boxes}
        job = {"pose": str(pose), "out": str(shot.file.resolve()), "samples": samples, "boxes": shot.boxes}
        # A process that ended breaks the pipe; its answer below says what happened.
        with suppress(BrokenPipeError):
            if self._process.stdin is not None:
                self._process.stdin.write(json.dumps(job) + "\n")
                self._process.stdin.flush()
        return float(self._answer(f"rendering {shot.file.name}")["seconds"])

    def _answer(self, doing: str) -> dict[str, Any]:
        line = self._process.stdout.readline() if self._process.stdout is not None else ""
        answer: dict[str, Any] = json.loads(line) if line else {"error": "it ended without output"}
        if "error" in answer:
            raise InputError(
                f"Blender stopped while {doing}: {answer['error']}; what is rendered stays: bake again"
                f"{'' if self._setup.device == 'cpu' else ', with --device cpu if the GPU is gone'} "
                f"(see {self._setup.log})"
            )
        return answer


def load_light(name: str, file: Path = LIGHTS_FILE) -> dict[str, Any]:
    """A light preset; InputError with the nearest name where there is none."""
    presets: dict[str, dict[str, Any]] = tomllib.loads(file.read_text(encoding="utf-8"))
    if name not in presets:
        raise InputError(f"no light preset '{name}'{did_you_mean(name, presets)}")
    return presets[name]


def _settings(scene: FaceScene, setup: Setup, folder: Path) -> dict[str, Any]:
    view, identity = scene.view, scene.identity
    return {
        "scene": str(folder / "scene.npz"),
        "textures": str(folder / "textures.npz"),
        "size_px": list(view.size_px),
        "width_cm": view.width_cm,
        "centre_y_cm": view.centre_y_cm,
        "plane_z_cm": framing.PLANE_Z_CM,
        "distance_cm": framing.DISTANCE_CM,
        "look": {
            "melanin": identity.skin.melanin,
            "haemoglobin": identity.skin.haemoglobin,
            "hair": list(identity.hair.colour),
        },
        "lights": load_light(setup.light),
        "device": setup.device,
        "threads": setup.threads,
        "seed": setup.seed,
    }
