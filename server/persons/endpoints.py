"""Subject access by the admin site."""

from fastapi import APIRouter, Response

from server.accounts.permission import Myself
from server.context import ServicesDep
from server.errors import ERROR_RESPONSES
from server.persons import service
from server.studies.lookup import find_study

router = APIRouter(prefix="/api/admin/studies/{study}/runs", tags=["participants"], responses=ERROR_RESPONSES)


@router.get("/{run}/subject-access", response_class=Response)
def get_subject_access(services: ServicesDep, identity: Myself, study: str, run: str) -> Response:
    """Everything stored of one person in the study, as JSON; for owners, and in the audit log."""
    with services.database.write() as session:
        known = find_study(session, study, identity, "own")
        visits = service.visits_of(session, known, run, "")
        told = service.subject_access(session, known, visits, identity)
    headers = {"content-disposition": f'attachment; filename="{known.name}-{visits[0].public_id}.json"'}
    return Response(told, media_type="application/json", headers=headers)
