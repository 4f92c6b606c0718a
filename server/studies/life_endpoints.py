"""A study's life cycle on the dashboard: copies, the archive, comparisons of versions."""

from typing import Annotated

from fastapi import APIRouter, Query

from server.accounts.permission import Viewer, Writer
from server.context import ServicesDep
from server.errors import ERROR_RESPONSES
from server.numbers import Number
from server.studies import comparing, life_cycle, service
from server.studies.life_schemas import ArchiveStudy, CloneStudy, Comparison
from server.studies.schemas import StudyDetail

router = APIRouter(prefix="/api/admin/studies/{study}", tags=["studies"], responses=ERROR_RESPONSES)


@router.post("/copies", status_code=201)
def clone_study(services: ServicesDep, identity: Writer, study: str, body: CloneStudy) -> StudyDetail:
    """Copy a version's declaration and clips into a new draft; links, quota and recruiter are not copied."""
    with services.database.write() as session:
        life_cycle.clone(session, study, body, identity)
    with services.database.read() as session:
        return service.detail(session, body.name, identity)


@router.put("/archive")
def archive_study(services: ServicesDep, identity: Writer, study: str, body: ArchiveStudy) -> StudyDetail:
    """Put a draft or closed study into the archive, where it can be read but not changed, or take it out."""
    with services.database.write() as session:
        life_cycle.archive(session, study, body, identity)
    with services.database.read() as session:
        return service.detail(session, study, identity)


@router.get("/comparison")
def compare_versions(
    services: ServicesDep,
    identity: Viewer,
    study: str,
    old: Number,
    new: Number,
    other: Annotated[str | None, Query(description="The study that `old` is a version of.")] = None,
) -> Comparison:
    """What differs between two versions: keys of the declaration, word by word, and clips."""
    with services.database.read() as session:
        return comparing.compare(session, (other or study, old), (study, new), identity)
