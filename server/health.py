"""Whether the server lives, and whether it can serve."""

from fastapi import APIRouter
from pydantic import BaseModel
from sqlalchemy import text

from server.context import DatabaseDep
from server.errors import ERROR_RESPONSES, ApiError
from server.migrate import current_revision, newest_revision

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
def readyz(database: DatabaseDep) -> Health:
    """The database answers and has the newest revision."""
    with database.read() as session:
        session.execute(text("SELECT 1"))
    found, expected = current_revision(database), newest_revision()
    if found != expected:
        raise NotReady(
            f"The database has revision {found}, expected {expected}; run `server database upgrade`."
        )
    return Health(status="ready")
