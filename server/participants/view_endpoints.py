"""Where the page says that a view begins, and that it has ended."""

from fastapi import APIRouter, Request
from sqlalchemy import Connection

from server.context import ServicesDep
from server.errors import ERROR_RESPONSES
from server.finished import finished
from server.participants.endpoints import RunToken
from server.views import service
from server.views.schemas import ViewsIn, ViewsSaved

router = APIRouter(prefix="/api", tags=["views"], responses=ERROR_RESPONSES)


@router.post("/run/views")
async def post_views(services: ServicesDep, request: Request, token: RunToken, body: ViewsIn) -> ViewsSaved:
    """Begin views durably and complete them; sending the same again changes nothing."""

    received_at = services.time_of(request)

    def save(connection: Connection) -> ViewsSaved:
        return service.save_views(services.versions, services.intake, connection, token, body, received_at)

    return finished(await services.group_commit.run(token, save))
