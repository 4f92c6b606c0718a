"""Workspaces and their members."""

from fastapi import APIRouter

from server.accounts.permission import Founder, FreshMyself, Myself, Owner
from server.context import ServicesDep
from server.errors import ERROR_RESPONSES
from server.workspaces import service
from server.workspaces.schemas import ChangeWorkspace, MemberOut, NewWorkspace, SetMember, WorkspaceOut

router = APIRouter(prefix="/api/admin/workspaces", tags=["workspaces"], responses=ERROR_RESPONSES)


@router.get("")
def list_workspaces(services: ServicesDep, identity: Myself) -> list[WorkspaceOut]:
    """The workspaces one belongs to; all of them for who manages the server."""
    with services.database.read() as session:
        return service.listed(session, identity)


@router.post("", status_code=201)
def create_workspace(services: ServicesDep, identity: Founder, body: NewWorkspace) -> list[WorkspaceOut]:
    """Make a workspace and own it; gives the list with it."""
    with services.database.write() as session:
        service.create(session, body.name, body.title, identity)
    return list_workspaces(services, identity)


@router.put("/{workspace}", status_code=204)
def change_workspace(services: ServicesDep, identity: Myself, workspace: str, body: ChangeWorkspace) -> None:
    """Change the title, or whether a second factor is asked for."""
    with services.database.write() as session:
        known = service.managed(session, workspace, identity)
        service.change(session, known, body.title, body.second_factor_required, identity)


@router.delete("/{workspace}", status_code=204)
def delete_workspace(services: ServicesDep, identity: Owner, workspace: str) -> None:
    """Remove a workspace without studies."""
    with services.database.write() as session:
        service.delete(session, service.managed(session, workspace, identity), identity)


@router.get("/{workspace}/members")
def list_members(services: ServicesDep, identity: Myself, workspace: str) -> list[MemberOut]:
    """Who belongs to a workspace; for its owners."""
    with services.database.write() as session:
        return service.members(session, service.managed(session, workspace, identity))


@router.put("/{workspace}/members/{account}", status_code=204)
def set_member(
    services: ServicesDep, identity: FreshMyself, workspace: str, account: str, body: SetMember
) -> None:
    """Take an account into a workspace, or change its role there."""
    with services.database.write() as session:
        service.set_member(
            session, service.managed(session, workspace, identity), account, body.role, identity
        )


@router.delete("/{workspace}/members/{account}", status_code=204)
def remove_member(services: ServicesDep, identity: Myself, workspace: str, account: str) -> None:
    """Take an account out of a workspace; rights granted on single studies stay."""
    with services.database.write() as session:
        service.set_member(session, service.managed(session, workspace, identity), account, None, identity)
