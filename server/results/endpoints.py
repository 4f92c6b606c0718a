"""The results page's data."""

from typing import Annotated, Literal

from fastapi import APIRouter, Header, Response
from sqlalchemy.orm import Session

from server.accounts.identity import Viewer
from server.context import ServicesDep
from server.errors import ERROR_RESPONSES
from server.models import Study
from server.results import repository, service
from server.results.cache import Revision
from server.results.schemas import Results
from server.studies.lookup import active_definition, find_study

router = APIRouter(prefix="/api/admin/studies/{study}", tags=["results"], responses=ERROR_RESPONSES)


def _counted(session: Session, study: Study, phase: str) -> tuple[Revision, Results]:
    # The revision is read first: a rating that comes in between is counted again, never left out.
    revision = repository.revision(session, study, phase)
    return revision, service.results(session, study, active_definition(session, study), phase)


@router.get("/results", response_model=Results, responses={304: {"description": "Nothing has changed."}})
def get_results(
    services: ServicesDep,
    _who: Viewer,
    study: str,
    phase: Literal["pilot", "live"] = "live",
    if_none_match: Annotated[str | None, Header()] = None,
) -> Response:
    """Means with within-participant error bars, distributions, response times and playback so far.

    With the ETag of an earlier answer as `If-None-Match` it is 304 where nothing has changed. Where counting
    takes long `counted_at` may lie some time back.
    """

    def count() -> tuple[Revision, Results]:
        with services.database.read() as session:
            return _counted(session, find_study(session, study), phase)

    with services.database.read() as session:
        found = find_study(session, study)
        key, revision = (found.id, phase), repository.revision(session, found, phase)
    counted = services.results.get(key, revision, count)
    headers = {"etag": counted.etag, "cache-control": "private, no-cache"}
    if if_none_match == counted.etag:
        return Response(status_code=304, headers=headers)
    return Response(counted.results.model_dump_json(), media_type="application/json", headers=headers)
