"""Whether the installation is whole: every file is there, and none of another project hides one of ours."""

import csv
from importlib import metadata
from importlib.util import find_spec
from pathlib import Path

from experiments.command_line import install_line
from experiments.errors import InputError

PACKAGES = ("server", "analysis", "experiments", "migrations", "table_files", "video_conversion")
REINSTALL = "uv tool install --force FILE.whl"
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


def damaged_files() -> list[str]:
    """Installed files that are missing or have another size than recorded; none in a checkout."""
    try:
        installed = metadata.distribution("palpebra")
    except metadata.PackageNotFoundError:
        return []
    damaged = []
    # Not `metadata.files`, which leaves out missing files.
    for row in filter(None, csv.reader((installed.read_text("RECORD") or "").splitlines())):
        # A record that was cut off ends in a row without a size.
        name, size = row[0], row[2] if len(row) == 3 else "cut off"
        # Commands lie outside, and each installer writes its own. Compiled files and the record have no size.
        if size and not name.startswith(".."):
            path = Path(str(installed.locate_file(name)))
            if not path.is_file() or str(path.stat().st_size) != size:
                damaged.append(name)
    return damaged


def refuse_broken_installation() -> None:
    """Stop with one line if a file is missing or damaged, or another project's package hides one of ours.

    Raises
    ------
    InputError
        Names the file, or the package and its folder.
    """
    if damaged := damaged_files():
        first, *others = damaged
        found = f"{first} is missing or has another size"
        if others:
            found = f"{first} and {len(others)} more are missing or have another size"
        raise InputError(f"the installation is damaged: {found}; install Palpebra again: {REINSTALL}")
    for name, place in foreign_packages().items():
        raise InputError(
            f"package '{name}': expected Palpebra's, got the one in {place}; install Palpebra in a separate "
            f"environment: {install_line()}"
        )
