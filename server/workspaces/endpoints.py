"""Workspaces and their members."""

from fastapi import APIRouter

from server.accounts.identity import Founder, Myself, Owner
from server.context import ServicesDep
from server.errors import ERROR_RESPONSES
from server.workspaces import service
from server.workspaces.schemas import ChangeWorkspace, MemberOut, NewWorkspace, SetMember, WorkspaceOut

router = APIRouter(prefix="/api/admin/workspaces", tags=["workspaces"], responses=ERROR_RESPONSES)


@router.get("")
def list_workspaces(services: ServicesDep, who: Myself) -> list[WorkspaceOut]:
    """The workspaces one belongs to; all of them for who manages the server."""
    with services.database.read() as session:
        return service.listed(session, who)


@router.post("", status_code=201)
def create_workspace(services: ServicesDep, who: Founder, body: NewWorkspace) -> list[WorkspaceOut]:
    """Make a workspace and own it; gives the list with it."""
    with services.database.write() as session:
        service.create(session, body.name, body.title, who)
    return list_workspaces(services, who)


@router.put("/{workspace}", status_code=204)
def change_workspace(services: ServicesDep, who: Myself, workspace: str, body: ChangeWorkspace) -> None:
    """Change the title, or whether a second factor is asked for."""
    with services.database.write() as session:
        found = service.managed(session, workspace, who)
        service.change(session, found, body.title, body.second_factor_required, who)


@router.delete("/{workspace}", status_code=204)
def delete_workspace(services: ServicesDep, who: Owner, workspace: str) -> None:
    """Remove a workspace without studies."""
    with services.database.write() as session:
        service.delete(session, service.managed(session, workspace, who), who)


@router.get("/{workspace}/members")
def list_members(services: ServicesDep, who: Myself, workspace: str) -> list[MemberOut]:
    """Who belongs to a workspace; for its owners."""
    with services.database.write() as session:
        return service.members(session, service.managed(session, workspace, who))


@router.put("/{workspace}/members/{account}", status_code=204)
def set_member(services: ServicesDep, who: Myself, workspace: str, account: str, body: SetMember) -> None:
    """Take an account into a workspace, or change its role there."""
    with services.database.write() as session:
        service.set_member(session, service.managed(session, workspace, who), account, body.role, who)


@router.delete("/{workspace}/members/{account}", status_code=204)
def remove_member(services: ServicesDep, who: Myself, workspace: str, account: str) -> None:
    """Take an account out of a workspace; rights granted on single studies stay."""
    with services.database.write() as session:
        service.set_member(session, service.managed(session, workspace, who), account, None, who)
