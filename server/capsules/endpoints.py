"""The capsule of a study: everything that can be handed on, in one zip."""

from fastapi import APIRouter
from fastapi.responses import FileResponse

from server.accounts.permission import ReportReader, Viewer, Writer
from server.capsules import service
from server.capsules.schemas import CapsuleOut, NewCapsule
from server.context import ServicesDep
from server.errors import ERROR_RESPONSES

router = APIRouter(prefix="/api/admin/studies/{study}/capsules", tags=["data"], responses=ERROR_RESPONSES)


@router.get("")
def list_capsules(services: ServicesDep, identity: Viewer, study: str) -> list[CapsuleOut]:
    """The latest capsules, the newest first."""
    with services.database.read() as session:
        return service.capsules(services, session, study, identity)


@router.post("", status_code=202)
def build_study_capsule(services: ServicesDep, identity: Writer, study: str, body: NewCapsule) -> CapsuleOut:
    """Begin a capsule: Psych-DS and RO-Crate with data, clips, definition, seal, plan and report."""
    return service.start(services, study, body, identity)


@router.get("/{capsule}.zip", response_class=FileResponse)
def get_capsule(services: ServicesDep, identity: ReportReader, study: str, capsule: str) -> FileResponse:
    """A finished capsule. Anybody can verify it with `analysis verify`."""
    with services.database.read() as session:
        path = service.capsule_file(services, session, study, identity, capsule)
    return FileResponse(path, filename=f"{study}-capsule.zip", media_type="application/zip")


@router.delete("/{capsule}", status_code=204)
def remove_capsule(services: ServicesDep, identity: Writer, study: str, capsule: str) -> None:
    """Delete a capsule for good; one that is being made is left alone."""
    service.remove(services, study, capsule, identity)
