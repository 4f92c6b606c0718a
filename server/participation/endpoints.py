"""The participant's side of the API: links, runs, forms, events, views and ratings."""

from datetime import datetime
from typing import Annotated, Any
from uuid import UUID

from fastapi import APIRouter, Body, Depends, Request, Response
from fastapi.concurrency import run_in_threadpool
from fastapi.security import HTTPAuthorizationCredentials, HTTPBearer
from pydantic import ValidationError
from sqlalchemy import Connection
from sqlalchemy.orm import Session

from experiments.kinds import KINDS
from server.context import ServicesDep
from server.core.commit import GroupCommit
from server.core.db import Database
from server.core.errors import ERROR_RESPONSES, ApiError, json_response, refused_value
from server.core.limits import RateLimit
from server.core.requests import DatabaseDep
from server.core.values import hash_token
from server.participation import links, refused_records, returning, runs
from server.participation import ratings as rating_service
from server.participation import views as view_service
from server.participation.answer_schemas import (
    RATINGS,
    RatingIn,
    RatingSaved,
    Receipt,
    RefusedRecord,
    ViewsIn,
    ViewsSaved,
)
from server.participation.intake import Intake
from server.participation.judgement import judge_waiting
from server.participation.places import follow, next_trials
from server.participation.ratings import RatingDiffers
from server.participation.refusals import EVIDENCE_REFUSALS, RunClosed, RunUnknown
from server.participation.run_schemas import (
    CalibrationResult,
    Completion,
    Consent,
    Events,
    FormAnswers,
    Key,
    LanguageChange,
    LinkState,
    Received,
    RunStart,
    RunStarted,
    RunState,
    Saved,
    ScreenOut,
    StageChange,
    Unsupported,
)
from server.participation.versions import Versions

# The participant's side of the API: links, runs, forms, events. A run's token is its only credential.

RUN_START_WEIGHT = 8
"""A run start takes about as long as this many ratings."""
router = APIRouter(prefix="/api", tags=["participants"], responses=ERROR_RESPONSES)
_bearer = HTTPBearer(auto_error=False, description="The run token of POST /api/links/{link_token}/runs.")


async def _run_token(
    credentials: Annotated[HTTPAuthorizationCredentials | None, Depends(_bearer)],
) -> str:
    if credentials is None:
        message = "Expected the header `Authorization: Bearer <run_token>`, got none."
        raise RunUnknown(message, headers={"www-authenticate": "Bearer"})
    return credentials.credentials


RunToken = Annotated[str, Depends(_run_token)]


def _count(database: Database, limit: RateLimit, token: str) -> None:
    """Count one event of a link that exists; made-up tokens would fill the rate limiter."""
    with database.read() as session:
        # Only for its refusal of an unknown link.
        links.find_link(session, token)
    limit.hit(hash_token(token))


@router.get("/links/{link_token}")
def get_link(services: ServicesDep, link_token: str) -> LinkState:
    """Where a link leads and whether it is open."""
    with services.database.read() as session:
        return links.link_state(services.versions, session, link_token)


@router.post("/links/{link_token}/runs", status_code=201, responses={200: {"model": RunStarted}})
async def start_run(
    services: ServicesDep, link_token: str, start: RunStart, response: Response
) -> RunStarted:
    """Begin a run (201), or take up the one this browser, person or personal link has (200)."""
    # The function is async for the commit; reads of the database would block all others.
    await run_in_threadpool(_count, services.database, services.run_starts, link_token)
    if start.resume_code is not None:
        await run_in_threadpool(returning.count_code, services.resume_codes, link_token, start.resume_code)

    def begin(connection: Connection) -> RunStarted:
        # `expire_on_commit` off: the commit happens outside, and the result is read after it.
        with Session(connection, expire_on_commit=False, info=services.database.carried) as session:
            started = links.start_run(
                services.settings, services.versions, services.intake, session, link_token, start
            )
            # The session is closed without a commit, which belongs to the group.
            session.flush()
        return started

    started = await services.group_commit.run(link_token, begin, RUN_START_WEIGHT)
    response.status_code = 200 if started.resumed else 201
    return started


@router.post("/unsupported", status_code=202)
def report_unsupported(services: ServicesDep, report: Unsupported) -> Received:
    """Report that a browser or screen was turned away before a run began."""
    # Before the write, so that a flood of reports costs a read at most.
    _count(services.database, services.unsupported, report.link_token)
    with services.database.write() as session:
        runs.save_unsupported(session, report)
    return Received(received=1)


@router.get("/run")
def get_run(services: ServicesDep, request: Request, token: RunToken) -> RunState:
    """Everything the page needs to begin or to go on."""
    # When the request arrived: it may have waited before its turn.
    moment = services.time_of(request)
    with services.database.read() as session:
        state = runs.run_state(services.settings, services.versions, services.intake, session, token, moment)
    # An answer may be stored whose series could not be followed; a reload repairs that.
    if (
        any(trial.series for trial in state.trials)
        and follow(services.database, services.versions, token) is not None
    ):
        with services.database.read() as session:
            state = runs.run_state(
                services.settings, services.versions, services.intake, session, token, moment
            )
    return json_response(state)


@router.put("/run/consent")
def put_consent(services: ServicesDep, token: RunToken, consent: Consent) -> Saved:
    """Agree to take part; `agreed: false` ends the run."""
    with services.database.write() as session:
        return runs.save_consent(services.versions, session, token, consent.agreed)


@router.put("/run/calibration")
def put_calibration(database: DatabaseDep, token: RunToken, calibration: CalibrationResult) -> Saved:
    """Add a size calibration."""
    with database.write() as session:
        return runs.save_calibration(session, token, calibration)


@router.put("/run/device")
def put_device(
    database: DatabaseDep, token: RunToken, device: Annotated[dict[Key, Any], Body(max_length=40)]
) -> Saved:
    """Add facts about browser and screen."""
    with database.write() as session:
        return runs.save_device(session, token, device)


@router.put("/run/forms/{name}")
def put_form(services: ServicesDep, request: Request, token: RunToken, name: str, form: FormAnswers) -> Saved:
    """Store the answers of a declared form; the one that decides the group gives the run with its trials."""
    moment = services.time_of(request)
    with services.database.write() as session:
        answer = runs.save_form(
            services.settings, services.versions, services.intake, session, token, name, form.answers, moment
        )
    return json_response(answer)


@router.put("/run/stage")
def put_stage(database: DatabaseDep, token: RunToken, change: StageChange) -> Saved:
    """Report where the participant is."""
    with database.write() as session:
        return runs.save_stage(session, token, change.stage)


@router.put("/run/language")
def put_language(services: ServicesDep, token: RunToken, change: LanguageChange) -> Saved:
    """Change the language."""
    with services.database.write() as session:
        return runs.save_language(services.versions, session, token, change.language)


@router.post("/run/events")
def post_events(services: ServicesDep, request: Request, token: RunToken, events: Events) -> Received:
    """Report what happened; an event with a known id is left as it is."""
    moment = services.time_of(request)
    with services.database.write() as session:
        return Received(received=runs.save_events(session, token, events.events, moment))


@router.post("/run/complete")
def complete_run(services: ServicesDep, token: RunToken) -> Completion:
    """Close the run and get the code; refused while trials or required questions are unanswered."""
    # Reads clips, so it comes before the write and its locks.
    judge_waiting(services.database, services.intake, token)
    with services.database.write() as session:
        return runs.complete_run(services.versions, session, token)


@router.post("/run/screen-out")
def screen_out(services: ServicesDep, token: RunToken, reason: ScreenOut) -> Saved:
    """End the run because browser or screen will not do; refused where the study does not screen devices."""
    with services.database.write() as session:
        return runs.screen_out_device(services.versions, session, token, reason)


@router.post("/run/withdraw")
def withdraw_run(services: ServicesDep, token: RunToken) -> Saved:
    """Stop taking part."""
    judge_waiting(services.database, services.intake, token)
    with services.database.write() as session:
        return runs.withdraw(session, token)


# Where the page says that a view begins, and that it has ended.

view_router = APIRouter(prefix="/api", tags=["views"], responses=ERROR_RESPONSES)


@view_router.post("/run/views")
async def post_views(services: ServicesDep, request: Request, token: RunToken, body: ViewsIn) -> ViewsSaved:
    """Begin views durably and complete them; sending the same again changes nothing."""

    received_at = services.time_of(request)

    def save(connection: Connection) -> ViewsSaved:
        return view_service.save_views(
            services.versions, services.intake, connection, token, body, received_at
        )

    # Committed with other requests: one sync of the disk serves all of them.
    return json_response(await services.group_commit.run(token, save))


# The one endpoint that must never lose anything: a rating is answered after it is committed.

rating_router = APIRouter(prefix="/api", tags=["ratings"], responses=ERROR_RESPONSES)


@rating_router.put("/run/ratings/{rating_id}", status_code=201, responses={200: {"model": RatingSaved}})
async def put_rating(
    services: ServicesDep, request: Request, token: RunToken, rating_id: UUID, rating: RatingIn
) -> RatingSaved:
    """Store one rating (201); the same again is answered with the same receipt (200)."""
    received_at = services.time_of(request)

    def save(connection: Connection) -> tuple[Receipt, bool]:
        work = (services.versions, services.intake, connection, token, str(rating_id), rating)
        return rating_service.save_rating(*work, received_at)

    receipt, is_new = await services.group_commit.run(token, save)
    # Nearly every receipt has no warning; null would be sent with every answer.
    left_out: dict[str, Any] = {} if receipt.warning else {"receipt": {"warning"}}
    # After the commit: the choice of the next clips must not delay or endanger the answer.
    if rating.answer.kind in KINDS and KINDS[rating.answer.kind].adapts:
        receipt, following = await run_in_threadpool(
            next_trials, services.database, services.versions, token, receipt
        )
        saved = RatingSaved(receipt=receipt, next=following)
    else:
        saved, left_out["next"] = RatingSaved(receipt=receipt), True
    return json_response(saved, 201 if is_new else 200, left_out)


@rating_router.post("/run/refused", status_code=202)
async def post_refused(
    services: ServicesDep, request: Request, token: RunToken, record: RefusedRecord
) -> Received:
    """Take a record that was refused for good: stored where it can be, else kept with the reason."""
    received_at = services.time_of(request)
    refusal = await _stored_after_all(
        services.versions, services.intake, services.group_commit, token, record, received_at
    )
    if refusal is None:
        return Received(received=1)
    # The server's own reason where it has one: something on the way may have answered in its place.
    told = record.model_copy(update=refusal)

    def keep(connection: Connection) -> None:
        refused_records.keep_refused(services.versions, services.intake, connection, token, told, received_at)

    await services.group_commit.run(token, keep)
    return Received(received=1)


async def _stored_after_all(
    versions: Versions,
    intake: Intake,
    group_commit: GroupCommit,
    token: str,
    record: RefusedRecord,
    received_at: datetime,
) -> dict[str, Any] | None:
    """None where the record is an answer that can be stored, and now is; else why it cannot."""
    # Other records (events, views) are not tried again: their loss costs no answer.
    if not record.path.startswith(RATINGS):
        return {}
    try:
        rating = RatingIn.model_validate(record.body)
    except ValidationError as error:
        return {"status": 422, "code": "invalid", "message": refused_value(error.errors()[0])}

    def save(connection: Connection) -> tuple[Receipt, bool]:
        work = (versions, intake, connection, token, str(record.id), rating)
        return rating_service.save_rating(*work, received_at)

    try:
        await group_commit.run(token, save)
    except RatingDiffers:
        return None
    except ApiError as refusal:
        # These say that the sender has no right to write: then the refused record is not kept, either.
        if isinstance(refusal, (RunUnknown, RunClosed, *EVIDENCE_REFUSALS)):
            raise
        return {"status": refusal.status, "code": refusal.code, "message": str(refusal)}
    return None
