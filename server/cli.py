"""The command `server`: it only gathers the command groups, each of which lives with its subject."""

import os

import typer
from pydantic import ValidationError
from pydantic_core import ErrorDetails

from experiments.command_line import run_command_line
from experiments.errors import InputError
from experiments.wrong_values import wrong_value
from server.errors import ApiError
from server.settings import Settings

PRIVATE = 0o077
app = typer.Typer(
    name="server",
    help="Run rating studies: serve participants and experimenters, manage studies, take out the data.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
)


def _gather() -> None:
    from server import cli_database, cli_run
    from server.accounts import cli as accounts
    from server.audit import cli as audit
    from server.capsules import cli as capsules
    from server.export import cli as export
    from server.methods import cli as methods
    from server.operations import cli as operations
    from server.operations import cli_backups as backups
    from server.persons import cli as persons
    from server.retention import cli as retention
    from server.seals import cli as seals
    from server.simulation import cli as simulation
    from server.studies import cli as studies
    from server.workspaces import cli as workspaces

    for group in (
        cli_run,
        cli_database,
        studies,
        export,
        capsules,
        seals,
        methods,
        simulation,
        accounts,
        audit,
        workspaces,
        persons,
        retention,
        operations,
        backups,
    ):
        group.register(app)


_gather()


def _call(*, standalone_mode: bool) -> object:
    try:
        return app(standalone_mode=standalone_mode)
    except ApiError as error:
        raise InputError(error.message) from error
    except ValidationError as error:
        if error.title != Settings.__name__:
            raise
        raise InputError("; ".join(map(_setting, error.errors()))) from error


def _setting(problem: ErrorDetails) -> str:
    name = "__".join(map(str, problem["loc"])).upper() or "a setting"
    shown = name if name.startswith(("PALPEBRA_", "DATABASE_")) else f"PALPEBRA_{name}"
    return f"{shown}: {wrong_value(problem)}; see docs/settings.md"


def main() -> None:
    """Run `server`; bad input ends in one line on stderr and exit code 2.

    What it writes (database, clips, reports, exports) is for its own user alone.
    """
    before = os.umask(PRIVATE)
    try:
        run_command_line(_call)
    finally:
        os.umask(before)
