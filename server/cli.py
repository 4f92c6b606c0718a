"""The command `server`: lists the commands; each lives with its subject and is loaded when called."""

from experiments.command_groups import lazy_app
from experiments.command_line import run_privately
from experiments.errors import InputError

COMMANDS = {
    "run": (
        "server.cli_run",
        "Serve participants and experimenters until stopped (Ctrl-C); running requests are finished first.",
    ),
    "export": (
        "server.exports.cli",
        "Export a study's data, for example as CSV with one column per factor.",
    ),
    "capsule": (
        "server.exports.cli",
        "Write the capsule of a study: a Psych-DS dataset and an RO-Crate with data, materials and report.",
    ),
    "seal": (
        "server.exports.cli",
        "Seal design, exclusions, analysis plan and power before the first participant, or write the seal "
        "again.",
    ),
    "methods": (
        "server.exports.cli",
        "Write a study's Methods paragraph with the query behind each number.",
    ),
    "simulate": (
        "server.rehearsals.cli",
        "Run simulated participants through the HTTP API; their runs have the origin `simulated`.",
    ),
    "retention": (
        "server.privacy.cli",
        "Erase data that are due by the retention rules of studies; the server does so every hour.",
    ),
    "doctor": (
        "server.operations.cli",
        "Check the installation and report what to fix; exit code 1 if a check failed.",
    ),
    "backup": (
        "server.operations.cli_backups",
        "Back up database, clips and secret key in one file while the server runs.",
    ),
    "backup-key": (
        "server.operations.cli_backups",
        "Create a key pair for encrypted backups, and print the public key.",
    ),
    "restore": (
        "server.operations.cli_backups",
        "Restore a backup into an empty database (SQLite or PostgreSQL) and clip store.",
    ),
    "drill": (
        "server.operations.cli_backups",
        "Test the newest backup: restore it to a temporary place, check it and remove it; exit code 1 on "
        "failure.",
    ),
    "database": ("server.operations.cli", "The database's tables."),
    "study": ("server.studies.cli", "Studies on this server."),
    "link": ("server.studies.cli", "Links for participants."),
    "admin": ("server.accounts.cli", "Accounts of experimenters."),
    "account": ("server.accounts.cli", "Restore access for someone who lost a password or a phone."),
    "audit": ("server.accounts.cli", "The audit log: verify its chain of hashes, export it."),
    "workspace": ("server.accounts.cli", "Workspaces: laboratories that share this server."),
    "person": ("server.privacy.cli", "One participant: subject access and erasure."),
}
"""Command -> the module whose `register` adds it, and the line of help that lists it."""

app = lazy_app(
    "server",
    "Run rating studies: serve participants and experimenters, manage studies, export data.",
    COMMANDS,
)


def _call(*, standalone_mode: bool) -> object:
    try:
        return app(standalone_mode=standalone_mode)
    except InputError:
        raise
    except Exception as error:
        # What these errors are is imported only where there is one.
        from server.cli_common import refusal

        message = refusal(error)
        if message is None:
            raise
        raise InputError(message) from error


def main() -> None:
    """Run `server`; bad input ends in one line on stderr and exit code 2.

    What it writes (database, clips, reports, exports) is for its own user alone.
    """
    run_privately(_call)
