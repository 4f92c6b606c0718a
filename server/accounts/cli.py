"""`server admin`, `account`, `audit` and `workspace`: accounts, the audit log, and laboratories."""

import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import typer
from pydantic import TypeAdapter, ValidationError
from rich.console import Console
from rich.table import Table

from experiments.command_groups import command_group
from experiments.errors import InputError
from experiments.files import whole_file
from server.accounts import invitations, letters, repository, service, workspace_repository, workspaces
from server.accounts.audit import export_line, verify
from server.accounts.credentials import hash_password
from server.accounts.endpoints import invitation_url
from server.accounts.identity import OPERATOR
from server.accounts.schemas import WorkspaceName
from server.cli_common import migrated_services, one_of, out, stored_services
from server.core.db import Database, open_database
from server.core.errors import ApiError
from server.core.settings import Settings
from server.models import RIGHTS, ROLES
from server.studies.lookup import find_study

app = command_group("Accounts of experimenters.")
account_app = command_group("Restore access for someone who lost a password or a phone.")
audit_app = command_group("The audit log: verify its chain of hashes, export it.")
workspace_app = command_group("Workspaces: laboratories that share this server.")


def register(parent: typer.Typer) -> None:
    """Add the four groups of commands."""
    parent.add_typer(app, name="admin")
    parent.add_typer(account_app, name="account")
    parent.add_typer(audit_app, name="audit")
    parent.add_typer(workspace_app, name="workspace")


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
    """Print a one-time link for creating an account.

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
    """Set a new password for an account; its sessions, API tokens and logins by providers end.

    The audit log records it. An account that had no password keeps its logins.

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
    """Turn off an account's second factor, if phone and recovery codes are lost.

    Its sessions and API tokens end, and the audit log records it. First verify who is asking.
    Example: server account reset-second-factor ada
    """
    with stored_services() as services:
        with services.database.write() as session:
            account_id = service.reset_second_factor(session, name)
        letters.send_notice(services.database, services.settings, account_id, letters.SECOND_FACTOR_REMOVED)
    out.print(f"removed the second factor of '{name}'; all sessions and API tokens of the account have ended")


# `server audit`: prove that the audit log is whole, and take it out.


@audit_app.command("verify")
def verify_chain(
    head: Annotated[
        str, typer.Option(help="POSITION:HASH kept from an earlier verification, export or syslog.")
    ] = "",
) -> None:
    """Check the chain of hashes; if it is broken, report the first wrong entry, with exit code 2.

    Store the printed head elsewhere: with --head, the next check detects whether entries were cut off.

    Examples:

      server audit verify

      server audit verify --head 412:9f2c...
    """
    kept = _head(head) if head else None
    with stored_services() as services, services.database.snapshot() as session:
        chain = verify(session, services.settings.key, kept)
    if chain.broken is not None:
        raise InputError(f"the audit log is broken: {chain.broken}")
    notes = [f"{chain.position} entries in the chain"]
    notes += (
        [f"details of {chain.erased} entries erased with the data of participants"] if chain.erased else []
    )
    notes += [f"{chain.before} rows from before the chain existed"] if chain.before else []
    out.print(f"intact: {', '.join(notes)}\nhead {chain.position}:{chain.hash}")


def _head(text: str) -> tuple[int, str]:
    position, _, digest = text.partition(":")
    if not position.isdigit() or len(digest) != 64:
        raise InputError(
            f"--head: expected POSITION:HASH as `server audit verify` prints it, got '{text[:80]}'"
        )
    return int(position), digest


@audit_app.command("export")
def export(
    out_file: Annotated[Path, typer.Option("--out", help="File to write; - for the terminal.")] = Path("-"),
    after: Annotated[int, typer.Option(min=0, help="Omit entries up to this position.")] = 0,
) -> None:
    """Write the entries as JSON lines; the last line confirms completeness and has the head of the chain.

    Example: server audit export --out audit.ndjson
    """
    with stored_services() as services:
        if str(out_file) == "-":
            sys.stdout.writelines(_lines(services.database, after))
            return
        with whole_file(out_file) as unfinished, unfinished.open("w", encoding="utf-8") as stream:
            stream.writelines(_lines(services.database, after))


def _lines(database: Database, after: int) -> Iterator[str]:
    with database.snapshot() as session:
        number = 0
        for entry in repository.chained_entries(session, after):
            number += 1
            yield json.dumps(export_line(entry)) + "\n"
        position, digest = repository.last_link(session) or (0, "")
        yield json.dumps({"complete": True, "entries": number, "head": f"{position}:{digest}"}) + "\n"


# `server workspace`: laboratories on one server, their people, and rights on single studies.

WorkspaceArgument = Annotated[str, typer.Argument(help="Name of the workspace.")]
AccountArgument = Annotated[str, typer.Argument(help="Name of the account.")]
StudyArgument = Annotated[str, typer.Argument(help="Name of the study.")]


@workspace_app.command("list")
def list_workspaces() -> None:
    """List the workspaces with their members and number of studies.

    Example: server workspace list
    """
    with stored_services() as services, services.database.read() as session:
        table = Table("workspace", "title", "studies", "second factor", "members")
        counts = workspace_repository.counts(session)
        for one in workspace_repository.every_workspace(session):
            people = ", ".join(
                f"{account.name} ({role})" for account, role in workspace_repository.members(session, one)
            )
            needed = "required" if one.second_factor_required else ""
            table.add_row(one.name, one.title, str(counts.get(one.id, (0, 0))[1]), needed, people)
        out.print(
            table if table.row_count else "no workspaces yet; the first account or study creates 'default'"
        )


@workspace_app.command("create")
def create_workspace(
    name: Annotated[str, typer.Argument(help="Lowercase letters, digits and hyphens.")],
    title: Annotated[str, typer.Option(help="Title that people see; by default, the name.")] = "",
) -> None:
    """Create a workspace.

    Example: server workspace create perception-lab --title "Perception laboratory"
    """
    try:
        TypeAdapter(WorkspaceName).validate_python(name)
    except ValidationError as error:
        raise InputError(f"expected lowercase letters, digits and hyphens, got '{name}'") from error
    with migrated_services() as services, services.database.write() as session:
        workspaces.create(session, name, title or name, OPERATOR)
    out.print(f"workspace {name}: created; next: server workspace member {name} ACCOUNT --role owner")


@workspace_app.command("member")
def set_member(
    workspace: WorkspaceArgument,
    account: AccountArgument,
    role: Annotated[str, typer.Option(help="viewer, experimenter or owner.")] = "experimenter",
    remove: Annotated[bool, typer.Option("--remove", help="Remove the account from the workspace.")] = False,
) -> None:
    """Add an account to a workspace, change its role there, or remove it.

    Example: server workspace member perception-lab ada --role owner
    """
    new_role = None if remove else one_of(ROLES, role, "the role")
    with stored_services() as services, services.database.write() as session:
        known = workspaces.managed_workspace(session, workspace, OPERATOR)
        workspaces.set_member(session, known, account, new_role, OPERATOR)
    out.print(f"workspace {workspace}: {account} {'was removed' if remove else f'is {role}'}")


@workspace_app.command("grant")
def grant(
    study: StudyArgument,
    account: AccountArgument,
    rights: Annotated[str, typer.Option(help="Any of view,run,edit,export,own; empty for none.")],
) -> None:
    """Give an account rights on one study, in addition to those of its role in the workspace.

    Example: server workspace grant exp3 ada --rights view,export
    """
    given = [one_of(RIGHTS, word.strip(), "rights of") for word in rights.split(",") if word.strip()]
    with stored_services() as services, services.database.write() as session:
        workspaces.grant(session, find_study(session, study, OPERATOR, "own"), account, given, OPERATOR)
    out.print(f"study {study}: {account} may {', '.join(given) or 'do what the role allows'}")


@workspace_app.command("move")
def move(study: StudyArgument, workspace: WorkspaceArgument) -> None:
    """Move a study to another workspace.

    Example: server workspace move exp3 perception-lab
    """
    with stored_services() as services, services.database.write() as session:
        known = find_study(session, study, OPERATOR, "own")
        workspaces.move(session, known, workspaces.find_workspace(session, workspace), OPERATOR)
    out.print(f"study {study}: in the workspace {workspace}")
