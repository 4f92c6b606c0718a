"""The command `palpebra`: start the server, try the demo, care for the data; the three programs by name."""

import os
import sys
from importlib import import_module, metadata

from experiments.command_groups import lazy_app
from experiments.command_line import run_privately
from palpebra.folders import DATA_VARIABLE, default_folder
from palpebra.intact import refuse_broken_installation

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
