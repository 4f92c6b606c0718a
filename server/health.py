"""Whether the server lives, and whether it can serve."""

from fastapi import APIRouter
from pydantic import BaseModel
from sqlalchemy import select

from server.context import ServicesDep
from server.errors import ERROR_RESPONSES, ApiError
from server.migrate import current_revision, newest_revision
from server.models import Clip

router = APIRouter(tags=["health"], responses=ERROR_RESPONSES)


class Health(BaseModel):
    """A short word."""

    status: str


class NotReady(ApiError):
    """The server runs but cannot serve yet."""

    status = 503
    code = "not_ready"


@router.get("/healthz")
async def healthz() -> Health:
    """The process answers."""
    return Health(status="ok")


@router.get("/readyz", responses={503: ERROR_RESPONSES["4XX"]})
def readyz(services: ServicesDep) -> Health:
    """The database answers and has the newest revision; clips can be read."""
    found, expected = current_revision(services.database), newest_revision()
    if found != expected:
        raise NotReady(
            f"The database has revision {found}, expected {expected}; run `server database upgrade`."
        )
    with services.database.read() as session:
        clip = session.scalar(select(Clip.sha256).order_by(Clip.created_at.desc()).limit(1))
    if problem := services.clips.problem(clip):
        raise NotReady(f"Clips cannot be read: {problem}; `server doctor` says what to do.")
    return Health(status="ready")
