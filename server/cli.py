"""The command `server`: lists the commands; each lives with its subject and is loaded when called."""

import os

from experiments.command_groups import lazy_app
from experiments.command_line import run_command_line
from experiments.errors import InputError

PRIVATE = 0o077
COMMANDS = {
    "run": (
        "server.cli_run",
        "Serve participants and experimenters until stopped (Ctrl-C); what is under way is finished first.",
    ),
    "export": (
        "server.exports.cli",
        "Write a study's data: as csv, the columns of experiments/columns and one column a factor.",
    ),
    "capsule": (
        "server.exports.cli",
        "Write the capsule of a study: a Psych-DS dataset and an RO-Crate with data, materials and report.",
    ),
    "seal": (
        "server.exports.cli",
        "Seal design, exclusions, analysis plan and power before the first participant; or write the seal "
        "again.",
    ),
    "methods": (
        "server.exports.cli",
        "Write a study's Methods paragraph; each number is followed by the query that gives it.",
    ),
    "simulate": (
        "server.rehearsals.cli",
        "Let simulated participants take part through the HTTP API; their runs have the origin `simulated`.",
    ),
    "retention": (
        "server.privacy.cli",
        "Erase what is due by the retention that studies declare; the server does so each hour.",
    ),
    "doctor": (
        "server.operations.cli",
        "Check the installation and say what to fix; exit code 1 where something failed.",
    ),
    "backup": (
        "server.operations.cli_backups",
        "Write database, clips and secret key of this moment into one file, while the server goes on.",
    ),
    "backup-key": (
        "server.operations.cli_backups",
        "Make a pair of keys for encrypted backups, and print the public one.",
    ),
    "restore": (
        "server.operations.cli_backups",
        "Bring a backup back into an empty database (SQLite or PostgreSQL) and clip store.",
    ),
    "drill": (
        "server.operations.cli_backups",
        "Bring the newest backup back beside the data, examine it and remove it; exit code 1 where it "
        "failed.",
    ),
    "database": ("server.operations.cli", "The database's tables."),
    "study": ("server.studies.cli", "Studies on this server."),
    "link": ("server.studies.cli", "Links for participants."),
    "admin": ("server.accounts.cli", "Accounts of experimenters."),
    "account": ("server.accounts.cli", "Let somebody in again who lost a password or a phone."),
    "audit": ("server.accounts.audit_cli", "The audit log: verify its chain of hashes, export it."),
    "workspace": ("server.accounts.workspace_cli", "Workspaces: laboratories that share this server."),
    "person": ("server.privacy.cli", "One participant: subject access and erasure."),
}
"""Command -> the module whose `register` adds it, and the line of help that lists it."""

app = lazy_app(
    "server",
    "Run rating studies: serve participants and experimenters, manage studies, take out the data.",
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
    before = os.umask(PRIVATE)
    try:
        run_command_line(_call)
    finally:
        os.umask(before)
