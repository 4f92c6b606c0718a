"""What the declared periods of a study will erase, and when."""

from fastapi import APIRouter

from server.accounts.permission import Myself
from server.clock import now
from server.context import ServicesDep
from server.errors import ERROR_RESPONSES
from server.retention import service
from server.retention.schemas import RetentionPreview
from server.studies.lookup import find_study

router = APIRouter(
    prefix="/api/admin/studies/{study}/retention", tags=["participants"], responses=ERROR_RESPONSES
)


@router.get("")
def get_retention(services: ServicesDep, identity: Myself, study: str) -> RetentionPreview:
    """The periods that the study declares, what is due by them now, and when something is due next."""
    with services.database.read() as session:
        return service.preview(session, find_study(session, study, identity, "view"), now())
