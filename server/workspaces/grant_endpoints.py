"""Grants on a study, and the workspace it belongs to: for who owns the study."""

from fastapi import APIRouter

from server.accounts.permission import FreshMyself, Myself
from server.context import ServicesDep
from server.errors import ERROR_RESPONSES
from server.studies.lookup import find_study
from server.workspaces import service
from server.workspaces.schemas import GrantOut, MoveStudy, SetGrant

router = APIRouter(prefix="/api/admin/studies/{study}", tags=["workspaces"], responses=ERROR_RESPONSES)


@router.get("/grants")
def list_grants(services: ServicesDep, identity: Myself, study: str) -> list[GrantOut]:
    """The rights granted on a study."""
    with services.database.read() as session:
        return service.grants_on(session, find_study(session, study, identity, "own"))


@router.put("/grants/{account}", status_code=204)
def set_grant(services: ServicesDep, identity: FreshMyself, study: str, account: str, body: SetGrant) -> None:
    """Grant an account rights on a study, beside those it has by its role; an empty list takes them back."""
    with services.database.write() as session:
        service.grant(session, find_study(session, study, identity, "own"), account, body.rights, identity)


@router.put("/workspace", status_code=204)
def move_study(services: ServicesDep, identity: FreshMyself, study: str, body: MoveStudy) -> None:
    """Put a study into another workspace in which one may make studies."""
    with services.database.write() as session:
        known = find_study(session, study, identity, "own")
        service.move(session, known, service.workspace_for(session, identity, body.workspace), identity)
