"""The command `palpebra`: start the server, try the demo, care for the data; the three programs by name."""

import csv
import os
import sys
from importlib import import_module, metadata
from importlib.util import find_spec
from pathlib import Path

from experiments.command_groups import lazy_app
from experiments.command_line import install_line, run_privately
from experiments.errors import InputError
from palpebra.folders import DATA_VARIABLE, default_folder

COMMANDS = {
    "start": (
        "palpebra.start",
        "Start the server and open the first page. This is what `palpebra` alone does.",
    ),
    "demo": ("palpebra.start", "Add the demo study, start the server and open the study as a participant."),
    "serve": ("palpebra.https", "Serve studies at https://DOMAIN, behind Caddy."),
    "doctor": ("palpebra.care", "Check the installation and the data, and say what to fix."),
    "backup": ("palpebra.care", "Write database, clips and secret key into one file."),
    "upgrade": ("palpebra.care", "Back up the data and bring the database to this version."),
    "service": ("palpebra.service", "Run the server as a systemd service."),
    "stimuli": ("palpebra.programs", "Track eyelids, measure blinks and build clips: `stimuli`."),
    "server": ("palpebra.programs", "Studies, links, exports and everything else of a server: `server`."),
    "analysis": ("palpebra.programs", "From ratings to tables, figures and reports: `analysis`."),
}
PROGRAMS = {"stimuli": "stimuli_builder.cli", "server": "server.cli", "analysis": "analysis.cli"}

app = lazy_app(
    "palpebra",
    "Rating studies with short clips. Without a command, `palpebra` starts the server and opens the browser.",
    COMMANDS,
)


def with_start(arguments: list[str]) -> list[str]:
    """The arguments with the command that `palpebra` alone, or with options alone, means.

    Parameters
    ----------
    arguments : list of str
        What follows `palpebra`.

    Returns
    -------
    list of str

    Examples
    --------
    >>> with_start(["--port", "8010"])
    ['start', '--port', '8010']
    >>> with_start(["doctor"])
    ['doctor']
    """
    first = arguments[0] if arguments else ""
    is_help = first in ("--help", "--install-completion", "--show-completion")
    return arguments if first and (is_help or not first.startswith("-")) else ["start", *arguments]


def main() -> None:
    """Run one command. What it writes (database, clips, uploads) is for its own user alone."""
    arguments = sys.argv[1:]
    if arguments[:1] == ["--version"]:
        print(f"palpebra {metadata.version('palpebra')}")
        return
    if arguments and arguments[0] in PROGRAMS:
        # The program's own command line, so that its help and errors are the same under both names.
        sys.argv = [arguments[0], *arguments[1:]]
        # The same data as `palpebra` alone uses, not the folder `data` of wherever this is called.
        os.environ.setdefault(DATA_VARIABLE, str(default_folder()))
        import_module(PROGRAMS[arguments[0]]).main()
        return
    sys.argv = [sys.argv[0], *with_start(arguments)]
    run_privately(_checked_app)


def _checked_app(**settings: object) -> object:
    refuse_broken_installation()
    return app(**settings)


# Whether the installation is whole: every file is there, and none of another project hides one of ours.

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
