"""Endpoints of one's own account: signing in and out, sessions, password, second factor, tokens."""

from datetime import timedelta
from typing import Annotated

from fastapi import APIRouter, Header, Request, Response
from sqlalchemy import select

from server.accounts import second_factor, service
from server.accounts.audit import record
from server.accounts.identity import COOKIE, Identity, Myself, NotSignedIn, account_of, check_origin, identify
from server.accounts.schemas import (
    AccountOut,
    ChangePassword,
    ConfirmCode,
    ConfirmPassword,
    InvitationState,
    Me,
    NewAccount,
    NewToken,
    NewTokenOut,
    RecoveryCodes,
    SecondFactorSetup,
    SessionOut,
    SignIn,
    TokenOut,
)
from server.clock import now
from server.context import Services, ServicesDep
from server.errors import ERROR_RESPONSES, NotFound
from server.models import Account, AdminSession, ApiToken
from server.tokens import hash_token, new_token

router = APIRouter(prefix="/api/admin", tags=["account"], responses=ERROR_RESPONSES)
UserAgent = Annotated[str, Header(include_in_schema=False)]


def account_out(account: Account) -> AccountOut:
    """An account without its secrets."""
    return AccountOut(
        id=account.id,
        name=account.name,
        role=service.known_role(account.role),
        second_factor=account.totp_confirmed_at is not None,
        disabled=account.disabled_at is not None,
        created_at=account.created_at,
    )


def _set_cookie(response: Response, services: Services, token: str) -> None:
    response.set_cookie(
        COOKIE,
        token,
        max_age=int(services.settings.session_hours * 3600),
        httponly=True,
        samesite="strict",
        secure=services.settings.is_https,
        path="/api/admin",
    )


@router.get("/session")
def get_session(request: Request, services: ServicesDep) -> Me:
    """Who is signed in here."""
    try:
        identity: Identity | None = identify(request, services)
    except NotSignedIn:
        identity = None
    with services.database.read() as session:
        account = account_out(account_of(session, identity)) if identity else None
        return Me(account=account, accounts_exist=service.accounts_exist(session))


@router.post("/session")
def sign_in(
    request: Request, services: ServicesDep, body: SignIn, response: Response, user_agent: UserAgent = ""
) -> Me:
    """Sign in; sets the session cookie. Ten wrong passwords lock the account for a while."""
    check_origin(request, services)
    services.sign_ins.hit(body.name.casefold())
    token = service.sign_in(services, body.name, body.password, body.code, user_agent)
    _set_cookie(response, services, token)
    with services.database.read() as session:
        found = session.scalar(select(AdminSession).where(AdminSession.token_hash == hash_token(token)))
        return Me(account=account_out(found.account) if found else None, accounts_exist=True)


@router.delete("/session", status_code=204)
def sign_out(services: ServicesDep, me: Myself, response: Response) -> None:
    """End this session."""
    _revoke_session(services, me, me.session_id)
    response.delete_cookie(COOKIE, path="/api/admin")


@router.get("/invitations/{token}/state")
def get_invitation(services: ServicesDep, token: str) -> InvitationState:
    """Whether a one-time link still works, and as what."""
    with services.database.read() as session:
        found = service.find_invitation(session, token)
        expired = "expired" if found.expires_at <= now() else "open"
        return InvitationState.model_validate(
            {"role": found.role, "status": "used" if found.used_at else expired}
        )


@router.post("/invitations/{token}/account", status_code=201)
def accept_invitation(
    request: Request,
    services: ServicesDep,
    token: str,
    body: NewAccount,
    response: Response,
    user_agent: UserAgent = "",
) -> Me:
    """Use a one-time link: make the account and sign in."""
    check_origin(request, services)
    cookie = service.accept_invitation(services, token, body.name, body.password, user_agent)
    _set_cookie(response, services, cookie)
    with services.database.read() as session:
        found = session.scalar(select(AdminSession).where(AdminSession.token_hash == hash_token(cookie)))
        return Me(account=account_out(found.account) if found else None, accounts_exist=True)


@router.get("/sessions")
def list_sessions(services: ServicesDep, me: Myself) -> list[SessionOut]:
    """One's own signed-in browsers, the latest first."""
    with services.database.read() as session:
        return [
            SessionOut(
                id=row.id,
                current=row.id == me.session_id,
                user_agent=row.user_agent,
                created_at=row.created_at,
                last_seen_at=row.last_seen_at,
                expires_at=row.expires_at,
            )
            for row in service.open_sessions(session, me)
        ]


@router.delete("/sessions/{session_id}", status_code=204)
def revoke_session(services: ServicesDep, me: Myself, session_id: int) -> None:
    """Sign another of one's own browsers out."""
    _revoke_session(services, me, session_id)


def _revoke_session(services: Services, me: Identity, session_id: int | None) -> None:
    with services.database.write() as session:
        row = session.get(AdminSession, session_id)
        if row is None or row.account_id != me.account_id:
            raise NotFound("There is no such session.")
        row.revoked_at = row.revoked_at or now()
        record(session, me, "session ended", "session", str(session_id))


@router.put("/password", status_code=204)
def change_password(services: ServicesDep, me: Myself, body: ChangePassword) -> None:
    """Change the password; every other session ends."""
    service.change_password(services, me, body.password, body.new_password)


@router.post("/second-factor")
def start_second_factor(services: ServicesDep, me: Myself) -> SecondFactorSetup:
    """Begin the set-up of a second factor: a secret for an authenticator app."""
    secret = service.start_second_factor(services, me)
    uri = second_factor.provisioning_uri(secret, me.name)
    return SecondFactorSetup(secret=secret, uri=uri, qr_svg=second_factor.qr_svg(uri))


@router.put("/second-factor")
def confirm_second_factor(services: ServicesDep, me: Myself, body: ConfirmCode) -> RecoveryCodes:
    """Turn the second factor on with the app's first code; gives the recovery codes, this once."""
    return RecoveryCodes(codes=service.confirm_second_factor(services, me, body.code))


@router.delete("/second-factor", status_code=204)
def remove_second_factor(services: ServicesDep, me: Myself, body: ConfirmPassword) -> None:
    """Turn the second factor off."""
    service.remove_second_factor(services, me, body.password)


@router.get("/tokens")
def list_tokens(services: ServicesDep, me: Myself) -> list[TokenOut]:
    """One's own API tokens."""
    with services.database.read() as session:
        query = select(ApiToken).where(ApiToken.account_id == me.account_id, ApiToken.revoked_at.is_(None))
        return [TokenOut.model_validate(row) for row in session.scalars(query.order_by(ApiToken.id))]


@router.post("/tokens", status_code=201)
def create_token(services: ServicesDep, me: Myself, body: NewToken) -> NewTokenOut:
    """Make an API token; its secret is shown this once. It can do no more than the account."""
    secret = new_token()
    with services.database.write() as session:
        row = ApiToken(
            account_id=me.account_id,
            name=body.name,
            token_hash=hash_token(secret),
            scopes=sorted(set(body.scopes)),
            expires_at=now() + timedelta(days=body.days) if body.days else None,
        )
        session.add(row)
        session.flush()
        record(session, me, "token created", "token", body.name, scopes=row.scopes)
        return NewTokenOut(**TokenOut.model_validate(row).model_dump(), token=secret)


@router.delete("/tokens/{token_id}", status_code=204)
def revoke_token(services: ServicesDep, me: Myself, token_id: int) -> None:
    """Revoke one's own API token."""
    with services.database.write() as session:
        row = session.get(ApiToken, token_id)
        if row is None or row.account_id != me.account_id:
            raise NotFound("There is no such token.")
        row.revoked_at = row.revoked_at or now()
        record(session, me, "token revoked", "token", row.name)
