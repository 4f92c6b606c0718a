"""Endpoints for owners: accounts, invitations and the audit log."""

from typing import Annotated

from fastapi import APIRouter, Query

from server.accounts import audit, invitations, service
from server.accounts.endpoints import account_out
from server.accounts.permission import FreshOwner, Owner
from server.accounts.schemas import (
    AccountOut,
    AuditOut,
    ChangeAccount,
    InvitationOut,
    NewInvitation,
    NewInvitationOut,
)
from server.context import ServicesDep
from server.errors import ERROR_RESPONSES
from server.numbers import Number

router = APIRouter(prefix="/api/admin", tags=["people"], responses=ERROR_RESPONSES)


@router.get("/accounts")
def list_accounts(services: ServicesDep, _identity: Owner) -> list[AccountOut]:
    """Every account."""
    with services.database.read() as session:
        return [account_out(row) for row in service.accounts(session)]


@router.patch("/accounts/{account_id}")
def change_account(
    services: ServicesDep, identity: FreshOwner, account_id: Number, body: ChangeAccount
) -> AccountOut:
    """Change a role, or disable an account."""
    return account_out(
        service.change_account(services.database, identity, account_id, body.role, body.disabled)
    )


@router.get("/invitations")
def list_invitations(services: ServicesDep, _identity: Owner) -> list[InvitationOut]:
    """Invitations that have neither been used nor expired."""
    with services.database.read() as session:
        return [InvitationOut.model_validate(row) for row in invitations.open_invitations(session)]


@router.post("/invitations", status_code=201)
def create_invitation(services: ServicesDep, identity: FreshOwner, body: NewInvitation) -> NewInvitationOut:
    """Invite somebody by a one-time link, shown this once."""
    invitation, token = invitations.invite(
        services.database, body.role, body.label, identity, body.workspace, body.workspace_role
    )
    shown = InvitationOut.model_validate(invitation)
    return NewInvitationOut(**shown.model_dump(), url=invitation_url(services.settings.public_url, token))


def invitation_url(public_url: str, token: str) -> str:
    """The page an invited person opens. The token stands behind '#', where no log and no referrer sees it."""
    return f"{public_url}/admin/invitation#{token}"


@router.delete("/invitations/{invitation_id}", status_code=204)
def revoke_invitation(services: ServicesDep, identity: Owner, invitation_id: Number) -> None:
    """Take an invitation back."""
    invitations.revoke_invitation(services.database, identity, invitation_id)


@router.get("/audit")
def list_audit(
    services: ServicesDep,
    _identity: Owner,
    before: Annotated[int | None, Query(ge=1, le=2**62)] = None,
    limit: Annotated[int, Query(ge=1, le=500)] = 100,
) -> list[AuditOut]:
    """The audit log, newest first; `before` pages on."""
    with services.database.read() as session:
        return [AuditOut.model_validate(row) for row in audit.latest(session, before, limit)]
