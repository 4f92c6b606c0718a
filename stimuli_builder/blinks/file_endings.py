"""Endings of the files that `stimuli blinks` writes: what is in a file is what its name says."""

from pathlib import Path

from experiments.errors import InputError
from experiments.files import check_ending

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


def check_curve(path: Path | None, format_name: str) -> None:
    """Refuse a curve whose ending is not of its format; name the format that the ending is of."""
    if path is None:
        return
    endings, ending = CURVES[format_name], path.suffix.lower()
    other = next((name for name, of_format in CURVES.items() if ending in of_format), None)
    if ending not in endings and other is not None:
        raise InputError(
            f"--curve {path.name}: --curve-format {format_name} is written as {' or '.join(endings)}; add "
            f"--curve-format {other}, or end the name so"
        )
    check_ending(path, endings, "--curve")
