"""Endpoints of workspaces and their members, and of grants on single studies."""

from fastapi import APIRouter

from server.accounts import workspaces
from server.accounts.access import Founder, FreshMyself, Myself, Owner
from server.accounts.schemas import (
    ChangeWorkspace,
    GrantOut,
    MemberOut,
    MoveStudy,
    NewWorkspace,
    SetGrant,
    SetMember,
    WorkspaceOut,
)
from server.core.errors import ERROR_RESPONSES
from server.core.requests import DatabaseDep
from server.studies.lookup import find_study

# Workspaces and their members.

workspace_router = APIRouter(prefix="/api/admin/workspaces", tags=["workspaces"], responses=ERROR_RESPONSES)


@workspace_router.get("")
def list_workspaces(database: DatabaseDep, identity: Myself) -> list[WorkspaceOut]:
    """The workspaces one belongs to; all of them for people who manage the server."""
    with database.read() as session:
        return workspaces.list_workspaces(session, identity)


@workspace_router.post("", status_code=201)
def create_workspace(database: DatabaseDep, identity: Founder, body: NewWorkspace) -> list[WorkspaceOut]:
    """Make a workspace and own it; gives the list with it."""
    with database.write() as session:
        workspaces.create(session, body.name, body.title, identity)
    return list_workspaces(database, identity)


@workspace_router.put("/{workspace}", status_code=204)
def change_workspace(database: DatabaseDep, identity: Myself, workspace: str, body: ChangeWorkspace) -> None:
    """Change the title, or whether a second factor is asked for."""
    with database.write() as session:
        known = workspaces.managed_workspace(session, workspace, identity)
        workspaces.change(session, known, body.title, body.second_factor_required, identity)


@workspace_router.delete("/{workspace}", status_code=204)
def delete_workspace(database: DatabaseDep, identity: Owner, workspace: str) -> None:
    """Remove a workspace without studies."""
    with database.write() as session:
        workspaces.delete(session, workspaces.managed_workspace(session, workspace, identity), identity)


@workspace_router.get("/{workspace}/members")
def list_members(database: DatabaseDep, identity: Myself, workspace: str) -> list[MemberOut]:
    """Who belongs to a workspace; for its owners."""
    with database.write() as session:
        return workspaces.members(session, workspaces.managed_workspace(session, workspace, identity))


@workspace_router.put("/{workspace}/members/{account}", status_code=204)
def set_member(
    database: DatabaseDep, identity: FreshMyself, workspace: str, account: str, body: SetMember
) -> None:
    """Take an account into a workspace, or change its role there."""
    with database.write() as session:
        workspaces.set_member(
            session, workspaces.managed_workspace(session, workspace, identity), account, body.role, identity
        )


@workspace_router.delete("/{workspace}/members/{account}", status_code=204)
def remove_member(database: DatabaseDep, identity: Myself, workspace: str, account: str) -> None:
    """Take an account out of a workspace; rights granted on single studies stay."""
    with database.write() as session:
        workspaces.set_member(
            session, workspaces.managed_workspace(session, workspace, identity), account, None, identity
        )


# Grants on a study, and the workspace it belongs to: for the study's owners.

grant_router = APIRouter(prefix="/api/admin/studies/{study}", tags=["workspaces"], responses=ERROR_RESPONSES)


@grant_router.get("/grants")
def list_grants(database: DatabaseDep, identity: Myself, study: str) -> list[GrantOut]:
    """The rights granted on a study."""
    with database.read() as session:
        return workspaces.grants_on(session, find_study(session, study, identity, "own"))


@grant_router.put("/grants/{account}", status_code=204)
def set_grant(database: DatabaseDep, identity: FreshMyself, study: str, account: str, body: SetGrant) -> None:
    """Grant an account rights on a study, in addition to those of its role; an empty list takes them back."""
    with database.write() as session:
        workspaces.grant(session, find_study(session, study, identity, "own"), account, body.rights, identity)


@grant_router.put("/workspace", status_code=204)
def move_study(database: DatabaseDep, identity: FreshMyself, study: str, body: MoveStudy) -> None:
    """Put a study into another workspace in which one may make studies."""
    with database.write() as session:
        known = find_study(session, study, identity, "own")
        workspaces.move(session, known, workspaces.workspace_for(session, identity, body.workspace), identity)
