"""Studies on the dashboard: their life cycle and their links."""

from datetime import timedelta
from typing import Annotated, Any

from fastapi import APIRouter, Query, Response
from fastapi.responses import PlainTextResponse

from server.accounts.access import Myself, Viewer, Writer
from server.accounts.audit import record
from server.accounts.workspaces import Uploader
from server.context import ServicesDep
from server.core.errors import ERROR_RESPONSES
from server.core.requests import DatabaseDep, SettingsDep
from server.core.settings import Settings
from server.core.values import Number, now
from server.models import Link
from server.studies import creation, series, service
from server.studies.launch_checks import refuse_recruiter
from server.studies.links import (
    LinkOptions,
    link_in_use,
    link_url,
    links_with_runs,
    make_links,
    numbered_labels,
    page_of_links,
    prepared_links,
    signing_of,
    withdraw,
)
from server.studies.lookup import find_study
from server.studies.schemas import (
    ArchiveStudy,
    BuilderWork,
    ChangeSettings,
    ChangeStatus,
    ClipOut,
    CloneStudy,
    Comparison,
    DefinitionCheck,
    DefinitionText,
    DraftOut,
    EditDefinition,
    EditedDefinition,
    EditedVersion,
    EditorOut,
    JudgedEdit,
    Label,
    LaunchCheck,
    LinkOut,
    LinkPage,
    ListedStudy,
    NewLinks,
    NewStudy,
    NewVersion,
    ShippedExperiment,
    Signing,
    StudyDetail,
    Tab,
)
from table_files.formulas import guarded_table

# Studies on the dashboard.

router = APIRouter(prefix="/api/admin", tags=["studies"], responses=ERROR_RESPONSES)


@router.get("/experiments")
def list_experiments(settings: SettingsDep, _identity: Viewer) -> list[ShippedExperiment]:
    """The experiments that come with the program."""
    return creation.shipped_experiments(settings)


@router.post("/definitions/check")
def check_definition(_identity: Viewer, body: DefinitionText) -> DefinitionCheck:
    """Check a definition: every problem with its line and the nearest right name, or what it expands to."""
    return service.check_definition(body.toml)


@router.post("/definitions/edit")
def edit_definition(_identity: Viewer, body: EditDefinition) -> EditedDefinition:
    """Write changed data into a definition: its comments, order and form stay. Nothing is stored."""
    return service.edit_definition(body)


@router.get("/studies")
def list_studies(database: DatabaseDep, identity: Viewer) -> list[ListedStudy]:
    """The studies that are open to the account, the latest first."""
    with database.read() as session:
        return service.summaries(session, identity)


@router.post("/studies", status_code=201)
def create_study(services: ServicesDep, identity: Uploader, body: NewStudy) -> StudyDetail:
    """Create a draft from a shipped experiment, a definition, or uploaded clips."""
    name = creation.create(services.database, services.settings, services.clips, body, identity)
    return get_study(services.database, identity, name)


@router.get("/studies/{study}")
def get_study(database: DatabaseDep, identity: Viewer, study: str) -> StudyDetail:
    """One study with its declaration."""
    with database.read() as session:
        return service.detail(session, study, identity)


@router.delete("/studies/{study}", status_code=204)
def delete_study(database: DatabaseDep, identity: Writer, study: str) -> None:
    """Delete a draft that nobody has taken part in."""
    with database.write() as session:
        service.delete(session, study, identity)


@router.post("/studies/{study}/versions", status_code=201)
def add_version(services: ServicesDep, identity: Writer, study: str, body: NewVersion) -> StudyDetail:
    """Store a changed definition as a new version; runs keep the version they began with."""
    creation.add_definition(
        services.database, services.settings, services.clips, services.stored_clips, study, body, identity
    )
    return get_study(services.database, identity, study)


@router.post("/studies/{study}/versions/check")
def judge_version(database: DatabaseDep, identity: Viewer, study: str, body: EditedVersion) -> JudgedEdit:
    """Say, before a changed definition is saved, what changes and whether a new data series would begin."""
    with database.read() as session:
        return service.judge_edit(session, study, body, identity)


@router.get("/studies/{study}/versions/{number}", response_class=PlainTextResponse)
def get_version(database: DatabaseDep, identity: Viewer, study: str, number: Number) -> str:
    """The TOML of one version."""
    with database.read() as session:
        return service.version_text(session, study, number, identity)


@router.put("/studies/{study}/status")
def change_status(services: ServicesDep, identity: Writer, study: str, body: ChangeStatus) -> StudyDetail:
    """draft -> pilot -> live -> closed. Before a study is live, the server decodes each of its clips."""
    database, of_clips = services.database, list[LaunchCheck]()
    if body.status == "live":
        of_clips = service.find_clip_faults(database, services.stored_clips, study, identity)
    with database.write() as session:
        service.change_status(session, study, body, identity, of_clips)
    return get_study(database, identity, study)


@router.put("/studies/{study}/settings")
def change_settings(database: DatabaseDep, identity: Writer, study: str, body: ChangeSettings) -> StudyDetail:
    """Pause, quota and recruiter."""
    with database.write() as session:
        service.change_settings(session, study, body, identity)
    return get_study(database, identity, study)


@router.get("/studies/{study}/clips")
def list_clips(database: DatabaseDep, identity: Viewer, study: str) -> list[ClipOut]:
    """Every clip of the active version with the closure curve it shows."""
    with database.read() as session:
        return service.clips(session, study, identity)


# A study's life cycle on the dashboard: copies, the archive, comparisons of versions.

life_router = APIRouter(prefix="/api/admin/studies/{study}", tags=["studies"], responses=ERROR_RESPONSES)


@life_router.post("/copies", status_code=201)
def clone_study(database: DatabaseDep, identity: Writer, study: str, body: CloneStudy) -> StudyDetail:
    """Copy a version's declaration and clips into a new draft; links, quota and recruiter are not copied."""
    with database.write() as session:
        service.clone_study(session, study, body, identity)
    with database.read() as session:
        return service.detail(session, body.name, identity)


@life_router.put("/archive")
def archive_study(database: DatabaseDep, identity: Writer, study: str, body: ArchiveStudy) -> StudyDetail:
    """Put a draft or closed study into the archive, where it can be read but not changed, or take it out."""
    with database.write() as session:
        service.archive_study(session, study, body, identity)
    with database.read() as session:
        return service.detail(session, study, identity)


@life_router.get("/comparison")
def compare_versions(
    database: DatabaseDep,
    identity: Viewer,
    study: str,
    old: Number,
    new: Number,
    other: Annotated[str | None, Query(description="The study that `old` is a version of.")] = None,
) -> Comparison:
    """What differs between two versions: keys of the declaration, word by word, and clips."""
    with database.read() as session:
        return series.compare_versions(session, (other or study, old), (study, new), identity)


# Unsaved work of the builder, and who has it open.


@life_router.get("/drafts")
def list_drafts(database: DatabaseDep, identity: Writer, study: str) -> list[DraftOut]:
    """Your own unsaved work on this study, the latest first; it is shown to nobody else."""
    with database.read() as session:
        return service.own_drafts(session, study, identity)


@life_router.put("/drafts/{tab}", status_code=204)
def save_draft(database: DatabaseDep, identity: Writer, study: str, tab: Tab, body: BuilderWork) -> None:
    """Keep the unsaved work of one tab."""
    with database.write() as session:
        service.save_draft(session, study, tab, body, identity)


@life_router.delete("/drafts/{tab}", status_code=204)
def discard_draft(database: DatabaseDep, identity: Writer, study: str, tab: Tab) -> None:
    """Forget the unsaved work of one tab."""
    with database.write() as session:
        service.discard_draft(session, study, tab, identity)


@life_router.post("/editors/{tab}")
def list_editors(database: DatabaseDep, identity: Writer, study: str, tab: Tab) -> list[EditorOut]:
    """Note that a tab has the builder open; who else has."""
    with database.write() as session:
        return service.other_editors(session, study, tab, identity)


# Links on the dashboard.

link_router = APIRouter(prefix="/api/admin/studies/{study}/links", tags=["links"], responses=ERROR_RESPONSES)


Limit = Annotated[int, Query(ge=1, le=1000)]
LINKS_READ_AT_ONCE = 1000
_SHOWN = ("kind", "label", "group_name", "quota", "expires_at", "created_at", "recruiter")


def _link_out(settings: Settings, row: Link | dict[str, Any], runs: int = 0, complete: int = 0) -> LinkOut:
    values = row if isinstance(row, dict) else vars(row)
    own = {name: values[name] for name in _SHOWN}
    url = link_url(settings.public_url, settings.key, values["public_id"])
    return LinkOut(id=values["public_id"], url=url, runs=runs, complete=complete, **own)


@link_router.get("")
def list_links(
    database: DatabaseDep,
    settings: SettingsDep,
    identity: Writer,
    study: str,
    after: str | None = None,
    limit: Limit = 100,
) -> LinkPage:
    """The links of a study in the order they were made, a page at a time: go on with `after` = `next`."""
    with database.read() as session:
        known = find_study(session, study, identity, "run")
        page = page_of_links(session, known, after, limit)
        return LinkPage(
            links=[_link_out(settings, link, *runs) for link, runs in page.links],
            total=page.total,
            next=page.next,
        )


@link_router.post("", status_code=201)
def create_links(
    database: DatabaseDep, settings: SettingsDep, identity: Writer, study: str, body: NewLinks
) -> list[LinkOut]:
    """Make a general or preview link, or many personal ones: by their labels, or `count` numbered ones."""
    labels = [body.label]
    if body.kind == "personal":
        labels = body.labels or numbered_labels(body.label, body.count)
    options = LinkOptions(
        body.kind,
        group_name=body.group,
        quota=body.quota,
        expires_at=now() + timedelta(days=body.days) if body.days else None,
        recruiter=body.recruiter.model_dump() if body.recruiter else None,
        created_by=identity.account_id,
    )
    rows = prepared_links(settings.key, options, labels)
    with database.write() as session:
        known = find_study(session, study, identity, "run")
        refuse_recruiter(known, body.recruiter, "Links")
        make_links(session, known, body.kind, body.group, rows)
        record(session, identity, "links made", "study", study, links=body.kind, number=len(rows))
    return [_link_out(settings, row) for row in rows]


@link_router.get("/signing")
def get_signing(
    database: DatabaseDep,
    settings: SettingsDep,
    identity: Myself,
    study: str,
    secret_name: Label | None = None,
    link: Label | None = None,
) -> Signing:
    """The secret for signed URLs, with examples; for owners alone, each look is in the audit log.

    If a link has its own recruiter, give its id as `link`; otherwise the study's recruiter counts.
    """
    with database.write() as session:
        known = find_study(session, study, identity, "own")
        of_link = None if link is None else link_in_use(session, known, link)
        return signing_of(session, settings.key, known, secret_name, identity, of_link)


@link_router.get("/personal.csv", response_class=Response)
def download_personal_links(
    database: DatabaseDep, settings: SettingsDep, identity: Writer, study: str
) -> Response:
    """The personal links as CSV: label, link, runs, complete, group."""
    rows: list[tuple[Any, ...]] = [("label", "url", "runs", "complete", "group")]
    with database.read() as session:
        known = find_study(session, study, identity, "run")
        for link, runs, complete in links_with_runs(session, known, LINKS_READ_AT_ONCE, "personal"):
            url = link_url(settings.public_url, settings.key, link.public_id)
            rows.append((link.label, url, runs, complete, link.group_name))
    with database.write() as session:
        record(session, identity, "personal links downloaded", "study", study)
    headers = {"content-disposition": f'attachment; filename="{study}-links.csv"'}
    return Response(guarded_table(rows), media_type="text/csv; charset=utf-8", headers=headers)


@link_router.delete("/{link}", status_code=204)
def revoke_link(database: DatabaseDep, identity: Writer, study: str, link: str) -> None:
    """Withdraw a link; runs that began with it go on."""
    with database.write() as session:
        known = find_study(session, study, identity, "run")
        withdrawn = withdraw(session, known, link)
        # A personal link's label is a person's name, which an erasure could not take out of the log's chain.
        record(
            session, identity, "link withdrawn", "study", study, link=withdrawn.public_id, kind=withdrawn.kind
        )
