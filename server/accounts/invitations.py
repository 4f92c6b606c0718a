"""Invitations: one-time links by which an owner lets somebody have an account."""

from datetime import timedelta

from sqlalchemy.orm import Session

from server.accounts import repository
from server.accounts.audit import record
from server.accounts.identity import Identity
from server.accounts.service import add_account, known_role
from server.accounts.signing_in import begin_session
from server.clock import now
from server.context import Services
from server.db import Database
from server.errors import Conflict, NotFound
from server.models import DEFAULT_WORKSPACE, Account, Invitation, Role
from server.tokens import hash_token, new_token
from server.workspaces.repository import default_workspace
from server.workspaces.service import Membership, find_workspace

INVITATION_DAYS = 7
INVITATION_USED = Conflict("This invitation was used or has expired; ask for a new one.")


def invite(
    database: Database,
    role: Role,
    label: str,
    inviter: Identity | None,
    workspace: str | None = None,
    workspace_role: Role | None = None,
) -> tuple[Invitation, str]:
    """Make a one-time link's token; only its hash is kept. For the arguments see `Invitation`."""
    token = new_token()
    with database.write() as session:
        belongs = find_workspace(session, workspace) if workspace is not None else None
        invitation = Invitation(
            token_hash=hash_token(token),
            role=role,
            workspace_id=belongs.id if belongs else None,
            workspace_role=workspace_role,
            label=label,
            created_by=inviter.account_id if inviter else None,
            expires_at=now() + timedelta(days=INVITATION_DAYS),
        )
        session.add(invitation)
        session.flush()
        record(
            session, inviter, "invited", "invitation", label, role=role,
            workspace=workspace or DEFAULT_WORKSPACE,
        )  # fmt: skip
    return invitation, token


def open_invitations(session: Session) -> list[Invitation]:
    """Invitations that have neither been used nor expired."""
    return repository.open_invitations(session)


def revoke_invitation(database: Database, owner: Identity, invitation_id: int) -> None:
    """Take an invitation back; NotFound where there is none."""
    with database.write() as session:
        row = repository.invitation(session, invitation_id)
        if row is None:
            raise NotFound("There is no such invitation.")
        record(session, owner, "invitation revoked", "invitation", row.label)
        session.delete(row)


def find_invitation(session: Session, token: str) -> Invitation:
    """The invitation of a token; NotFound where it is unknown."""
    invitation = repository.invitation_by_token(session, hash_token(token))
    if invitation is None:
        raise NotFound("This invitation is unknown; ask for a new one.")
    return invitation


def check_invitation(services: Services, token: str) -> None:
    """NotFound or Conflict where an invitation does not work, before anything is done for it."""
    with services.database.read() as session:
        invitation = find_invitation(session, token)
        if invitation.used_at is not None or invitation.expires_at <= now():
            raise INVITATION_USED


def accept_invitation(services: Services, token: str, name: str, password_hash: str, user_agent: str) -> str:
    """Make the invited account and sign it in; return the session's token."""
    with services.database.write() as session:
        account = invited_account(session, find_invitation(session, token), name, password_hash)
        return begin_session(services, session, account, user_agent)


def invited_account(
    session: Session, invitation: Invitation | None, name: str, password_hash: str
) -> Account:
    """Use an invitation up and make its account; Conflict where it was used or taken back meanwhile."""
    if invitation is None or not repository.use_invitation(session, invitation.id):
        raise INVITATION_USED
    role = known_role(invitation.role)
    workspace = repository.workspace_of(session, invitation) or default_workspace(session)
    membership = Membership(workspace, known_role(invitation.workspace_role or invitation.role))
    return add_account(session, name, password_hash, role, membership)
