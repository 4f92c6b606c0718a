"""Blender's own Python environment: made on first use, because bpy needs an older numpy than we do."""

import shutil
import subprocess
from pathlib import Path

from experiments.errors import InputError

BPY_VERSION = "5.0.1"
PYTHON_VERSION = "3.11"


def ensure_blender(folder: Path) -> Path:
    """Python interpreter of an environment in `folder` that has bpy, installing it (360 MB) where it lacks.

    Raises
    ------
    InputError
        The environment cannot be made, or bpy does not start in it.
    """
    python = folder / "bin" / "python"
    if not python.exists():
        _run([*_uv(), "venv", str(folder), "--python", PYTHON_VERSION], "make Blender's environment")
        _run([*_uv(), "pip", "install", "--python", str(python), f"bpy=={BPY_VERSION}"], "install Blender")
    _run([str(python), "-c", "import bpy"], "start Blender (it needs the libraries of docs/characters.md)")
    return python


def _uv() -> list[str]:
    found = shutil.which("uv")
    if found is None:
        raise InputError("uv is not on the PATH: install it (pip install uv); it makes Blender's environment")
    return [found]


def _run(command: list[str], what: str) -> None:
    done = subprocess.run(command, capture_output=True, text=True, check=False)  # noqa: S603 - fixed program
    if done.returncode != 0:
        last = (done.stderr.strip().splitlines() or ["no message"])[-1]
        raise InputError(f"cannot {what} in {command[0]}: {last}")
