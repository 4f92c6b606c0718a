"""`server workspace`: laboratories on one server, their people, and rights on single studies."""

from typing import Annotated

import typer
from pydantic import TypeAdapter, ValidationError
from rich.table import Table

from experiments.command_groups import command_group
from experiments.errors import InputError
from server.accounts import workspace_repository, workspaces
from server.accounts.identity import OPERATOR
from server.accounts.schemas import WorkspaceName
from server.cli_common import migrated_services, one_of, out, stored_services
from server.models import RIGHTS, ROLES
from server.studies.lookup import find_study

app = command_group("Workspaces: laboratories that share this server.")
WorkspaceArgument = Annotated[str, typer.Argument(help="Name of the workspace.")]
AccountArgument = Annotated[str, typer.Argument(help="Name of the account.")]
StudyArgument = Annotated[str, typer.Argument(help="Name of the study.")]


def register(parent: typer.Typer) -> None:
    """Add `server workspace` to the command line."""
    parent.add_typer(app, name="workspace")


@app.command("list")
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


@app.command("create")
def create(
    name: Annotated[str, typer.Argument(help="Lowercase letters, digits and hyphens.")],
    title: Annotated[str, typer.Option(help="Title that people see; by default, the name.")] = "",
) -> None:
    """Make a workspace.

    Example: server workspace create perception-lab --title "Perception laboratory"
    """
    try:
        TypeAdapter(WorkspaceName).validate_python(name)
    except ValidationError as error:
        raise InputError(f"expected lowercase letters, digits and hyphens, got '{name}'") from error
    with migrated_services() as services, services.database.write() as session:
        workspaces.create(session, name, title or name, OPERATOR)
    out.print(f"workspace {name}: created; next: server workspace member {name} ACCOUNT --role owner")


@app.command("member")
def set_member(
    workspace: WorkspaceArgument,
    account: AccountArgument,
    role: Annotated[str, typer.Option(help="viewer, experimenter or owner.")] = "experimenter",
    remove: Annotated[bool, typer.Option("--remove", help="Remove the account from the workspace.")] = False,
) -> None:
    """Take an account into a workspace, change its role there, or take it out.

    Example: server workspace member perception-lab ada --role owner
    """
    new_role = None if remove else one_of(ROLES, role, "the role")
    with stored_services() as services, services.database.write() as session:
        known = workspaces.managed_workspace(session, workspace, OPERATOR)
        workspaces.set_member(session, known, account, new_role, OPERATOR)
    out.print(f"workspace {workspace}: {account} {'was removed' if remove else f'is {role}'}")


@app.command("grant")
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


@app.command("move")
def move(study: StudyArgument, workspace: WorkspaceArgument) -> None:
    """Put a study into another workspace.

    Example: server workspace move exp3 perception-lab
    """
    with stored_services() as services, services.database.write() as session:
        known = find_study(session, study, OPERATOR, "own")
        workspaces.move(session, known, workspaces.find_workspace(session, workspace), OPERATOR)
    out.print(f"study {study}: in the workspace {workspace}")
