"""Blender's own Python environment: made on first use, because bpy needs an older numpy than we do."""

from pathlib import Path

from stimuli_builder.environments import run_step, uv

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
        run_step([*uv(), "venv", str(folder), "--python", PYTHON_VERSION], "make Blender's environment")
        run_step([*uv(), "pip", "install", "--python", str(python), f"bpy=={BPY_VERSION}"], "install Blender")
    run_step(
        [str(python), "-c", "import bpy"], "start Blender (it needs the libraries of docs/characters.md)"
    )
    return python
