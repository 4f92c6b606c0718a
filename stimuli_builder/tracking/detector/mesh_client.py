"""Talks to `mesh_worker.py`, which runs in an environment of its own."""

import json
import struct
import subprocess
import sys
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np

from experiments.errors import InputError
from stimuli_builder.environments import cache_folder, ensure_environment
from stimuli_builder.video import Picture

HERE = Path(__file__).parent
REQUIREMENTS = HERE / "requirements.txt"
NEWEST_PYTHON = (3, 12)
"""The newest Python that the detector's packages are built for."""


def detector_environment() -> Path:
    """Interpreter of the detector's environment, made at first use (270 MB on disk)."""
    own = sys.version_info[:2] <= NEWEST_PYTHON
    python = sys.executable if own else f"{NEWEST_PYTHON[0]}.{NEWEST_PYTHON[1]}"
    folder = cache_folder() / "face-mesh-0.10.21"
    probe = "import mediapipe; mediapipe.solutions.face_mesh"
    return ensure_environment(folder, python, REQUIREMENTS, "the face detector (MediaPipe)", probe)


class MeshClient:
    """The worker, started with the block and ended with it; one picture at a time."""

    def __init__(self, interpreter: Path):
        self._command = [str(interpreter), "-I", str(HERE / "mesh_worker.py")]

    def __enter__(self) -> Self:
        self._process = subprocess.Popen(  # noqa: S603 - fixed program
            self._command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
        )
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._process.stdin:
            self._process.stdin.close()
        try:
            self._process.wait(timeout=5)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        if self._process.stdout:
            self._process.stdout.close()

    def ask(self, operation: str, picture: Picture, **more: object) -> Any:
        """Send a picture, uint8 (h, w, 3), and return the answer.

        Raises
        ------
        ValueError
            The picture is of another kind, a grey one say.
        InputError
            The worker ended.
        """
        if picture.ndim != 3 or picture.shape[2] != 3 or picture.dtype != np.uint8:
            raise ValueError(f"expected an RGB picture, uint8 (h, w, 3), got {picture.dtype} {picture.shape}")
        head = json.dumps({"op": operation, "shape": list(picture.shape), **more}).encode()
        stdin, stdout = self._process.stdin, self._process.stdout
        try:
            if stdin is None or stdout is None:
                raise BrokenPipeError
            stdin.write(struct.pack("<q", len(head)) + head + picture.tobytes())
            stdin.flush()
            (length,) = struct.unpack("<q", stdout.read(8))
            return json.loads(stdout.read(length))
        except (BrokenPipeError, struct.error) as error:
            raise InputError(
                "the face detector ended unexpectedly; remove its environment "
                f"({cache_folder()}) and run the command again, which makes it anew"
            ) from error
