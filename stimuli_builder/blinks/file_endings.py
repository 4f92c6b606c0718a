"""Endings of the files that `stimuli blinks` writes: what is in a file is what its name says."""

from collections.abc import Mapping
from pathlib import Path

from experiments.errors import InputError

TABLE = (".csv", ".txt")
CURVES = {
    "csv": TABLE,
    "arkit": TABLE,
    "json": (".json",),
    "blender": (".py",),
    "maya": (".anim",),
    "gltf": (".gltf",),
    "usd": (".usda", ".usd"),
}
"""Endings of `--curve` by `--curve-format`."""


def check_endings(files: Mapping[str, tuple[Path | None, tuple[str, ...]]]) -> None:
    """Refuse a file whose ending is of another kind; a name without one is taken.

    Parameters
    ----------
    files : mapping of str to (Path or None, tuple of str)
        By option, the file and the endings that it may have.
    """
    for option, (path, endings) in files.items():
        if path is not None and path.suffix and path.suffix.lower() not in endings:
            expected = " or ".join(endings)
            raise InputError(f"{option} {path.name}: expected a name that ends in {expected}")
