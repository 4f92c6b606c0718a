"""Endpoints of what one signs in with: password, second factor, API tokens."""

from fastapi import APIRouter, BackgroundTasks
from fastapi.concurrency import run_in_threadpool

from server.accounts import notices, second_factor, service, tokens
from server.accounts.passwords import hash_password
from server.accounts.permission import FreshMyself, Myself
from server.accounts.proof import must_fit, must_prove
from server.accounts.schemas import (
    ChangePassword,
    ConfirmCode,
    ConfirmPassword,
    NewToken,
    NewTokenOut,
    RecoveryCodes,
    SecondFactorSetup,
    TokenOut,
)
from server.context import ServicesDep
from server.errors import ERROR_RESPONSES
from server.numbers import Number

router = APIRouter(prefix="/api/admin", tags=["account"], responses=ERROR_RESPONSES)


@router.put("/password", status_code=204)
async def change_password(
    services: ServicesDep, me: Myself, body: ChangePassword, after: BackgroundTasks
) -> None:
    """Change the password; every other session and every API token ends."""
    await must_fit(services, me, body.password)
    fresh = await services.passwords.run(lambda: hash_password(body.new_password, me.name))
    await run_in_threadpool(service.change_password, services, me, fresh)
    after.add_task(notices.tell, services, me.account_id, notices.PASSWORD_CHANGED)


@router.post("/second-factor")
def start_second_factor(services: ServicesDep, me: FreshMyself) -> SecondFactorSetup:
    """Begin the set-up of a second factor: a secret for an authenticator app."""
    secret = service.start_second_factor(services, me)
    uri = second_factor.provisioning_uri(secret, me.name)
    return SecondFactorSetup(secret=secret, uri=uri, qr_svg=second_factor.qr_svg(uri))


@router.put("/second-factor")
def confirm_second_factor(
    services: ServicesDep, me: FreshMyself, body: ConfirmCode, after: BackgroundTasks
) -> RecoveryCodes:
    """Turn the second factor on with the app's first code; gives the recovery codes, this once."""
    codes = service.confirm_second_factor(services, me, body.code)
    after.add_task(notices.tell, services, me.account_id, notices.SECOND_FACTOR_ADDED)
    return RecoveryCodes(codes=codes)


@router.delete("/second-factor", status_code=204)
async def remove_second_factor(
    services: ServicesDep, me: Myself, body: ConfirmPassword, after: BackgroundTasks
) -> None:
    """Turn the second factor off; asks for the password, and where the account has none for a code."""
    await must_prove(services, me, body.password)
    await run_in_threadpool(service.remove_second_factor, services, me)
    after.add_task(notices.tell, services, me.account_id, notices.SECOND_FACTOR_REMOVED)


@router.get("/tokens")
def list_tokens(services: ServicesDep, me: Myself) -> list[TokenOut]:
    """One's own API tokens."""
    with services.database.read() as session:
        return [TokenOut.model_validate(row) for row in tokens.open_tokens(session, me)]


@router.post("/tokens", status_code=201)
def create_token(services: ServicesDep, me: FreshMyself, body: NewToken) -> NewTokenOut:
    """Make an API token; its secret is shown this once. It can do no more than the account."""
    with services.database.write() as session:
        row, secret = tokens.create_token(session, me, body.name, list(body.scopes), body.days_granted)
        return NewTokenOut(**TokenOut.model_validate(row).model_dump(), token=secret)


@router.delete("/tokens/{token_id}", status_code=204)
def revoke_token(services: ServicesDep, me: Myself, token_id: Number) -> None:
    """Revoke one's own API token."""
    tokens.revoke_token(services.database, me, token_id)
