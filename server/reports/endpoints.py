"""The analysis report of a study, built on request."""

from fastapi import APIRouter
from fastapi.responses import FileResponse

from server.accounts.permission import ReportReader, Viewer, Writer
from server.context import ServicesDep
from server.errors import ERROR_RESPONSES
from server.reports import service
from server.reports.schemas import NewReport, ReportOut

router = APIRouter(prefix="/api/admin/studies/{study}/reports", tags=["reports"], responses=ERROR_RESPONSES)
# A report is one page with its own styles and pictures inside; it may load and run nothing.
REPORT_POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data:; sandbox allow-popups"


@router.get("")
def list_reports(services: ServicesDep, identity: Viewer, study: str) -> list[ReportOut]:
    """The latest reports, the newest first."""
    with services.database.read() as session:
        return service.reports(services, session, study, identity)


@router.post("", status_code=202)
def build_report(services: ServicesDep, identity: Writer, study: str, body: NewReport) -> ReportOut:
    """Begin a report: exclusions, the paper's table, every test, figures."""
    return service.start(services, study, body, identity)


@router.get("/{report}/{file}", response_class=FileResponse)
def get_report_file(
    services: ServicesDep, identity: ReportReader, study: str, report: str, file: str, download: bool = False
) -> FileResponse:
    """One file of a finished report: needs the right `export`, for it holds rows of single persons."""
    with services.database.read() as session:
        path = service.report_file(services, session, study, identity, report, file)
    kind = "attachment" if download or path.suffix != ".html" else "inline"
    headers = {"content-security-policy": REPORT_POLICY}
    return FileResponse(path, filename=f"{study}-{path.name}", content_disposition_type=kind, headers=headers)
