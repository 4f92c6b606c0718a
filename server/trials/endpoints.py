"""The one endpoint that must never lose anything: a rating is answered after it is committed."""

from uuid import UUID

from fastapi import APIRouter, Response

from server.context import ServicesDep
from server.errors import ERROR_RESPONSES
from server.participants.endpoints import RunToken
from server.trials import service
from server.trials.schemas import RatingIn, RatingSaved

router = APIRouter(prefix="/api", tags=["ratings"], responses=ERROR_RESPONSES)


@router.put("/run/ratings/{rating_id}", status_code=201, responses={200: {"model": RatingSaved}})
def put_rating(
    services: ServicesDep, token: RunToken, rating_id: UUID, rating: RatingIn, response: Response
) -> RatingSaved:
    """Store one rating (201); the same again is answered with the same receipt (200)."""
    with services.database.write() as session:
        receipt, is_new = service.save_rating(services, session, token, str(rating_id), rating)
    response.status_code = 201 if is_new else 200
    return RatingSaved(receipt=receipt)
