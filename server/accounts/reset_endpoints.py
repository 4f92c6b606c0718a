"""Endpoints of reset by mail: forgotten passwords, and the address of the own account."""

from typing import Annotated

from fastapi import APIRouter, BackgroundTasks, Cookie, Request
from fastapi.concurrency import run_in_threadpool

from server.accounts import letters, resets
from server.accounts.access import Myself, account_of, check_origin
from server.accounts.credentials import hash_password
from server.accounts.endpoints import address_of
from server.accounts.invitations import must_fit, must_prove
from server.accounts.resets import LetterRequest
from server.accounts.schemas import (
    ConfirmAddress,
    ConfirmPassword,
    ForgottenPassword,
    NewAddress,
    NewPassword,
    OwnAddress,
)
from server.accounts.throttle import DEVICE_COOKIE, SignInThrottle
from server.context import ServicesDep
from server.core.errors import ERROR_RESPONSES, NotFound
from server.core.requests import DatabaseDep
from server.core.settings import Settings

router = APIRouter(prefix="/api/admin", tags=["account"], responses=ERROR_RESPONSES)


async def _count_attempt(sign_ins: SignInThrottle, request: Request, what: str) -> None:
    address = address_of(request)
    key = sign_ins.key(what, address, None)
    await run_in_threadpool(sign_ins.enter, key, address, None)


def _must_send(settings: Settings) -> None:
    if not letters.can_send(settings):
        raise NotFound("This server does not send email. Ask an owner of the server for a new password.")


@router.post("/session/forgotten", status_code=202)
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


@router.post("/session/new-password", status_code=204)
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


@router.get("/mail")
def own_address(database: DatabaseDep, me: Myself) -> OwnAddress:
    """Where a link for a new password goes."""
    with database.read() as session:
        return OwnAddress(address=account_of(session, me).email)


@router.put("/mail", status_code=202)
async def change_address(services: ServicesDep, me: Myself, body: NewAddress, after: BackgroundTasks) -> None:
    """Enter an address of mail; it is the account's once the link that goes there was opened."""
    _must_send(services.settings)
    await must_fit(services.database, services.sign_ins, services.passwords, me, body.password)
    letter = await run_in_threadpool(
        resets.ask_to_confirm, services.database, services.settings, me, body.address
    )
    after.add_task(resets.post, services.settings, letter)


@router.delete("/mail", status_code=204)
async def remove_address(
    services: ServicesDep, me: Myself, body: ConfirmPassword, after: BackgroundTasks
) -> None:
    """Take the address of mail off one's own account; passwords are then reset by the command line alone."""
    await must_prove(
        services.database, services.settings, services.sign_ins, services.passwords, me, body.password
    )
    letter = await run_in_threadpool(resets.remove_address, services.database, me)
    after.add_task(resets.post, services.settings, letter)


@router.post("/session/mail", status_code=204)
async def confirm_address(
    request: Request, services: ServicesDep, body: ConfirmAddress, after: BackgroundTasks
) -> None:
    """Confirm an address of mail by the link that went there; the address before it is told."""
    check_origin(request, services.settings)
    await _count_attempt(services.sign_ins, request, "confirm an address")
    letter = await run_in_threadpool(resets.confirm_address, services.database, body.token)
    after.add_task(resets.post, services.settings, letter)
