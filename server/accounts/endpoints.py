"""Endpoints of signing in and out, own credentials, forgotten passwords, and owners over accounts."""

from typing import Annotated

from fastapi import APIRouter, BackgroundTasks, Cookie, Header, Query, Request, Response
from fastapi.concurrency import run_in_threadpool
from sqlalchemy.orm import Session

from server.accounts import audit, credentials, invitations, letters, resets, service, signing_in
from server.accounts.access import (
    COOKIE,
    FreshMyself,
    FreshOwner,
    Myself,
    Owner,
    account_of,
    check_origin,
    identify,
)
from server.accounts.credentials import PasswordWork, checked_password, hash_password
from server.accounts.identity import Identity, NotSignedIn
from server.accounts.invitations import must_fit, must_prove
from server.accounts.resets import LetterRequest
from server.accounts.schemas import (
    AccountOut,
    AuditOut,
    ChangeAccount,
    ChangePassword,
    ConfirmAddress,
    ConfirmCode,
    ConfirmPassword,
    ForgottenPassword,
    InvitationOut,
    InvitationState,
    Me,
    MyWorkspace,
    NewAccount,
    NewAddress,
    NewInvitation,
    NewInvitationOut,
    NewPassword,
    NewToken,
    NewTokenOut,
    OwnAddress,
    RecoveryCodes,
    SecondFactorSetup,
    SessionOut,
    SignIn,
    TokenOut,
)
from server.accounts.throttle import DEVICE_COOKIE, SignInThrottle, known_device, new_device
from server.accounts.workspaces import own_workspaces
from server.context import ServicesDep
from server.core.db import Database
from server.core.errors import ERROR_RESPONSES, NotFound
from server.core.requests import DatabaseDep, SettingsDep
from server.core.settings import Settings
from server.core.values import Number, now
from server.models import Account

# Endpoints of signing in and out: sessions, and accounts made from invitations.

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


def set_session_cookie(response: Response, settings: Settings, token: str) -> None:
    """Give the browser its session; scripts and other sites do not get at it."""
    response.set_cookie(
        COOKIE,
        token,
        max_age=int(settings.session_hours * 3600),
        httponly=True,
        samesite="strict",
        secure=settings.is_https,
        path="/api/admin",
    )


def _set_device(response: Response, settings: Settings, name: str) -> None:
    response.set_cookie(
        DEVICE_COOKIE,
        new_device(settings.key, name),
        max_age=DEVICE_DAYS * 86400,
        httponly=True,
        samesite="strict",
        secure=settings.is_https,
        path="/api/admin/session",
    )


@router.get("/session")
def get_session(request: Request, database: DatabaseDep, settings: SettingsDep) -> Me:
    """Who is signed in here."""
    try:
        identity: Identity | None = identify(request, database, settings)
    except NotSignedIn:
        identity = None
    with database.read() as session:
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
    check_origin(request, services.settings)
    token = await attempt(
        services.database,
        services.settings,
        services.sign_ins,
        services.passwords,
        body,
        address_of(request),
        device_cookie,
        user_agent,
    )
    set_session_cookie(response, services.settings, token)
    _set_device(response, services.settings, body.name)
    me = await run_in_threadpool(_just_signed_in, services.database, token)
    notice = _notice(services.settings, body, device_cookie)
    if me.account is not None and notice is not None:
        after.add_task(letters.send_notice, services.database, services.settings, me.account.id, notice)
    return me


def _notice(settings: Settings, body: SignIn, device_cookie: str | None) -> letters.Notice | None:
    """What the account is notified of by mail; None for a sign-in in a known browser."""
    if credentials.is_recovery_code(body.code or ""):
        return letters.RECOVERY_CODE_USED
    known = known_device(settings.key, body.name, device_cookie)
    return None if known else letters.NEW_BROWSER


async def attempt(
    database: Database,
    settings: Settings,
    sign_ins: SignInThrottle,
    passwords: PasswordWork,
    body: SignIn,
    address: str,
    device_cookie: str | None,
    user_agent: str,
) -> str:
    """Check the credentials within the limits; return the token of a new session.

    Names that exist and names that do not take the same steps.
    """
    device = known_device(settings.key, body.name, device_cookie)
    throttle = sign_ins
    key = throttle.key(body.name, address, device)
    await run_in_threadpool(throttle.enter, key, address, device)
    stored = await run_in_threadpool(signing_in.stored_password, database, body.name)
    checked = await passwords.run(lambda: checked_password(body.password, stored))
    fits = checked.stored is not None
    if fits and not device:
        await run_in_threadpool(throttle.codes.check, body.name.casefold())
    token, failure = await run_in_threadpool(
        signing_in.open_session, database, settings, sign_ins, body.name, checked, body.code, user_agent
    )
    if token is not None:
        await run_in_threadpool(throttle.names.succeeded, key)
        await run_in_threadpool(throttle.codes.succeeded, body.name.casefold())
        return token
    if not isinstance(failure, signing_in.SecondFactorRequired):
        await run_in_threadpool(throttle.names.failed, key)
        if fits and not device:
            # Otherwise anyone who knows the password could try codes from everywhere.
            await run_in_threadpool(throttle.codes.failed, body.name.casefold())
    raise failure or signing_in.WrongCredentials("Name or password is wrong.")


def address_of(request: Request) -> str:
    """The client's address as the proxy says; neither stored nor logged but as a keyed hash of its range."""
    return request.client.host if request.client else ""


def _just_signed_in(database: Database, token: str) -> Me:
    with database.read() as session:
        signed_in = signing_in.session_of(session, token)
        if signed_in is None:
            return Me(account=None, accounts_exist=True)
        return _me(session, signed_in.account, second_factor=signed_in.second_factor)


@router.delete("/session", status_code=204)
def sign_out(database: DatabaseDep, me: Myself, response: Response) -> None:
    """End this session."""
    service.revoke_session(database, me, me.session_id)
    response.delete_cookie(COOKIE, path="/api/admin")


@router.get("/invitations/{token}/state")
def get_invitation(database: DatabaseDep, token: str) -> InvitationState:
    """Whether a one-time link still works, and as what."""
    with database.read() as session:
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
    check_origin(request, services.settings)
    key = services.sign_ins.key(body.name, address_of(request), None)
    await run_in_threadpool(services.sign_ins.enter, key, address_of(request), None)
    await run_in_threadpool(invitations.check_invitation, services.database, token)
    fresh = await services.passwords.run(lambda: hash_password(body.password, body.name))
    cookie = await run_in_threadpool(
        invitations.accept_invitation,
        services.database,
        services.settings,
        token,
        body.name,
        fresh,
        user_agent,
    )
    set_session_cookie(response, services.settings, cookie)
    _set_device(response, services.settings, body.name)
    return await run_in_threadpool(_just_signed_in, services.database, cookie)


@router.get("/sessions")
def list_sessions(database: DatabaseDep, settings: SettingsDep, me: Myself) -> list[SessionOut]:
    """One's own signed-in browsers, the latest first."""
    with database.read() as session:
        return [
            SessionOut(
                id=row.id,
                current=row.id == me.session_id,
                user_agent=row.user_agent,
                created_at=row.created_at,
                last_seen_at=row.last_seen_at,
                expires_at=row.expires_at,
            )
            for row in service.open_sessions(session, me, settings.session_idle)
        ]


@router.delete("/sessions/{session_id}", status_code=204)
def revoke_session(database: DatabaseDep, me: Myself, session_id: Number) -> None:
    """Sign out another browser of the same account."""
    service.revoke_session(database, me, session_id)


# Endpoints for owners: accounts, invitations and the audit log.

people_router = APIRouter(prefix="/api/admin", tags=["people"], responses=ERROR_RESPONSES)


@people_router.get("/accounts")
def list_accounts(database: DatabaseDep, _identity: Owner) -> list[AccountOut]:
    """Every account."""
    with database.read() as session:
        return [account_out(row) for row in service.accounts(session)]


@people_router.patch("/accounts/{account_id}")
def change_account(
    database: DatabaseDep, identity: FreshOwner, account_id: Number, body: ChangeAccount
) -> AccountOut:
    """Change a role, or disable an account."""
    return account_out(service.change_account(database, identity, account_id, body.role, body.disabled))


@people_router.get("/invitations")
def list_invitations(database: DatabaseDep, _identity: Owner) -> list[InvitationOut]:
    """Invitations that have neither been used nor expired."""
    with database.read() as session:
        return [InvitationOut.model_validate(row) for row in invitations.open_invitations(session)]


@people_router.post("/invitations", status_code=201)
def create_invitation(
    database: DatabaseDep, settings: SettingsDep, identity: FreshOwner, body: NewInvitation
) -> NewInvitationOut:
    """Invite somebody by a one-time link, shown this once."""
    invitation, token = invitations.invite(
        database, body.role, body.label, identity, body.workspace, body.workspace_role
    )
    shown = InvitationOut.model_validate(invitation)
    return NewInvitationOut(**shown.model_dump(), url=invitation_url(settings.public_url, token))


def invitation_url(public_url: str, token: str) -> str:
    """The page an invited person opens. The token comes after '#', where no log and no referrer sees it."""
    return f"{public_url}/admin/invitation#{token}"


@people_router.delete("/invitations/{invitation_id}", status_code=204)
def revoke_invitation(database: DatabaseDep, identity: Owner, invitation_id: Number) -> None:
    """Take an invitation back."""
    invitations.revoke_invitation(database, identity, invitation_id)


@people_router.get("/audit")
def list_audit(
    database: DatabaseDep,
    _identity: Owner,
    before: Annotated[int | None, Query(ge=1, le=2**62)] = None,
    limit: Annotated[int, Query(ge=1, le=500)] = 100,
) -> list[AuditOut]:
    """The audit log, newest first; `before` pages on."""
    with database.read() as session:
        return [AuditOut.model_validate(row) for row in audit.latest(session, before, limit)]


# Endpoints of what one signs in with: password, second factor, API tokens.

credential_router = APIRouter(prefix="/api/admin", tags=["account"], responses=ERROR_RESPONSES)


@credential_router.put("/password", status_code=204)
async def change_password(
    services: ServicesDep, me: Myself, body: ChangePassword, after: BackgroundTasks
) -> None:
    """Change the password; every other session and every API token ends."""
    await must_fit(services.database, services.sign_ins, services.passwords, me, body.password)
    fresh = await services.passwords.run(lambda: hash_password(body.new_password, me.name))
    await run_in_threadpool(service.change_password, services.database, me, fresh)
    after.add_task(
        letters.send_notice, services.database, services.settings, me.account_id, letters.PASSWORD_CHANGED
    )


@credential_router.post("/second-factor")
def start_second_factor(database: DatabaseDep, settings: SettingsDep, me: FreshMyself) -> SecondFactorSetup:
    """Begin the set-up of a second factor: a secret for an authenticator app."""
    secret = service.start_second_factor(database, settings, me)
    uri = credentials.provisioning_uri(secret, me.name)
    return SecondFactorSetup(secret=secret, uri=uri, qr_svg=credentials.qr_svg(uri))


@credential_router.put("/second-factor")
def confirm_second_factor(
    database: DatabaseDep, settings: SettingsDep, me: FreshMyself, body: ConfirmCode, after: BackgroundTasks
) -> RecoveryCodes:
    """Turn the second factor on with the app's first code; gives the recovery codes, this once."""
    codes = service.confirm_second_factor(database, settings, me, body.code)
    after.add_task(letters.send_notice, database, settings, me.account_id, letters.SECOND_FACTOR_ADDED)
    return RecoveryCodes(codes=codes)


@credential_router.delete("/second-factor", status_code=204)
async def remove_second_factor(
    services: ServicesDep, me: Myself, body: ConfirmPassword, after: BackgroundTasks
) -> None:
    """Turn the second factor off; asks for the password, and where the account has none for a code."""
    await must_prove(
        services.database, services.settings, services.sign_ins, services.passwords, me, body.password
    )
    await run_in_threadpool(service.remove_second_factor, services.database, services.settings, me)
    after.add_task(
        letters.send_notice,
        services.database,
        services.settings,
        me.account_id,
        letters.SECOND_FACTOR_REMOVED,
    )


@credential_router.get("/tokens")
def list_tokens(database: DatabaseDep, me: Myself) -> list[TokenOut]:
    """One's own API tokens."""
    with database.read() as session:
        return [TokenOut.model_validate(row) for row in service.open_tokens(session, me)]


@credential_router.post("/tokens", status_code=201)
def create_token(database: DatabaseDep, me: FreshMyself, body: NewToken) -> NewTokenOut:
    """Make an API token; its secret is shown this once. It can do no more than the account."""
    with database.write() as session:
        row, secret = service.create_token(session, me, body.name, list(body.scopes), body.days_granted)
        return NewTokenOut(**TokenOut.model_validate(row).model_dump(), token=secret)


@credential_router.delete("/tokens/{token_id}", status_code=204)
def revoke_token(database: DatabaseDep, me: Myself, token_id: Number) -> None:
    """Revoke one's own API token."""
    service.revoke_token(database, me, token_id)


# Endpoints of reset by mail: forgotten passwords, and the address of the own account.

reset_router = APIRouter(prefix="/api/admin", tags=["account"], responses=ERROR_RESPONSES)


async def _count_attempt(sign_ins: SignInThrottle, request: Request, what: str) -> None:
    address = address_of(request)
    key = sign_ins.key(what, address, None)
    await run_in_threadpool(sign_ins.enter, key, address, None)


def _must_send(settings: Settings) -> None:
    if not letters.can_send(settings):
        raise NotFound("This server does not send email. Ask an owner of the server for a new password.")


@reset_router.post("/session/forgotten", status_code=202)
async def forgot_password(
    request: Request,
    services: ServicesDep,
    body: ForgottenPassword,
    after: BackgroundTasks,
    device_cookie: Annotated[str | None, Cookie(alias=DEVICE_COOKIE, include_in_schema=False)] = None,
) -> None:
    """Ask for a link by mail for a new password; the answer is the same whether there is such an account."""
    check_origin(request, services.settings)
    _must_send(services.settings)
    await _count_attempt(services.sign_ins, request, "forgotten password")
    after.add_task(
        resets.write_to_who_forgot,
        services.database,
        services.settings,
        services.sign_ins,
        body.name,
        LetterRequest(address_of(request), device_cookie),
    )


@reset_router.post("/session/new-password", status_code=204)
async def set_password(
    request: Request, services: ServicesDep, body: NewPassword, after: BackgroundTasks
) -> None:
    """Choose a new password by a link; every session and every API token of the account ends."""
    check_origin(request, services.settings)
    await _count_attempt(services.sign_ins, request, "new password")
    name = await run_in_threadpool(resets.name_of, services.database, body.token)
    fresh = await services.passwords.run(lambda: hash_password(body.password, name))
    letter = await run_in_threadpool(resets.set_password, services.database, body.token, fresh)
    after.add_task(resets.post, services.settings, letter)


@reset_router.get("/mail")
def own_address(database: DatabaseDep, me: Myself) -> OwnAddress:
    """Where a link for a new password goes."""
    with database.read() as session:
        return OwnAddress(address=account_of(session, me).email)


@reset_router.put("/mail", status_code=202)
async def change_address(services: ServicesDep, me: Myself, body: NewAddress, after: BackgroundTasks) -> None:
    """Enter an address of mail; it is the account's once the link that goes there was opened."""
    _must_send(services.settings)
    await must_fit(services.database, services.sign_ins, services.passwords, me, body.password)
    letter = await run_in_threadpool(
        resets.ask_to_confirm, services.database, services.settings, me, body.address
    )
    after.add_task(resets.post, services.settings, letter)


@reset_router.delete("/mail", status_code=204)
async def remove_address(
    services: ServicesDep, me: Myself, body: ConfirmPassword, after: BackgroundTasks
) -> None:
    """Take the address of mail off one's own account; passwords are then reset by the command line alone."""
    await must_prove(
        services.database, services.settings, services.sign_ins, services.passwords, me, body.password
    )
    letter = await run_in_threadpool(resets.remove_address, services.database, me)
    after.add_task(resets.post, services.settings, letter)


@reset_router.post("/session/mail", status_code=204)
async def confirm_address(
    request: Request, services: ServicesDep, body: ConfirmAddress, after: BackgroundTasks
) -> None:
    """Confirm an address of mail by the link sent there; the previous address is notified."""
    check_origin(request, services.settings)
    await _count_attempt(services.sign_ins, request, "confirm an address")
    letter = await run_in_threadpool(resets.confirm_address, services.database, body.token)
    after.add_task(resets.post, services.settings, letter)
