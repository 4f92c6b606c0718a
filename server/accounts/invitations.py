"""Invitations to have an account, and proof that the person signed in is the account's owner."""

from datetime import timedelta

from fastapi.concurrency import run_in_threadpool
from sqlalchemy.orm import Session

from server.accounts import repository, service, signing_in
from server.accounts.audit import record
from server.accounts.credentials import PasswordWork
from server.accounts.identity import Identity
from server.accounts.service import add_account, known_role
from server.accounts.signing_in import begin_session
from server.accounts.throttle import SignInThrottle
from server.accounts.workspace_repository import default_workspace
from server.accounts.workspaces import Membership, find_workspace
from server.core.db import Database
from server.core.errors import Conflict, NotFound
from server.core.settings import Settings
from server.core.values import hash_token, new_token, now
from server.models import DEFAULT_WORKSPACE, Account, Invitation, Role

# Invitations: one-time links by which an owner lets somebody have an account.

INVITATION_DAYS = 7
INVITATION_USED = Conflict("This invitation was already used or has expired. Ask for a new one.")


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
        raise NotFound("This invitation is unknown. Ask for a new one.")
    return invitation


def check_invitation(database: Database, token: str) -> None:
    """NotFound or Conflict where an invitation does not work, before anything is done for it."""
    with database.read() as session:
        invitation = find_invitation(session, token)
        if invitation.used_at is not None or invitation.expires_at <= now():
            raise INVITATION_USED


def accept_invitation(
    database: Database, settings: Settings, token: str, name: str, password_hash: str, user_agent: str
) -> str:
    """Make the invited account and sign it in; return the session's token."""
    with database.write() as session:
        account = invited_account(session, find_invitation(session, token), name, password_hash)
        return begin_session(settings, session, account, user_agent)


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


# The person signed in proves once more to be the account's owner, within the limits of wrong attempts.


async def must_fit(
    database: Database, sign_ins: SignInThrottle, passwords: PasswordWork, me: Identity, password: str
) -> None:
    """Ask for the present password; a stolen session may not try many."""
    key = f"session {me.session_id}"
    await run_in_threadpool(sign_ins.names.check, key)
    stored = await run_in_threadpool(service.own_password, database, me)
    try:
        await passwords.run(lambda: service.must_fit(password, stored))
    except signing_in.WrongCredentials:
        await run_in_threadpool(sign_ins.names.failed, key)
        raise
    await run_in_threadpool(sign_ins.names.succeeded, key)


async def must_prove(
    database: Database,
    settings: Settings,
    sign_ins: SignInThrottle,
    passwords: PasswordWork,
    me: Identity,
    proof: str,
) -> None:
    """Ask for the present password, and where the account has none for a code of its second factor."""
    if await run_in_threadpool(service.own_password, database, me):
        await must_fit(database, sign_ins, passwords, me, proof)
        return
    key = f"session {me.session_id}"
    await run_in_threadpool(sign_ins.names.check, key)
    failure = await run_in_threadpool(service.own_code_failure, database, settings, me, proof)
    if failure is not None:
        await run_in_threadpool(sign_ins.names.failed, key)
        raise failure
    await run_in_threadpool(sign_ins.names.succeeded, key)
