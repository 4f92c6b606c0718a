"""Before a study goes live: the checklist, and the dress rehearsal with simulated people in a sandbox."""

from functools import partial

from fastapi import APIRouter
from fastapi.responses import FileResponse

from server.accounts.access import Viewer, Writer
from server.context import ServicesDep
from server.core.errors import ERROR_RESPONSES
from server.core.requests import DatabaseDep, SettingsDep
from server.exports.reports import REPORT_POLICY
from server.operations.doctor import findings_for_studies
from server.rehearsals import service
from server.rehearsals.schemas import NewRehearsal, RehearsalOut, RehearsalResult
from server.studies.schemas import LaunchCheck

launch_router = APIRouter(prefix="/api/admin", tags=["studies"], responses=ERROR_RESPONSES)


@launch_router.get("/studies/{study}/launch-checks")
def list_launch_checks(services: ServicesDep, identity: Viewer, study: str) -> list[LaunchCheck]:
    """What to look at before the study goes live."""
    return service.preflight(
        services.database,
        services.settings,
        services.stored_clips,
        partial(findings_for_studies, services),
        study,
        identity,
    )


router = APIRouter(
    prefix="/api/admin/studies/{study}/rehearsals", tags=["studies"], responses=ERROR_RESPONSES
)


@router.get("/latest")
def get_latest_rehearsal(services: ServicesDep, identity: Viewer, study: str) -> RehearsalOut | None:
    """The latest rehearsal, and how far it is; null where there is none."""
    with services.database.read() as session:
        return service.latest(services.locks, session, study, identity)


@router.post("", status_code=202)
def begin_rehearsal(services: ServicesDep, identity: Writer, study: str, body: NewRehearsal) -> RehearsalOut:
    """Simulate people in a separate database; this replaces the previous rehearsal."""
    return service.start(services.database, services.settings, services.locks, study, body, identity)


@router.get("/{rehearsal}")
def get_rehearsal(
    database: DatabaseDep, settings: SettingsDep, identity: Viewer, study: str, rehearsal: str
) -> RehearsalResult:
    """What a rehearsal showed: orders, times, columns, report and power."""
    with database.read() as session:
        return service.result(settings, session, study, identity, rehearsal)


@router.post("/{rehearsal}/cancel", status_code=204)
def cancel_rehearsal(services: ServicesDep, identity: Writer, study: str, rehearsal: str) -> None:
    """End a rehearsal that waits or goes on."""
    service.cancel(services.database, services.settings, services.locks, study, identity, rehearsal)


@router.get("/{rehearsal}/report/{file}", response_class=FileResponse)
def get_rehearsed_report_file(
    database: DatabaseDep, settings: SettingsDep, identity: Viewer, study: str, rehearsal: str, file: str
) -> FileResponse:
    """One file of the report that the simulated people would give."""
    with database.read() as session:
        path = service.report_file(settings, session, study, identity, rehearsal, file)
    kind = "attachment" if path.suffix != ".html" else "inline"
    headers = {"content-security-policy": REPORT_POLICY}
    name = f"{study}-rehearsal-{path.name}"
    return FileResponse(path, filename=name, content_disposition_type=kind, headers=headers)
