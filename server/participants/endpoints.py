"""The participant's side of the API: links, runs, forms, events. A run's token is its only credential."""

from typing import Annotated, Any

from fastapi import APIRouter, Body, Depends, Request, Response
from fastapi.concurrency import run_in_threadpool
from fastapi.security import HTTPAuthorizationCredentials, HTTPBearer
from sqlalchemy import Connection
from sqlalchemy.orm import Session

from server.context import DatabaseDep, Services, ServicesDep
from server.errors import ERROR_RESPONSES
from server.evidence.waiting import judge_waiting
from server.participants import completion, form_answers, links, returning, runs
from server.participants.next_trials import follow
from server.participants.older_pages import finished_for_page
from server.participants.schemas import (
    Completion,
    Key,
    LinkState,
    Received,
    RunStart,
    RunStarted,
    RunState,
    Saved,
)
from server.participants.submissions import (
    CalibrationResult,
    Consent,
    Events,
    FormAnswers,
    LanguageChange,
    ScreenOut,
    StageChange,
    Unsupported,
)
from server.rate_limit import RateLimit
from server.tokens import hash_token
from server.trials.refusals import RunUnknown

RUN_START_WEIGHT = 8
"""A run start takes about as long as so many ratings."""
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


def _count(services: Services, limit: RateLimit, token: str) -> None:
    """Count one event of a link that exists: strangers' inventions would take the room of true counts."""
    with services.database.read() as session:
        links.find_link(session, token)
    limit.hit(hash_token(token))


@router.get("/links/{link_token}")
def get_link(services: ServicesDep, link_token: str) -> LinkState:
    """Where a link leads and whether it is open."""
    with services.database.read() as session:
        return links.link_state(services, session, link_token)


@router.post("/links/{link_token}/runs", status_code=201, responses={200: {"model": RunStarted}})
async def start_run(
    services: ServicesDep, link_token: str, start: RunStart, response: Response
) -> RunStarted:
    """Begin a run (201), or take up the one this browser, person or personal link has (200)."""
    await run_in_threadpool(_count, services, services.run_starts, link_token)
    if start.resume_code is not None:
        await run_in_threadpool(returning.count_code, services, link_token, start.resume_code)

    def begin(connection: Connection) -> RunStarted:
        with Session(connection, expire_on_commit=False, info=services.database.carried) as session:
            started = links.start_run(services, session, link_token, start)
            session.flush()
        return started

    started = await services.group_commit.run(link_token, begin, RUN_START_WEIGHT)
    response.status_code = 200 if started.resumed else 201
    return started


@router.post("/unsupported", status_code=202)
def report_unsupported(services: ServicesDep, report: Unsupported) -> Received:
    """Tell the server that a browser or screen was turned away before a run began."""
    _count(services, services.unsupported, report.link_token)
    with services.database.write() as session:
        runs.save_unsupported(session, report)
    return Received(received=1)


@router.get("/run")
def get_run(services: ServicesDep, request: Request, token: RunToken) -> RunState:
    """Everything the page needs to begin or to go on."""
    moment = services.time_of(request)
    with services.database.read() as session:
        state = runs.run_state(services, session, token, moment)
    if any(trial.series for trial in state.trials) and follow(services, token) is not None:
        with services.database.read() as session:
            state = runs.run_state(services, session, token, moment)
    return finished_for_page(services, request, token, state)


@router.put("/run/consent")
def put_consent(services: ServicesDep, token: RunToken, consent: Consent) -> Saved:
    """Agree to take part; `agreed: false` ends the run."""
    with services.database.write() as session:
        return runs.save_consent(services, session, token, consent.agreed)


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
        answer = form_answers.save_form(services, session, token, name, form.answers, moment)
    return finished_for_page(services, request, token, answer)


@router.put("/run/stage")
def put_stage(database: DatabaseDep, token: RunToken, change: StageChange) -> Saved:
    """Tell where the participant is."""
    with database.write() as session:
        return runs.save_stage(session, token, change.stage)


@router.put("/run/language")
def put_language(services: ServicesDep, token: RunToken, change: LanguageChange) -> Saved:
    """Change the language."""
    with services.database.write() as session:
        return runs.save_language(services, session, token, change.language)


@router.post("/run/events")
def post_events(services: ServicesDep, request: Request, token: RunToken, events: Events) -> Received:
    """Tell what happened; an event with a known id is left as it is."""
    moment = services.time_of(request)
    with services.database.write() as session:
        return Received(received=runs.save_events(session, token, events.events, moment))


@router.post("/run/complete")
def complete_run(services: ServicesDep, token: RunToken) -> Completion:
    """Close the run and get the code; refused while trials or required questions are unanswered."""
    judge_waiting(services.database, services.intake, token)
    with services.database.write() as session:
        return completion.complete_run(services, session, token)


@router.post("/run/screen-out")
def screen_out(services: ServicesDep, token: RunToken, reason: ScreenOut) -> Saved:
    """End the run because browser or screen will not do; refused where the study does not screen devices."""
    with services.database.write() as session:
        return runs.screen_out_device(services, session, token, reason)


@router.post("/run/withdraw")
def withdraw_run(services: ServicesDep, token: RunToken) -> Saved:
    """Stop taking part."""
    judge_waiting(services.database, services.intake, token)
    with services.database.write() as session:
        return runs.withdraw(session, token)
