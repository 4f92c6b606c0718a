"""Who is signed in proves once more to be the account's owner, within the limits of wrong attempts."""

from fastapi.concurrency import run_in_threadpool

from server.accounts import service, signing_in
from server.accounts.identity import Identity
from server.context import Services


async def must_fit(services: Services, me: Identity, password: str) -> None:
    """Ask for the present password; a stolen session may not try many."""
    key = f"session {me.session_id}"
    await run_in_threadpool(services.sign_ins.names.check, key)
    stored = await run_in_threadpool(service.own_password, services, me)
    try:
        await services.passwords.run(lambda: service.must_fit(password, stored))
    except signing_in.WrongCredentials:
        await run_in_threadpool(services.sign_ins.names.failed, key)
        raise
    await run_in_threadpool(services.sign_ins.names.succeeded, key)


async def must_prove(services: Services, me: Identity, proof: str) -> None:
    """Ask for the present password, and where the account has none for a code of its second factor."""
    if await run_in_threadpool(service.own_password, services, me):
        await must_fit(services, me, proof)
        return
    key = f"session {me.session_id}"
    await run_in_threadpool(services.sign_ins.names.check, key)
    failure = await run_in_threadpool(service.own_code_failure, services, me, proof)
    if failure is not None:
        await run_in_threadpool(services.sign_ins.names.failed, key)
        raise failure
    await run_in_threadpool(services.sign_ins.names.succeeded, key)
