"""Where the page says that a view begins, and that it has ended."""

from fastapi import APIRouter, Request
from sqlalchemy import Connection
from sqlalchemy.orm import Session

from server.context import ServicesDep
from server.errors import ERROR_RESPONSES
from server.participants.endpoints import RunToken
from server.participants.lookup import find_run
from server.views import service
from server.views.schemas import ViewsIn, ViewsSaved

router = APIRouter(prefix="/api", tags=["views"], responses=ERROR_RESPONSES)


@router.post("/run/views")
async def post_views(services: ServicesDep, request: Request, token: RunToken, body: ViewsIn) -> ViewsSaved:
    """Begin views durably and complete them; sending the same again changes nothing."""

    received_at = services.time_of(request)

    def save(connection: Connection) -> ViewsSaved:
        with Session(connection, expire_on_commit=False) as session:
            saved = service.save_views(session, find_run(session, token, lock=True), body, received_at)
            session.flush()
        return saved

    return await services.group_commit.run(token, save)
