"""Separate Python environments for libraries that conflict with ours, created at first use by uv."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

from experiments.errors import InputError


def cache_folder() -> Path:
    """Folder for environments shared by all projects of a user (XDG_CACHE_HOME, else ~/.cache)."""
    base = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    return Path(base) / "palpebra"


def ensure_environment(folder: Path, python: str, requirements: Path, what: str, probe: str) -> Path:
    """Return the interpreter of an environment with the given packages, made where it lacks.

    Parameters
    ----------
    python : str
        Version, or path of an interpreter, that uv makes the environment with.
    requirements : Path
        File of pinned packages, hashes included; nothing else is installed.
    what : str
        What it is for, in words of the error.
    probe : str
        Statement that must run in it.

    Raises
    ------
    InputError
        The environment cannot be made, or the probe fails in it; an unfinished one is removed.
    """
    interpreter = folder / "bin" / "python"
    ready = folder / "ready"
    if ready.exists():
        return interpreter
    shutil.rmtree(folder, ignore_errors=True)
    folder.parent.mkdir(parents=True, exist_ok=True)
    try:
        run_step([*uv(), "venv", "-q", str(folder), "--python", python], f"make the environment of {what}")
        install = ["pip", "install", "-q", "--no-deps", "--require-hashes", "-r", str(requirements)]
        run_step([*uv(), *install, "--python", str(interpreter)], f"install {what}")
        run_step([str(interpreter), "-c", probe], f"start {what}")
    except InputError:
        shutil.rmtree(folder, ignore_errors=True)
        raise
    ready.touch()
    return interpreter


def uv() -> list[str]:
    """The command uv, on the PATH or in the folder of the running Python."""
    beside = Path(sys.executable).with_name("uv")
    path = shutil.which("uv") or (str(beside) if beside.exists() else None)
    if path is None:
        raise InputError(
            "uv is not on the PATH: install it (pip install uv); it creates the required environment"
        )
    return [path]


def run_step(command: list[str], what: str) -> None:
    """Run one step of making an environment; its last line of complaint becomes the error."""
    done = subprocess.run(command, capture_output=True, text=True, check=False)  # noqa: S603 - fixed program
    if done.returncode != 0:
        last = (done.stderr.strip().splitlines() or ["no message"])[-1].strip()
        raise InputError(f"cannot {what}: {last}")
