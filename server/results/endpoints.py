"""The results page's data."""

from typing import Literal

from fastapi import APIRouter

from server.accounts.identity import Viewer
from server.context import ServicesDep
from server.errors import ERROR_RESPONSES
from server.results import service
from server.results.schemas import Results
from server.studies.lookup import active_definition, find_study

router = APIRouter(prefix="/api/admin/studies/{study}", tags=["results"], responses=ERROR_RESPONSES)


@router.get("/results")
def get_results(
    services: ServicesDep, _who: Viewer, study: str, phase: Literal["pilot", "live"] = "live"
) -> Results:
    """Means with within-participant error bars, distributions, response times and playback so far."""
    with services.database.read() as session:
        found = find_study(session, study)
        return service.results(session, found, active_definition(session, found), phase)
