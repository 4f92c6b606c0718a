"""Endpoints of sign-in by providers (OpenID Connect): begin, come back, one's own logins."""

from typing import Annotated

from fastapi import APIRouter, BackgroundTasks, Cookie, Form, Header, Query, Request, Response
from fastapi.concurrency import run_in_threadpool
from fastapi.responses import RedirectResponse

from server.accounts import letters, provider_sign_in
from server.accounts.access import FreshMyself, Myself, check_origin
from server.accounts.endpoints import address_of, set_session_cookie
from server.accounts.invitations import must_prove
from server.accounts.letters import can_send
from server.accounts.provider_protocol import NotRecognised
from server.accounts.schemas import (
    BeginLink,
    BeginSignIn,
    Elsewhere,
    LoginOut,
    ProviderOut,
    SecondFactorCode,
    WaysIn,
)
from server.accounts.throttle import SignInThrottle
from server.context import ServicesDep
from server.core.db import Database
from server.core.errors import ERROR_RESPONSES, ApiError
from server.core.requests import DatabaseDep, SettingsDep
from server.core.settings import ProviderId, Settings
from server.core.values import Number

router = APIRouter(prefix="/api/admin", tags=["account"], responses=ERROR_RESPONSES)
LOGIN_COOKIE = "palpebra_login"
COOKIE_PATH = "/api/admin/session"
UserAgent = Annotated[str, Header(include_in_schema=False)]
LoginCookie = Annotated[str, Cookie(alias=LOGIN_COOKIE, include_in_schema=False, max_length=100)]
ProviderParameter = Annotated[str, Query(max_length=2000)]


def _set_login_cookie(response: Response, settings: Settings, token: str) -> None:
    """Lax, not strict: the provider sends the browser back from another site."""
    response.set_cookie(
        LOGIN_COOKIE,
        token,
        max_age=provider_sign_in.ATTEMPT_MINUTES * 60,
        httponly=True,
        samesite="lax",
        secure=settings.is_https,
        path=COOKIE_PATH,
    )


async def _count_attempt(sign_ins: SignInThrottle, request: Request, what: str) -> None:
    address = address_of(request)
    key = sign_ins.key(what, address, None)
    await run_in_threadpool(sign_ins.enter, key, address, None)


@router.get("/session/ways")
async def ways_in(settings: SettingsDep) -> WaysIn:
    """How one can sign in here, besides by name and password."""
    declared = settings.oidc
    shown = [ProviderOut(id=name, label=one.label) for name, one in declared.items()]
    return WaysIn(providers=shown, resets_by_mail=can_send(settings))


@router.post("/session/providers/{provider}")
async def begin_sign_in(
    request: Request, services: ServicesDep, provider: ProviderId, body: BeginSignIn, response: Response
) -> Elsewhere:
    """Begin to sign in with a provider: where the browser goes, and a cookie by which it is known again."""
    check_origin(request, services.settings)
    provider_sign_in.provider_of(services.settings, provider)
    await _count_attempt(services.sign_ins, request, f"provider {provider}")
    begun = await run_in_threadpool(
        provider_sign_in.begin_attempt, services.database, services.settings, provider, "sign in", body.next
    )
    _set_login_cookie(response, services.settings, begun.browser)
    return Elsewhere(url=await services.providers.of(provider).authorization_url(begun.secrets))


@router.post("/invitations/{token}/providers/{provider}")
async def begin_invited(
    request: Request, services: ServicesDep, token: str, provider: ProviderId, response: Response
) -> Elsewhere:
    """Begin to make an invited account that signs in with a provider: where the browser goes."""
    check_origin(request, services.settings)
    provider_sign_in.provider_of(services.settings, provider)
    await _count_attempt(services.sign_ins, request, f"provider {provider}")
    begun = await run_in_threadpool(
        provider_sign_in.begin_invited, services.database, services.settings, provider, token
    )
    _set_login_cookie(response, services.settings, begun.browser)
    return Elsewhere(url=await services.providers.of(provider).authorization_url(begun.secrets))


@router.post("/logins/{provider}")
async def begin_link(
    services: ServicesDep, me: Myself, provider: ProviderId, body: BeginLink, response: Response
) -> Elsewhere:
    """Begin to give one's own account a login with a provider; asks for the password once more."""
    provider_sign_in.provider_of(services.settings, provider)
    await must_prove(
        services.database, services.settings, services.sign_ins, services.passwords, me, body.proof
    )
    begun = await run_in_threadpool(
        provider_sign_in.begin_attempt, services.database, services.settings, provider, "link", "/account", me
    )
    _set_login_cookie(response, services.settings, begun.browser)
    return Elsewhere(url=await services.providers.of(provider).authorization_url(begun.secrets))


@router.get("/session/providers/{provider}/callback", status_code=303, response_class=RedirectResponse)
async def come_back(
    request: Request,
    services: ServicesDep,
    provider: ProviderId,
    after: BackgroundTasks,
    state: ProviderParameter = "",
    code: ProviderParameter = "",
    iss: Annotated[str | None, Query(max_length=300)] = None,
    user_agent: UserAgent = "",
    browser: LoginCookie = "",
) -> RedirectResponse:
    """Where the provider sends the browser back to; what was refused, the page to sign in says.

    Nothing of the query is shown or followed: the page to go on with was kept when the sign-in began. Who is
    refused for coming too often may come again: the state is not used up.
    """
    page = "/sign-in"
    try:
        provider_sign_in.provider_of(services.settings, provider)
        if not browser or not state:
            raise NotRecognised("This sign-in was started in another browser. Start it again here.")
        await run_in_threadpool(services.sign_ins.come_back, address_of(request))
        attempt = await run_in_threadpool(
            provider_sign_in.take_attempt, services.database, provider, state, browser
        )
        page = "/account" if attempt.purpose == "link" else page
        if not code:
            raise NotRecognised("The sign-in service refused the sign-in.")
        secrets = provider_sign_in.secrets_of(services.settings.key, browser, state)
        whom = await services.providers.of(provider).recognise(code, iss, secrets)
        finished = await run_in_threadpool(
            provider_sign_in.finish_sign_in,
            services.database,
            services.settings,
            provider,
            attempt,
            whom,
            user_agent,
        )
    except ApiError as refusal:
        await run_in_threadpool(
            provider_sign_in.note_failure, services.database, services.sign_ins, provider, refusal
        )
        return RedirectResponse(f"/admin{page}?refused={refusal.code}", 303)
    response = RedirectResponse(f"/admin{finished.page}", 303)
    _go_on(response, services.database, services.settings, finished, after)
    return response


@router.post("/session/code")
async def finish_with_code(
    request: Request,
    services: ServicesDep,
    body: SecondFactorCode,
    response: Response,
    after: BackgroundTasks,
    user_agent: UserAgent = "",
    browser: LoginCookie = "",
) -> BeginSignIn:
    """Enter the second factor after a provider signed one in; gives the page to go on with."""
    check_origin(request, services.settings)
    await _count_attempt(services.sign_ins, request, "code after a provider")
    finished = await run_in_threadpool(
        provider_sign_in.finish_with_code,
        services.database,
        services.settings,
        services.sign_ins,
        browser,
        body.code,
        user_agent,
    )
    _go_on(response, services.database, services.settings, finished, after)
    return BeginSignIn(next=finished.page)


@router.post("/session/providers/{provider}/logout", status_code=204)
async def end_by_provider(
    request: Request,
    services: ServicesDep,
    provider: ProviderId,
    logout_token: Annotated[str, Form(max_length=16_000)] = "",
) -> None:
    """Where the provider itself reports that somebody signed out there (OpenID Connect Back-Channel Logout).

    Senders of anything but a logout token are kept waiting, not the provider: its people may all sign out at
    once. A token that comes again ends nothing that was begun since.
    """
    provider_sign_in.provider_of(services.settings, provider)
    client = services.providers.of(provider)
    async with services.sign_ins.logout(provider, address_of(request)):
        ended = await client.signed_out(logout_token)
    if not client.has_handled(ended):
        await run_in_threadpool(provider_sign_in.sign_out, services.database, provider, ended)
        client.handled(ended)


def _go_on(
    response: Response,
    database: Database,
    settings: Settings,
    finished: provider_sign_in.SignInOutcome,
    after: BackgroundTasks,
) -> None:
    if finished.told is not None:
        after.add_task(
            letters.send_notice, database, settings, finished.told.account_id, finished.told.notice
        )
    if finished.asks_code is not None:
        _set_login_cookie(response, settings, finished.asks_code)
        return
    response.delete_cookie(LOGIN_COOKIE, path=COOKIE_PATH)
    if finished.session is not None:
        set_session_cookie(response, settings, finished.session)


@router.get("/logins")
def list_logins(database: DatabaseDep, me: Myself) -> list[LoginOut]:
    """One's own logins with providers."""
    with database.read() as session:
        return [LoginOut.model_validate(row) for row in provider_sign_in.own_logins(session, me)]


@router.delete("/logins/{login_id}", status_code=204)
def remove_login(
    database: DatabaseDep, settings: SettingsDep, me: FreshMyself, login_id: Number, after: BackgroundTasks
) -> None:
    """Take a login off one's own account."""
    provider_sign_in.remove_login(database, me, login_id)
    after.add_task(letters.send_notice, database, settings, me.account_id, letters.LOGIN_REMOVED)
