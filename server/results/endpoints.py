"""Endpoints of results, the live monitor, runs, replay and the Methods paragraph."""

import asyncio
import time
from collections.abc import AsyncIterator
from typing import Annotated, Literal

from fastapi import APIRouter, Header, Path, Query, Request, Response
from fastapi.concurrency import run_in_threadpool
from fastapi.responses import StreamingResponse
from pydantic import BaseModel, Field

from server.accounts.access import Eraser, Myself, PersonalReader, Viewer, Writer, identify
from server.accounts.audit import record
from server.accounts.identity import Identity, NotAllowed, NotSignedIn, SecondFactorNeeded
from server.accounts.workspaces import Uploader
from server.context import ServicesDep
from server.core.changes import Changes, Stopping
from server.core.db import Database
from server.core.errors import ERROR_RESPONSES, NotFound
from server.core.requests import DatabaseDep, SettingsDep
from server.core.values import Number
from server.participation.run_schemas import Origin
from server.privacy.erasures import erase
from server.results import kinds
from server.results import methods as methods_service
from server.results import monitor as monitor_service
from server.results import replay as replay_service
from server.results import runs as run_service
from server.results.cache import Revision
from server.results.demo_builds import ClipBuild, ClipBuilds, clip_builds, start_clip_build
from server.results.monitor import failing_clips
from server.results.schemas import (
    AnyResults,
    Erase,
    Erased,
    Exclude,
    FailingClip,
    MonitorSnapshot,
    Replay,
    ReplayedTrial,
    RunEvidence,
    RunIdentity,
    RunPage,
    Show,
    Timeline,
)
from server.studies.lookup import active_definition, find_study, study_with_rights

# The results page's data.

router = APIRouter(prefix="/api/admin/studies/{study}", tags=["results"], responses=ERROR_RESPONSES)


ByKind = Annotated[AnyResults, Field(discriminator="kind")]


@router.get(
    "/results",
    response_model=Annotated[AnyResults, Field(discriminator="kind")],
    responses={304: {"description": "Nothing has changed."}},
)
def get_results(
    services: ServicesDep,
    identity: Viewer,
    study: str,
    origin: Origin = "participant",
    series: Number | None = None,
    scale: str | None = None,
    if_none_match: Annotated[str | None, Header()] = None,
) -> Response:
    """What the answers so far look like, by kind of trial, with response times and playback.

    They are of one origin, one data series (that of the active version where none is given) and, where
    clips are rated, one scale (the first). With the ETag of an earlier answer as `If-None-Match` it is 304
    where nothing has changed. Where counting takes long `counted_at` may lie some time back.
    """

    def count() -> tuple[Revision, AnyResults]:
        with services.database.read() as session:
            return kinds.counted_results(
                session, find_study(session, study, identity, "view"), origin, series, scale
            )

    with services.database.read() as session:
        known = find_study(session, study, identity, "view")
        pool, _, revision = kinds.pool_and_revision(session, known, origin, series, scale)
    counted = services.results.get(pool, revision, count)
    headers = {"etag": counted.etag, "cache-control": "private, no-cache"}
    if if_none_match == counted.etag:
        return Response(status_code=304, headers=headers)
    return Response(counted.results.model_dump_json(), media_type="application/json", headers=headers)


# The live monitor: once, or as a stream of server-sent events.

monitor_router = APIRouter(prefix="/api/admin/studies/{study}", tags=["monitor"], responses=ERROR_RESPONSES)
EVERY_S = 2.0
"""How often a stream looks at its study at most; so often it does where it hears of no changes."""
QUIET_S = 10.0
"""How often it looks where nothing was written: people who do nothing are away after a while."""
LOOK_S = 0.2
"""How often a stream that waits looks whether the server is to end, or something was written."""
RETRY_MS = 1000
"""After so long a browser whose stream ended connects again."""


def _snapshot(database: Database, name: str, identity: Identity, origin: Origin | None) -> MonitorSnapshot:
    with database.read() as session:
        study, rights = study_with_rights(session, name, identity, "view")
        shown = monitor_service.snapshot(session, study, active_definition(session, study), origin)
    if identity.sees_persons and "export" in rights:
        return shown
    nameless = [run.model_copy(update={"participant": run.run}) for run in shown.runs]
    return shown.model_copy(update={"runs": nameless})


@monitor_router.get("/monitor")
def get_monitor(
    database: DatabaseDep, identity: Viewer, study: str, origin: Origin | None = None
) -> MonitorSnapshot:
    """The monitor at this moment, of one origin; that of people now taking part where none is given."""
    return _snapshot(database, study, identity, origin)


@monitor_router.get("/failing-clips")
def list_failing_clips(
    database: DatabaseDep, identity: Viewer, study: str, origin: Origin | None = None
) -> list[FailingClip]:
    """The clips that people could not see in the latest runs, those that raise an alarm first."""
    with database.read() as session:
        return failing_clips(session, find_study(session, study, identity, "view"), origin)


def snapshot_changes(before: MonitorSnapshot | None, after: MonitorSnapshot) -> str:
    """`after` as JSON, with only those runs that differ from `before`."""
    known = {run.run: run for run in before.runs} if before else {}
    changed = [run for run in after.runs if known.get(run.run) != run]
    return after.model_copy(update={"runs": changed}).model_dump_json()


async def _wait_for_change(changes: Changes, stopping: Stopping, seen: int | None) -> bool:
    """Wait for the next look at the study; False, at once, where the server is to end.

    Parameters
    ----------
    seen : int or None
        The number of the change before the last look.
    """
    began = time.monotonic()
    while not stopping:
        waited = time.monotonic() - began
        is_quiet = seen is not None and changes.number == seen
        if waited >= (QUIET_S if is_quiet else EVERY_S):
            return True
        await asyncio.sleep(LOOK_S)
    return False


@monitor_router.get("/monitor/stream", response_class=StreamingResponse)
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
        first = await run_in_threadpool(_snapshot, services.database, study, identity, origin)

    async def changing() -> AsyncIterator[MonitorSnapshot]:
        nonlocal seen
        yield first
        until = time.monotonic() + 60 * services.settings.monitor_stream_minutes
        while await _wait_for_change(services.changes, services.stopping, seen) and time.monotonic() < until:
            if await request.is_disconnected():
                return
            seen = services.changes.number
            try:
                anew = await run_in_threadpool(identify, request, services.database, services.settings)
                yield await run_in_threadpool(_snapshot, services.database, study, anew, origin)
            except (NotSignedIn, NotFound, NotAllowed, SecondFactorNeeded):  # or the study was deleted
                return

    async def events() -> AsyncIterator[str]:
        before: MonitorSnapshot | None = None
        yield f"retry: {RETRY_MS}\n\n"
        with services.streams.one(identity.account_id) as has_room:
            if not has_room:
                return
            async for current in changing():
                yield f"event: monitor\ndata: {snapshot_changes(before, current)}\n\n"
                before = current

    return StreamingResponse(events(), media_type="text/event-stream", headers={"x-accel-buffering": "no"})


# Participants of a study: list, timeline, exclude, erase.

run_router = APIRouter(
    prefix="/api/admin/studies/{study}/runs", tags=["participants"], responses=ERROR_RESPONSES
)


@run_router.get("")
def list_runs(
    database: DatabaseDep,
    identity: PersonalReader,
    study: str,
    show: Show = "everybody",
    simulated: Annotated[bool, Query(description="List simulated people too.")] = False,
    search: Annotated[str, Query(max_length=200, description="Part of participant or run.")] = "",
    before: Annotated[str | None, Query(max_length=40)] = None,
    limit: Annotated[int, Query(ge=1, le=1000)] = 100,
) -> RunPage:
    """The runs, the latest first, a page at a time: go on with `before` = `next`."""
    with database.read() as session:
        known = find_study(session, study, identity, "export")
        shown = run_service.page(session, known, show, search, before, limit, simulated=simulated)
    with database.write() as session:
        record(session, identity, "participants listed", "study", study, number=len(shown.runs))
    return shown


@run_router.get("/{run}")
def get_timeline(database: DatabaseDep, identity: PersonalReader, study: str, run: str) -> Timeline:
    """One run: each trial with its frames and rating, forms, calibrations, events."""
    with database.write() as session:
        timeline = run_service.timeline(session, find_study(session, study, identity, "export"), run)
        record(session, identity, "personal data read", "run", run, study=study)
        return timeline


@run_router.get("/{run}/identity")
def get_identity(database: DatabaseDep, identity: Myself, study: str, run: str) -> RunIdentity:
    """Who the participant is to the recruiter; for owners of the study, and each look is in the audit log."""
    with database.write() as session:
        return run_service.identity(session, find_study(session, study, identity, "own"), run, identity)


@run_router.get("/{run}/evidence")
def get_evidence(database: DatabaseDep, identity: PersonalReader, study: str, run: str) -> RunEvidence:
    """Whether the answers are likely a person's, and what speaks against it."""
    with database.read() as session:
        return monitor_service.evidence_of(session, find_study(session, study, identity, "export"), run)


@run_router.put("/{run}/exclusion", status_code=204)
def exclude_run(database: DatabaseDep, identity: Writer, study: str, run: str, body: Exclude) -> None:
    """Exclude a run from exports' `excluded = 0` and from the analysis; its data stay."""
    with database.write() as session:
        run_service.exclude(session, find_study(session, study, identity, "run"), run, body.reason, identity)


@run_router.delete("/{run}/exclusion", status_code=204)
def include_run(database: DatabaseDep, identity: Writer, study: str, run: str) -> None:
    """Undo an exclusion."""
    with database.write() as session:
        run_service.include(session, find_study(session, study, identity, "run"), run, identity)


@run_router.post("/{run}/erase")
def erase_run(
    database: DatabaseDep, settings: SettingsDep, identity: Eraser, study: str, run: str, body: Erase
) -> Erased:
    """Delete one person's data for good (a request under data protection law)."""
    with database.write() as session:
        known = find_study(session, study, identity, "edit")
        return erase(session, settings, known, run, body.confirm, identity)


# A run as it was shown: its trials, and each with its frame logs. Both are looks at one person's data.

replay_router = APIRouter(
    prefix="/api/admin/studies/{study}/runs/{run}/replay", tags=["participants"], responses=ERROR_RESPONSES
)


@replay_router.get("")
def get_replay(database: DatabaseDep, identity: PersonalReader, study: str, run: str) -> Replay:
    """The trials of a run that can be played back, and how they were to look."""
    with database.write() as session:
        replay = replay_service.replay(session, find_study(session, study, identity, "export"), run)
        record(session, identity, "personal data read", "run", run, study=study, part="replay")
        return replay


@replay_router.get("/trials/{trial_index}")
def get_replayed_trial(
    database: DatabaseDep,
    identity: PersonalReader,
    study: str,
    run: str,
    trial_index: Annotated[int, Path(ge=0, le=1_000_000)],
) -> ReplayedTrial:
    """One trial: each view's frames and when they were drawn, its answers and events."""
    with database.write() as session:
        known = find_study(session, study, identity, "export")
        trial = replay_service.replayed_trial(session, known, run, trial_index)
        record(session, identity, "personal data read", "run", run, study=study, part=f"trial {trial_index}")
        return trial


# The Methods paragraph of a study, for the admin site.

methods_router = APIRouter(
    prefix="/api/admin/studies/{study}/methods", tags=["reports"], responses=ERROR_RESPONSES
)
MethodsOrigin = Literal["participant", "pilot", "simulated"]


class MethodsNumber(BaseModel):
    """A number of the paragraph and where it comes from."""

    name: str
    value: int
    source: str = Field(description="The query of the database that gives it.")


class MethodsOut(BaseModel):
    """The paragraph and its numbers."""

    origin: MethodsOrigin
    series: int
    paragraph: str
    latex: str
    numbers: list[MethodsNumber]


@methods_router.get("")
def get_methods(
    database: DatabaseDep,
    identity: Viewer,
    study: str,
    origin: MethodsOrigin = "participant",
    series: Number | None = None,
) -> MethodsOut:
    """Recruitment, screening, checks, exclusions, display and automated answers, in sentences with counts."""
    with database.read() as session:
        methods = methods_service.methods_of(
            session, find_study(session, study, identity, "view"), origin, series
        )
    listed = [MethodsNumber.model_validate(vars(number)) for number in methods.numbers.values()]
    return MethodsOut(
        origin=origin, series=methods.series, paragraph=methods.plain(), latex=methods.latex(), numbers=listed
    )


@methods_router.get("/methods.txt", response_class=Response)
def get_methods_text(
    database: DatabaseDep,
    identity: Viewer,
    study: str,
    origin: MethodsOrigin = "participant",
    series: Number | None = None,
) -> Response:
    """The paragraph as plain text, with the query of each number below it."""
    with database.read() as session:
        methods = methods_service.methods_of(
            session, find_study(session, study, identity, "view"), origin, series
        )
    return Response(methods.text(), media_type="text/plain; charset=utf-8")


# Clips of shipped experiments, built by the buttons of New study.

build_router = APIRouter(prefix="/api/admin/experiments", tags=["studies"], responses=ERROR_RESPONSES)


@build_router.get("/builds")
def list_clip_builds(services: ServicesDep, _identity: Viewer) -> ClipBuilds:
    """How far the clips of shipped experiments are."""
    return clip_builds(services.database, services.locks)


@build_router.post("/{experiment}/builds", status_code=202)
def begin_clip_build(services: ServicesDep, identity: Uploader, experiment: str) -> ClipBuild:
    """Build the clips of a shipped experiment; one experiment at a time, as it takes every core."""
    return start_clip_build(services.database, services.settings, services.locks, experiment, identity)
