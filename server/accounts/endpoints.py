"""Endpoints of signing in and out: sessions, and accounts made from invitations."""

from typing import Annotated

from fastapi import APIRouter, BackgroundTasks, Cookie, Header, Request, Response
from fastapi.concurrency import run_in_threadpool
from sqlalchemy.orm import Session

from server.accounts import invitations, notices, second_factor, service, signing_in, tokens
from server.accounts.identity import COOKIE, Identity, NotSignedIn, account_of, check_origin, identify
from server.accounts.passwords import checked_password, hash_password
from server.accounts.permission import Myself
from server.accounts.schemas import (
    AccountOut,
    InvitationState,
    Me,
    MyWorkspace,
    NewAccount,
    SessionOut,
    SignIn,
)
from server.accounts.throttle import DEVICE_COOKIE, known_device, new_device
from server.clock import now
from server.context import Services, ServicesDep
from server.errors import ERROR_RESPONSES
from server.models import Account
from server.numbers import Number
from server.workspaces.service import own_workspaces

router = APIRouter(prefix="/api/admin", tags=["account"], responses=ERROR_RESPONSES)
DEVICE_DAYS = 365
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


def set_session_cookie(response: Response, services: Services, token: str) -> None:
    """Give the browser its session; scripts and other sites do not get at it."""
    response.set_cookie(
        COOKIE,
        token,
        max_age=int(services.settings.session_hours * 3600),
        httponly=True,
        samesite="strict",
        secure=services.settings.is_https,
        path="/api/admin",
    )


def _set_device(response: Response, services: Services, name: str) -> None:
    response.set_cookie(
        DEVICE_COOKIE,
        new_device(services.settings.key, name),
        max_age=DEVICE_DAYS * 86400,
        httponly=True,
        samesite="strict",
        secure=services.settings.is_https,
        path="/api/admin/session",
    )


@router.get("/session")
def get_session(request: Request, services: ServicesDep) -> Me:
    """Who is signed in here."""
    try:
        identity: Identity | None = identify(request, services)
    except NotSignedIn:
        identity = None
    with services.database.read() as session:
        if identity is None:
            return Me(account=None, accounts_exist=service.accounts_exist(session))
        return _me(session, account_of(session, identity), second_factor=identity.second_factor)


def _me(session: Session, account: Account, *, second_factor: bool) -> Me:
    belongs = [
        MyWorkspace(
            name=workspace.name,
            title=workspace.title,
            role=role,
            second_factor_needed=workspace.second_factor_required and not second_factor,
        )
        for workspace, role in own_workspaces(session, account.id)
    ]
    return Me(account=account_out(account), workspaces=belongs, accounts_exist=True)


@router.post("/session")
async def sign_in(
    request: Request,
    services: ServicesDep,
    body: SignIn,
    response: Response,
    after: BackgroundTasks,
    user_agent: UserAgent = "",
    device_cookie: Annotated[str | None, Cookie(alias=DEVICE_COOKIE, include_in_schema=False)] = None,
) -> Me:
    """Sign in; sets the session cookie. After some wrong attempts from one place the next must wait."""
    check_origin(request, services)
    token = await attempt(services, body, address_of(request), device_cookie, user_agent)
    set_session_cookie(response, services, token)
    _set_device(response, services, body.name)
    me = await run_in_threadpool(_just_signed_in, services, token)
    notice = _notice(services, body, device_cookie)
    if me.account is not None and notice is not None:
        after.add_task(notices.tell, services, me.account.id, notice)
    return me


def _notice(services: Services, body: SignIn, device_cookie: str | None) -> notices.Notice | None:
    """What of a sign-in its account is told by mail; None of one in a browser as always."""
    if second_factor.is_recovery_code(body.code or ""):
        return notices.RECOVERY_CODE_USED
    known = known_device(services.settings.key, body.name, device_cookie)
    return None if known else notices.NEW_BROWSER


async def attempt(
    services: Services, body: SignIn, address: str, device_cookie: str | None, user_agent: str
) -> str:
    """Check the credentials within the limits; return the token of a new session.

    Names that exist and names that do not take the same steps.
    """
    device = known_device(services.settings.key, body.name, device_cookie)
    throttle = services.sign_ins
    key = throttle.key(body.name, address, device)
    await run_in_threadpool(throttle.enter, key, address, device)
    stored = await run_in_threadpool(signing_in.stored_password, services, body.name)
    checked = await services.passwords.run(lambda: checked_password(body.password, stored))
    fits = checked.stored is not None
    if fits and not device:
        await run_in_threadpool(throttle.codes.check, body.name.casefold())
    token, failure = await run_in_threadpool(
        signing_in.open_session, services, body.name, checked, body.code, user_agent
    )
    if token is not None:
        await run_in_threadpool(throttle.names.succeeded, key)
        await run_in_threadpool(throttle.codes.succeeded, body.name.casefold())
        return token
    if not isinstance(failure, signing_in.SecondFactorRequired):
        await run_in_threadpool(throttle.names.failed, key)
        if fits and not device:
            # Whoever knows the password could else try codes from everywhere.
            await run_in_threadpool(throttle.codes.failed, body.name.casefold())
    raise failure or signing_in.WrongCredentials("Name or password are wrong.")


def address_of(request: Request) -> str:
    """The client's address as the proxy says; neither stored nor logged but as a keyed hash of its range."""
    return request.client.host if request.client else ""


def _just_signed_in(services: Services, token: str) -> Me:
    with services.database.read() as session:
        signed_in = signing_in.session_of(session, token)
        if signed_in is None:
            return Me(account=None, accounts_exist=True)
        return _me(session, signed_in.account, second_factor=signed_in.second_factor)


@router.delete("/session", status_code=204)
def sign_out(services: ServicesDep, me: Myself, response: Response) -> None:
    """End this session."""
    tokens.revoke_session(services.database, me, me.session_id)
    response.delete_cookie(COOKIE, path="/api/admin")


@router.get("/invitations/{token}/state")
def get_invitation(services: ServicesDep, token: str) -> InvitationState:
    """Whether a one-time link still works, and as what."""
    with services.database.read() as session:
        invitation = invitations.find_invitation(session, token)
        expired = "expired" if invitation.expires_at <= now() else "open"
        return InvitationState.model_validate(
            {"role": invitation.role, "status": "used" if invitation.used_at else expired}
        )


@router.post("/invitations/{token}/account", status_code=201)
async def accept_invitation(
    request: Request,
    services: ServicesDep,
    token: str,
    body: NewAccount,
    response: Response,
    user_agent: UserAgent = "",
) -> Me:
    """Use a one-time link: make the account and sign in."""
    check_origin(request, services)
    key = services.sign_ins.key(body.name, address_of(request), None)
    await run_in_threadpool(services.sign_ins.enter, key, address_of(request), None)
    await run_in_threadpool(invitations.check_invitation, services, token)
    fresh = await services.passwords.run(lambda: hash_password(body.password, body.name))
    cookie = await run_in_threadpool(
        invitations.accept_invitation, services, token, body.name, fresh, user_agent
    )
    set_session_cookie(response, services, cookie)
    _set_device(response, services, body.name)
    return await run_in_threadpool(_just_signed_in, services, cookie)


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
            for row in tokens.open_sessions(session, me, services.settings.session_idle)
        ]


@router.delete("/sessions/{session_id}", status_code=204)
def revoke_session(services: ServicesDep, me: Myself, session_id: Number) -> None:
    """Sign another of one's own browsers out."""
    tokens.revoke_session(services.database, me, session_id)
