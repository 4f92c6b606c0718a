"""Studies on the dashboard."""

from fastapi import APIRouter
from fastapi.responses import PlainTextResponse

from server.accounts.permission import Viewer, Writer
from server.context import ServicesDep
from server.errors import ERROR_RESPONSES
from server.numbers import Number
from server.studies import creation, definitions, service
from server.studies.clip_schemas import ClipOut
from server.studies.definition_schemas import (
    Checked,
    DefinitionText,
    EditDefinition,
    EditedDefinition,
    JudgedEdit,
)
from server.studies.launch_checks import launch_checks
from server.studies.schemas import (
    ChangeSettings,
    ChangeStatus,
    LaunchCheck,
    NewStudy,
    NewVersion,
    ShippedExperiment,
    StudyDetail,
    StudySummary,
)
from server.workspaces.access import Uploader

router = APIRouter(prefix="/api/admin", tags=["studies"], responses=ERROR_RESPONSES)


@router.get("/experiments")
def list_experiments(services: ServicesDep, _identity: Viewer) -> list[ShippedExperiment]:
    """The experiments that come with the program."""
    return creation.shipped(services)


@router.post("/definitions/check")
def check_definition(_identity: Viewer, body: DefinitionText) -> Checked:
    """Check a definition: every problem with its line and the nearest right name, or what it expands to."""
    return definitions.check(body.toml)


@router.post("/definitions/edit")
def edit_definition(_identity: Viewer, body: EditDefinition) -> EditedDefinition:
    """Write changed data into a definition: its comments, order and form stay. Nothing is stored."""
    return definitions.edit(body)


@router.get("/studies")
def list_studies(services: ServicesDep, identity: Viewer) -> list[StudySummary]:
    """The studies that are open to the account, the latest first."""
    with services.database.read() as session:
        return service.summaries(session, identity)


@router.post("/studies", status_code=201)
def create_study(services: ServicesDep, identity: Uploader, body: NewStudy) -> StudyDetail:
    """Create a draft from a shipped experiment, a definition, or uploaded clips."""
    name = creation.create(services, body, identity)
    return get_study(services, identity, name)


@router.get("/studies/{study}")
def get_study(services: ServicesDep, identity: Viewer, study: str) -> StudyDetail:
    """One study with its declaration."""
    with services.database.read() as session:
        return service.detail(session, study, identity)


@router.delete("/studies/{study}", status_code=204)
def delete_study(services: ServicesDep, identity: Writer, study: str) -> None:
    """Delete a draft that nobody has taken part in."""
    with services.database.write() as session:
        service.delete(session, study, identity)


@router.post("/studies/{study}/versions", status_code=201)
def add_version(services: ServicesDep, identity: Writer, study: str, body: NewVersion) -> StudyDetail:
    """Store a changed definition as a new version; runs keep the version they began with."""
    creation.add_definition(services, study, body, identity)
    return get_study(services, identity, study)


@router.post("/studies/{study}/versions/check")
def judge_version(services: ServicesDep, identity: Viewer, study: str, body: DefinitionText) -> JudgedEdit:
    """Say, before a changed definition is saved, what changes and whether a new data series would begin."""
    with services.database.read() as session:
        return definitions.judge_edit(session, study, body.toml, identity)


@router.get("/studies/{study}/versions/{number}", response_class=PlainTextResponse)
def get_version(services: ServicesDep, identity: Viewer, study: str, number: Number) -> str:
    """The TOML of one version."""
    with services.database.read() as session:
        return service.version_text(session, study, number, identity)


@router.put("/studies/{study}/status")
def change_status(services: ServicesDep, identity: Writer, study: str, body: ChangeStatus) -> StudyDetail:
    """draft -> pilot -> live -> closed."""
    with services.database.write() as session:
        service.change_status(session, study, body.revision, body.status, identity)
    return get_study(services, identity, study)


@router.get("/studies/{study}/launch-checks")
def list_launch_checks(services: ServicesDep, identity: Viewer, study: str) -> list[LaunchCheck]:
    """What to look at before the study goes live."""
    with services.database.read() as session:
        return launch_checks(session, study, identity)


@router.put("/studies/{study}/settings")
def change_settings(services: ServicesDep, identity: Writer, study: str, body: ChangeSettings) -> StudyDetail:
    """Pause, quota and recruiter."""
    with services.database.write() as session:
        service.change_settings(session, study, body, identity)
    return get_study(services, identity, study)


@router.get("/studies/{study}/clips")
def list_clips(services: ServicesDep, identity: Viewer, study: str) -> list[ClipOut]:
    """Every clip of the active version with the closure curve it shows."""
    with services.database.read() as session:
        return service.clips(session, study, identity)
