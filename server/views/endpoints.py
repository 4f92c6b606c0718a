"""Where the page says that a view begins, and that it has ended."""

from fastapi import APIRouter

from server.context import ServicesDep
from server.errors import ERROR_RESPONSES
from server.participants.endpoints import RunToken
from server.views import service
from server.views.schemas import ViewsIn, ViewsSaved

router = APIRouter(prefix="/api", tags=["views"], responses=ERROR_RESPONSES)


@router.post("/run/views")
def post_views(services: ServicesDep, token: RunToken, body: ViewsIn) -> ViewsSaved:
    """Begin views durably and complete them; sending the same again changes nothing."""
    with services.database.write() as session:
        return service.save_views(session, token, body)
