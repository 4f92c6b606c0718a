"""The live monitor: once, or as a stream of server-sent events."""

import asyncio
import time
from collections.abc import AsyncIterator

from fastapi import APIRouter, Request
from fastapi.concurrency import run_in_threadpool
from fastapi.responses import StreamingResponse

from server.accounts.identity import Identity, NotAllowed, NotSignedIn, identify
from server.accounts.permission import SecondFactorNeeded, Viewer
from server.context import Services, ServicesDep
from server.errors import ERROR_RESPONSES, NotFound
from server.monitor import service
from server.monitor.failing_clips import failing_clips
from server.monitor.schemas import FailingClip, MonitorSnapshot
from server.participants.schemas import Origin
from server.studies.lookup import active_definition, find_study, study_with_rights

router = APIRouter(prefix="/api/admin/studies/{study}", tags=["monitor"], responses=ERROR_RESPONSES)
EVERY_S = 2.0
"""How often a stream looks at its study at most; so often it does where it hears of no changes."""
QUIET_S = 10.0
"""How often it looks where nothing was written: people who do nothing are away after a while."""
LOOK_S = 0.2
"""How often a stream that waits looks whether the server is to end, or something was written."""
RETRY_MS = 1000
"""After so long a browser whose stream ended connects again."""


def _snapshot(services: Services, name: str, identity: Identity, origin: Origin | None) -> MonitorSnapshot:
    with services.database.read() as session:
        study, rights = study_with_rights(session, name, identity, "view")
        shown = service.snapshot(session, study, active_definition(session, study), origin)
    if identity.sees_persons and "export" in rights:
        return shown
    nameless = [run.model_copy(update={"participant": run.run}) for run in shown.runs]
    return shown.model_copy(update={"runs": nameless})


@router.get("/monitor")
def get_monitor(
    services: ServicesDep, identity: Viewer, study: str, origin: Origin | None = None
) -> MonitorSnapshot:
    """The monitor at this moment, of one origin; that of people now taking part where none is given."""
    return _snapshot(services, study, identity, origin)


@router.get("/failing-clips")
def list_failing_clips(
    services: ServicesDep, identity: Viewer, study: str, origin: Origin | None = None
) -> list[FailingClip]:
    """The clips that people could not see in the latest runs, those that raise an alarm first."""
    with services.database.read() as session:
        return failing_clips(session, find_study(session, study, identity, "view"), origin)


def changes(before: MonitorSnapshot | None, after: MonitorSnapshot) -> str:
    """`after` as JSON, with only those runs that differ from `before`."""
    known = {run.run: run for run in before.runs} if before else {}
    changed = [run for run in after.runs if known.get(run.run) != run]
    return after.model_copy(update={"runs": changed}).model_dump_json()


async def _waited(services: Services, seen: int | None) -> bool:
    """Wait for the next look at the study; False, at once, where the server is to end.

    Parameters
    ----------
    seen : int or None
        The number of the change before the last look.
    """
    began = time.monotonic()
    while not services.stopping:
        waited = time.monotonic() - began
        is_quiet = seen is not None and services.changes.number == seen
        if waited >= (QUIET_S if is_quiet else EVERY_S):
            return True
        await asyncio.sleep(LOOK_S)
    return False


@router.get("/monitor/stream", response_class=StreamingResponse)
async def stream_monitor(
    request: Request, services: ServicesDep, identity: Viewer, study: str, origin: Origin | None = None
) -> StreamingResponse:
    """Server-sent events: the whole monitor first, then what has changed, within two seconds of it.

    Each event's data is a MonitorSnapshot whose `runs` hold only changed runs. The stream ends after an hour,
    when the session ends or the server does; the browser then connects again by itself.
    """
    services.streams.check(identity.account_id)
    seen = services.changes.number
    with services.streams.one(identity.account_id):  # of hundreds asked for at once, most cost no look
        first = await run_in_threadpool(_snapshot, services, study, identity, origin)

    async def changing() -> AsyncIterator[MonitorSnapshot]:
        nonlocal seen
        yield first
        until = time.monotonic() + 60 * services.settings.monitor_stream_minutes
        while await _waited(services, seen) and time.monotonic() < until:
            if await request.is_disconnected():
                return
            seen = services.changes.number
            try:
                anew = await run_in_threadpool(identify, request, services)
                yield await run_in_threadpool(_snapshot, services, study, anew, origin)
            except (NotSignedIn, NotFound, NotAllowed, SecondFactorNeeded):  # or the study was deleted
                return

    async def events() -> AsyncIterator[str]:
        before: MonitorSnapshot | None = None
        yield f"retry: {RETRY_MS}\n\n"
        with services.streams.one(identity.account_id) as has_room:
            if not has_room:
                return
            async for current in changing():
                yield f"event: monitor\ndata: {changes(before, current)}\n\n"
                before = current

    return StreamingResponse(events(), media_type="text/event-stream", headers={"x-accel-buffering": "no"})
