"""What is open in one's own name: signed-in browsers and API tokens."""

from datetime import timedelta

from sqlalchemy.orm import Session

from server.accounts import repository
from server.accounts.audit import record
from server.accounts.identity import Identity
from server.clock import now
from server.db import Database
from server.errors import NotFound
from server.models import AdminSession, ApiToken
from server.tokens import hash_token, new_token


def open_sessions(session: Session, owner: Identity, idle: timedelta) -> list[AdminSession]:
    """One's own sessions that are neither revoked nor expired, nor unused for longer than `idle`."""
    return repository.open_sessions(session, owner.account_id, now() - idle)


def revoke_session(database: Database, owner: Identity, session_id: int | None) -> None:
    """Sign one of one's own browsers out; NotFound where it is somebody else's."""
    with database.write() as session:
        row = repository.session_of(session, owner.account_id, session_id)
        if row is None:
            raise NotFound("There is no such session.")
        row.revoked_at = row.revoked_at or now()
        record(session, owner, "session ended", "session", str(session_id))


def open_tokens(session: Session, owner: Identity) -> list[ApiToken]:
    """One's own API tokens that are not revoked."""
    return [token for token in repository.tokens(session, owner.account_id) if token.revoked_at is None]


def create_token(
    session: Session, owner: Identity, name: str, scopes: list[str], days: int
) -> tuple[ApiToken, str]:
    """Make an API token and its secret, of which only the hash is kept; it ends after `days`."""
    secret = new_token()
    row = ApiToken(
        account_id=owner.account_id,
        name=name,
        token_hash=hash_token(secret),
        scopes=sorted(set(scopes)),
        expires_at=now() + timedelta(days=days),
    )
    session.add(row)
    session.flush()
    record(session, owner, "token created", "token", name, scopes=row.scopes)
    return row, secret


def revoke_token(database: Database, owner: Identity, token_id: int) -> None:
    """Revoke one of one's own API tokens; NotFound where it is somebody else's."""
    with database.write() as session:
        row = repository.token_of(session, owner.account_id, token_id)
        if row is None:
            raise NotFound("There is no such token.")
        row.revoked_at = row.revoked_at or now()
        record(session, owner, "token revoked", "token", row.name)


def end_everything(session: Session, account_id: int, keep_session: int | None = None) -> None:
    """End the sessions of an account, but for one, revoke its API tokens, and take back what is under way.

    Whoever was in a stolen session may have asked for a link that makes an address of hers the account's, or
    begun to add a login of hers.
    """
    repository.hold(session, account_id)
    for row in repository.sessions(session, account_id):
        if row.id != keep_session:
            row.revoked_at = row.revoked_at or now()
    for token in repository.tokens(session, account_id):
        token.revoked_at = token.revoked_at or now()
    repository.forget_under_way(session, account_id)
