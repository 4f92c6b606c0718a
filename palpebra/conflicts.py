"""Packages of another project under a name of ours: some of our packages have general names."""

from importlib.util import find_spec
from pathlib import Path

from experiments.command_line import install_line
from experiments.errors import InputError

PACKAGES = ("server", "analysis", "experiments", "migrations", "table_files", "video_conversion")
HOME = Path(__file__).resolve().parent.parent


def foreign_packages() -> dict[str, str]:
    """Package -> the folder of another project that Python takes it from."""
    found = {}
    for name in PACKAGES:
        spec = find_spec(name)
        places = list(spec.submodule_search_locations or []) if spec is not None else []
        if places and Path(places[0]).resolve().parent != HOME:
            found[name] = places[0]
    return found


def refuse_foreign_packages() -> None:
    """Stop with one line if another project's package hides one of ours.

    Raises
    ------
    InputError
        Names the package and its folder.
    """
    for name, place in foreign_packages().items():
        raise InputError(
            f"package '{name}': expected Palpebra's, got the one in {place}; install Palpebra in a separate "
            f"environment: {install_line()}"
        )
