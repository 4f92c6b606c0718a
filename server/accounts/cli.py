"""`server admin`: the first account, and one-time links, from the command line."""

from typing import Annotated

import typer
from rich.console import Console

from experiments.errors import InputError
from server.accounts import service
from server.accounts.identity import Role
from server.accounts.people import invitation_url
from server.db import open_database
from server.errors import ApiError
from server.settings import Settings

app = typer.Typer(help="Accounts of experimenters.", no_args_is_help=True)
_ROLES: dict[str, Role] = {"owner": "owner", "experimenter": "experimenter", "viewer": "viewer"}


def register(parent: typer.Typer) -> None:
    """Add `server admin` to the command line."""
    parent.add_typer(app, name="admin")


def _known(role: str) -> Role:
    if role not in _ROLES:
        raise InputError(f"expected the role owner, experimenter or viewer, got '{role}'")
    return _ROLES[role]


@app.command("create")
def create(
    name: Annotated[str, typer.Argument(help="Name to sign in with.")],
    role: Annotated[str, typer.Option(help="owner, experimenter or viewer.")] = "owner",
    password: Annotated[
        str,
        typer.Option(
            prompt=True, hide_input=True, confirmation_prompt=True, help="Asked for where not given."
        ),
    ] = "",
) -> None:
    """Create an account.

    Example: server admin create ada
    """
    database = open_database(Settings())
    try:
        with database.write() as session:
            service.create_account(session, name, password, _known(role))
    except ApiError as error:
        raise InputError(error.message) from error
    Console().print(f"account '{name}' ({role}) created")


@app.command("link")
def link(
    role: Annotated[str, typer.Option(help="owner, experimenter or viewer.")] = "owner",
    label: Annotated[str, typer.Option(help="Whom it is for.")] = "",
) -> None:
    """Print a one-time link with which somebody makes an account of her own.

    Example: server admin link --role experimenter --label "Ada"
    """
    settings = Settings()
    _, token = service.invite(open_database(settings), _known(role), label, None)
    Console(soft_wrap=True).print(invitation_url(settings.public_url, token), highlight=False)
