"""Blender's own Python environment: made on first use, because bpy needs an older numpy than we do."""

from pathlib import Path

from stimuli_builder.environments import run_step, uv

BPY_VERSION = "5.0.1"
PYTHON_VERSION = "3.11"
PACKAGES = (f"bpy=={BPY_VERSION}", "openexr==3.5.3")


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
    if not all(_has(python, package) for package in PACKAGES):
        run_step([*uv(), "pip", "install", "--python", str(python), *PACKAGES], "install Blender")
    run_step(
        [str(python), "-c", "import bpy, OpenEXR"],
        "start Blender (it needs the libraries of docs/characters.md)",
    )
    return python


def _has(python: Path, package: str) -> bool:
    """Whether an environment has `NAME==VERSION`, without starting it."""
    name, version = package.split("==")
    return any(python.parent.parent.glob(f"lib/python*/site-packages/{name.lower()}-{version}.dist-info"))
