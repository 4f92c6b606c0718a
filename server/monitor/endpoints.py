"""The live monitor: once, or as a stream of server-sent events."""

import asyncio
from collections.abc import AsyncIterator
from datetime import timedelta

from fastapi import APIRouter, Request
from fastapi.concurrency import run_in_threadpool
from fastapi.responses import StreamingResponse

from server.accounts.identity import NotSignedIn, Viewer, identify
from server.context import Services, ServicesDep
from server.errors import ERROR_RESPONSES
from server.monitor import service
from server.monitor.heat import HeatMaps
from server.monitor.schemas import MonitorSnapshot
from server.studies.lookup import active_definition, find_study

router = APIRouter(prefix="/api/admin/studies/{study}", tags=["monitor"], responses=ERROR_RESPONSES)
EVERY_S = 2.0
LONGEST_S = 3600.0
_maps = HeatMaps()


def _snapshot(services: Services, name: str) -> MonitorSnapshot:
    with services.database.read() as session:
        study = find_study(session, name)
        lease = timedelta(minutes=active_definition(session, study).session.lease_minutes)
        return service.snapshot(session, study, _maps.of(study.id), lease)


@router.get("/monitor")
def get_monitor(services: ServicesDep, _who: Viewer, study: str) -> MonitorSnapshot:
    """The monitor at this moment."""
    return _snapshot(services, study)


def changes(before: MonitorSnapshot | None, after: MonitorSnapshot) -> str:
    """`after` as JSON, with only those runs that differ from `before`."""
    known = {run.run: run for run in before.runs} if before else {}
    changed = [run for run in after.runs if known.get(run.run) != run]
    return after.model_copy(update={"runs": changed}).model_dump_json()


@router.get("/monitor/stream", response_class=StreamingResponse)
def stream_monitor(request: Request, services: ServicesDep, _who: Viewer, study: str) -> StreamingResponse:
    """Server-sent events: the whole monitor first, then every two seconds what has changed.

    Each event's data is a MonitorSnapshot whose `runs` hold only changed runs. The stream ends after an hour
    or when the session ends; the browser then connects again by itself.
    """
    first = _snapshot(services, study)

    async def events() -> AsyncIterator[str]:
        before: MonitorSnapshot | None = None
        current = first
        for _ in range(int(LONGEST_S / EVERY_S)):
            yield f"event: monitor\ndata: {changes(before, current)}\n\n"
            before = current
            await asyncio.sleep(EVERY_S)
            if await request.is_disconnected():
                return
            try:
                await run_in_threadpool(identify, request, services)
            except NotSignedIn:
                return
            current = await run_in_threadpool(_snapshot, services, study)

    return StreamingResponse(events(), media_type="text/event-stream", headers={"x-accel-buffering": "no"})
