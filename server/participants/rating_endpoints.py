"""The one endpoint that must never lose anything: a rating is answered after it is committed."""

from datetime import datetime
from typing import Any
from uuid import UUID

from fastapi import APIRouter, Request
from fastapi.concurrency import run_in_threadpool
from pydantic import ValidationError
from sqlalchemy import Connection

from experiments.trials import KINDS
from server.context import Services, ServicesDep
from server.errors import ERROR_RESPONSES, ApiError
from server.evidence.refusals import EVIDENCE_REFUSALS
from server.finished import finished
from server.participants.endpoints import RunToken
from server.participants.next_trials import next_trials
from server.participants.older_pages import finished_for_page
from server.participants.schemas import Received
from server.refused_values import refused_value
from server.trials import refused_records, service
from server.trials.refusals import RunClosed, RunUnknown
from server.trials.schemas import RATINGS, RatingIn, RatingSaved, Receipt, RefusedRecord
from server.trials.service import RatingDiffers

router = APIRouter(prefix="/api", tags=["ratings"], responses=ERROR_RESPONSES)


@router.put("/run/ratings/{rating_id}", status_code=201, responses={200: {"model": RatingSaved}})
async def put_rating(
    services: ServicesDep, request: Request, token: RunToken, rating_id: UUID, rating: RatingIn
) -> RatingSaved:
    """Store one rating (201); the same again is answered with the same receipt (200)."""
    received_at = services.time_of(request)

    def save(connection: Connection) -> tuple[Receipt, bool]:
        work = (services.versions, services.intake, connection, token, str(rating_id), rating)
        return service.save_rating(*work, received_at)

    receipt, is_new = await services.group_commit.run(token, save)
    left_out: dict[str, Any] = {} if receipt.warning else {"receipt": {"warning"}}
    if rating.answer.kind in KINDS and KINDS[rating.answer.kind].adapts:
        receipt, following = await run_in_threadpool(next_trials, services, token, receipt)
        saved = RatingSaved(receipt=receipt, next=following)
    else:
        saved, left_out["next"] = RatingSaved(receipt=receipt), True
    status = 201 if is_new else 200
    if saved.next is None:
        return finished(saved, status, left_out)
    return await run_in_threadpool(finished_for_page, services, request, token, saved, status, left_out)


@router.post("/run/refused", status_code=202)
async def post_refused(
    services: ServicesDep, request: Request, token: RunToken, record: RefusedRecord
) -> Received:
    """Take a record that was refused for good: stored where it can be, else kept with the reason."""
    received_at = services.time_of(request)
    refusal = await _stored_after_all(services, token, record, received_at)
    if refusal is None:
        return Received(received=1)
    # The server's own reason where it has one: something on the way may have answered in its place.
    told = record.model_copy(update=refusal)

    def keep(connection: Connection) -> None:
        refused_records.keep(services.versions, services.intake, connection, token, told, received_at)

    await services.group_commit.run(token, keep)
    return Received(received=1)


async def _stored_after_all(
    services: Services, token: str, record: RefusedRecord, received_at: datetime
) -> dict[str, Any] | None:
    """None where the record is an answer that can be stored, and now is; else why it cannot."""
    if not record.path.startswith(RATINGS):
        return {}
    try:
        rating = RatingIn.model_validate(record.body)
    except ValidationError as error:
        return {"status": 422, "code": "invalid", "message": refused_value(error.errors()[0])}

    def save(connection: Connection) -> tuple[Receipt, bool]:
        work = (services.versions, services.intake, connection, token, str(record.id), rating)
        return service.save_rating(*work, received_at)

    try:
        await services.group_commit.run(token, save)
    except RatingDiffers:
        return None
    except ApiError as refusal:
        if isinstance(refusal, (RunUnknown, RunClosed, *EVIDENCE_REFUSALS)):
            raise
        return {"status": refusal.status, "code": refusal.code, "message": str(refusal)}
    return None
