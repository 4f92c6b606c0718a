"""Blender's own Python environment: made on first use, because bpy needs an older numpy than we do."""

from pathlib import Path

from stimuli_builder.tracking.detector.mesh import run_step, uv

BPY_VERSION = "5.0.1"
PYTHON_VERSION = "3.11"
PACKAGES = (f"bpy=={BPY_VERSION}", "openexr==3.5.3")


def ensure_blender(folder: Path) -> Path:
    """Python interpreter of an environment in `folder` with bpy (360 MB) and OpenEXR; installs what it lacks.

    An environment that has other versions of them keeps those.

    Raises
    ------
    InputError
        The environment cannot be made, or one of them does not start in it.
    """
    python = folder / "bin" / "python"
    if not python.exists():
        run_step([*uv(), "venv", str(folder), "--python", PYTHON_VERSION], "make Blender's environment")
    if missing := missing_packages(folder):
        run_step([*uv(), "pip", "install", "--python", str(python), *missing], "install Blender")
    run_step(
        [str(python), "-c", "import bpy, OpenEXR"],
        "start Blender (it needs the libraries of docs/explanation/characters.md)",
    )
    return python


def missing_packages(folder: Path) -> list[str]:
    """What of PACKAGES an environment has in no version, without starting it."""
    return [
        package
        for package in PACKAGES
        if not any(folder.glob(f"lib/python*/site-packages/{package.split('==')[0]}-*.dist-info"))
    ]
