"""Subject access, and what the declared periods of a study will erase."""

from fastapi import APIRouter, Response

from server.accounts.access import Myself
from server.core.errors import ERROR_RESPONSES
from server.core.requests import DatabaseDep
from server.core.values import now
from server.privacy import persons as person_service
from server.privacy import retention as retention_service
from server.privacy.retention import RetentionPreview
from server.studies.lookup import find_study

# Subject access by the admin site.

person_router = APIRouter(
    prefix="/api/admin/studies/{study}/runs", tags=["participants"], responses=ERROR_RESPONSES
)


@person_router.get("/{run}/subject-access", response_class=Response)
def get_subject_access(database: DatabaseDep, identity: Myself, study: str, run: str) -> Response:
    """Everything stored of one person in the study, as JSON; for owners, and in the audit log."""
    with database.write() as session:
        known = find_study(session, study, identity, "own")
        visits = person_service.visits_of(session, known, run, "")
        told = person_service.subject_access(session, known, visits, identity)
    headers = {"content-disposition": f'attachment; filename="{known.name}-{visits[0].public_id}.json"'}
    return Response(told, media_type="application/json", headers=headers)


# What the declared periods of a study will erase, and when.

retention_router = APIRouter(
    prefix="/api/admin/studies/{study}/retention", tags=["participants"], responses=ERROR_RESPONSES
)


@retention_router.get("")
def get_retention(database: DatabaseDep, identity: Myself, study: str) -> RetentionPreview:
    """The periods that the study declares, what is due by them now, and when something is due next."""
    with database.read() as session:
        return retention_service.preview(session, find_study(session, study, identity, "view"), now())
