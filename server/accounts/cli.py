"""`server admin`: the first account, and one-time links, from the command line."""

from typing import Annotated

import typer
from rich.console import Console

from experiments.command_groups import command_group
from experiments.errors import InputError
from server.accounts import invitations, letters, service
from server.accounts.credentials import hash_password
from server.accounts.endpoints import invitation_url
from server.cli_common import migrated_services, one_of, out, stored_services
from server.core.db import open_database
from server.core.errors import ApiError
from server.core.settings import Settings
from server.models import ROLES

app = command_group("Accounts of experimenters.")
account_app = command_group("Restore access for someone who lost a password or a phone.")


def register(parent: typer.Typer) -> None:
    """Add `server admin` to the command line."""
    parent.add_typer(app, name="admin")
    parent.add_typer(account_app, name="account")


@app.command("create")
def create(
    name: Annotated[str, typer.Argument(help="Name to sign in with.")],
    role: Annotated[str, typer.Option(help="owner, experimenter or viewer.")] = "owner",
    password: Annotated[
        str,
        typer.Option(prompt=True, hide_input=True, confirmation_prompt=True, help="Prompted for if omitted."),
    ] = "",
) -> None:
    """Create an account.

    Example: server admin create ada
    """
    database = open_database(Settings())
    try:
        with database.write() as session:
            service.create_account(session, name, password, one_of(ROLES, role, "the role"))
    except ApiError as error:
        raise InputError(error.message) from error
    Console(markup=False).print(f"account '{name}' ({role}) created")


@app.command("link")
def link(
    role: Annotated[str, typer.Option(help="owner, experimenter or viewer.")] = "owner",
    label: Annotated[str, typer.Option(help="Name of the person to invite.")] = "",
) -> None:
    """Print a one-time link with which somebody creates their own account.

    Example: server admin link --role experimenter --label "Ada"
    """
    known = one_of(ROLES, role, "the role")
    with migrated_services() as services:
        _, token = invitations.invite(services.database, known, label, None)
        address = invitation_url(services.settings.public_url, token)
    Console(soft_wrap=True, markup=False).print(address, highlight=False)


@account_app.command("reset-password")
def reset_password(
    name: Annotated[str, typer.Argument(help="Name of the account.")],
    password: Annotated[str, typer.Option(help="Prompted for if omitted.")] = "",
) -> None:
    """Give an account a new password; its sessions, API tokens and logins by providers end.

    The audit log says so. The logins of an account that had no password stay.

    Example: server account reset-password ada
    """
    with stored_services() as services:
        with services.database.write() as session:
            service.check_known(session, name)
        # Only now: who mistyped the name has typed no password twice.
        given = password or typer.prompt("Password", hide_input=True, confirmation_prompt=True)
        fresh = hash_password(given, name)
        with services.database.write() as session:
            account_id, logins = service.reset_password(session, name, fresh)
        letters.send_notice(services.database, services.settings, account_id, letters.PASSWORD_RESET)
    out.print(f"changed the password of '{name}'; all sessions and API tokens of the account have ended")
    if logins:
        out.print(logins)


@account_app.command("reset-second-factor")
def reset_second_factor(name: Annotated[str, typer.Argument(help="Name of the account.")]) -> None:
    """Turn an account's second factor off, for the day phone and recovery codes are lost.

    Its sessions and API tokens end, and the audit log says so. Make sure that it is she who asks.
    Example: server account reset-second-factor ada
    """
    with stored_services() as services:
        with services.database.write() as session:
            account_id = service.reset_second_factor(session, name)
        letters.send_notice(services.database, services.settings, account_id, letters.SECOND_FACTOR_REMOVED)
    out.print(f"removed the second factor of '{name}'; all sessions and API tokens of the account have ended")
