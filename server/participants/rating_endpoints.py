"""The one endpoint that must never lose anything: a rating is answered after it is committed."""

from typing import Any
from uuid import UUID

from fastapi import APIRouter, Request
from fastapi.concurrency import run_in_threadpool
from sqlalchemy import Connection

from experiments.trials import KINDS
from server.context import ServicesDep
from server.errors import ERROR_RESPONSES
from server.finished import finished
from server.participants.endpoints import RunToken
from server.participants.next_trials import next_trials
from server.participants.older_pages import finished_for_page
from server.trials import service
from server.trials.schemas import RatingIn, RatingSaved, Receipt

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
