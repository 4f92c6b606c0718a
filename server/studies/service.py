"""Studies on the dashboard: checked, listed, shown, opened and closed, deleted."""

from collections import Counter
from collections.abc import Sequence
from datetime import UTC, datetime, time, timedelta
from typing import Any

from sqlalchemy.orm import Session

from experiments import design
from experiments.assignment.groups import names
from experiments.declaration.experiment import Experiment
from experiments.errors import InputError
from experiments.kinds import KINDS, block_sizes, expected_minutes, trials_per_participant
from experiments.load import DefinitionError, toml_data
from experiments.manifest import Manifest
from experiments.wording import unlisted
from server.accounts.audit import record
from server.accounts.identity import Identity
from server.accounts.workspace_repository import studies_opened_to
from server.accounts.workspaces import Standing, place_of_copy, standing_of, standing_on
from server.core.db import Database
from server.core.errors import Conflict, Invalid
from server.core.repository import insert_once
from server.core.storage import clip_address
from server.core.values import now
from server.models import BuilderDraft, Study, StudyVersion, VersionClip
from server.participation.recruiter import Recruiter, without_refused
from server.studies import repository
from server.studies.creation import add_version, create_study, for_edit, planned_experiment, size_notes
from server.studies.launch_checks import (
    CLIPS_WITHIN_S,
    clip_findings,
    clips_shown,
    refuse_recruiter,
    refuse_unready,
)
from server.studies.lookup import (
    active_version,
    definition_of,
    find_study,
    must_not_be_archived,
    study_with_rights,
    version_numbered,
)
from server.studies.schemas import (
    ArchiveStudy,
    BlockOut,
    BuilderWork,
    ChangeSettings,
    ChangeStatus,
    ClipOut,
    CloneStudy,
    DefinitionCheck,
    DesignOut,
    DraftOut,
    EditDefinition,
    EditedDefinition,
    EditedVersion,
    EditorOut,
    FactorOut,
    JudgedEdit,
    LaunchCheck,
    LevelOut,
    ListedStudy,
    ProblemOut,
    StudyDetail,
    StudySummary,
    VersionOut,
)
from server.studies.series import effects_of_edit, series_of
from server.transcoding.preparing import StoredClips

# Definitions as text and data: their problems, what they expand to, what an edit would do.


def design_out(experiment: Experiment) -> DesignOut:
    """What a definition expands to."""
    return DesignOut(
        experiment=experiment.name,
        title=experiment.title,
        factors=[
            FactorOut(
                name=f.name, label=f.label, levels=[LevelOut(name=lv.name, label=lv.label) for lv in f.levels]
            )
            for f in experiment.factors
        ],
        cells=len(design.cells(experiment)),
        exemplars=experiment.exemplars.per_cell,
        unique_clips=len(design.clips(experiment)),
        trials_per_participant=trials_per_participant(experiment),
        blocks=[BlockOut(label=label, trials=count) for label, count in block_sizes(experiment)],
        expected_minutes=expected_minutes(experiment),
        notes=_notes(experiment),
        groups=names(experiment) if experiment.groups.by == "link" else [],
        turned_away=experiment.display.turned_away,
    )


def _notes(experiment: Experiment) -> list[str]:
    """What the kind's plan adds, or why the design cannot be analysed; texts that nobody is offered."""
    unread = [note for note in [unlisted(experiment, experiment.languages)] if note]
    try:
        return [*KINDS[experiment.trial.kind].plan(experiment), *unread]
    except InputError as error:
        return [str(error), *unread]


def check_definition(text: str) -> DefinitionCheck:
    """Every problem of a definition with its line, or what it expands to."""
    try:
        experiment = planned_experiment(text)
    except DefinitionError as error:
        problems = [ProblemOut(line=p.line, path=p.path, message=p.message) for p in error.problems]
        return DefinitionCheck(problems=problems, design=None)
    return DefinitionCheck(problems=[], design=design_out(experiment))


def edit_definition(edited: EditDefinition) -> EditedDefinition:
    """A definition's text with other data in it: what did not change keeps its form and its comments."""
    # Not above: its tomlkit takes a twentieth of the time of a start.
    from server.studies.toml_edit import comments_of, with_data

    text = edited.toml if edited.data is None else with_data(edited.toml, edited.data)
    try:
        data = toml_data(text)
    except DefinitionError:
        data = None
    checked = check_definition(text)
    comments = [] if data is None else comments_of(text)
    return EditedDefinition(
        toml=text, comments=comments, data=data, problems=checked.problems, design=checked.design
    )


def judge_edit(session: Session, name: str, edit: EditedVersion, identity: Identity) -> JudgedEdit:
    """What saving this edit would do to stored answers; DefinitionError where it cannot be used."""
    study = find_study(session, name, identity, "view")
    return effects_of_edit(session, study, planned_experiment(edit.toml), edit.places)


# What an experimenter does with studies.

ALLOWED = {
    "draft": ("pilot", "live"),
    "pilot": ("draft", "live", "closed"),
    "live": ("closed",),
    "closed": ("live", "pilot"),
}


def find_clip_faults(
    database: Database, stored: StoredClips, name: str, identity: Identity
) -> list[LaunchCheck]:
    """What is wrong with the clips of a study that is about to be opened; each is decoded."""
    with database.read() as session:
        clips = clips_shown(session, find_study(session, name, identity, "run"))
    return clip_findings(*stored.find_faults(clips, CLIPS_WITHIN_S))


def change_status(
    session: Session, name: str, order: ChangeStatus, identity: Identity, of_clips: Sequence[LaunchCheck]
) -> None:
    """draft -> pilot -> live -> closed, and the ways back that lose nothing.

    `of_clips` is what `find_clip_faults` gave, for a study that is to be live.
    """
    status = order.status
    study = for_edit(session, name, order.revision, identity, "run")
    if status == study.status:
        return
    if status not in ALLOWED[study.status]:
        raise Conflict(
            f"A study that is {study.status} can become {' or '.join(ALLOWED[study.status])}, not {status}."
        )
    passed_over: dict[str, str] = {}
    if status == "live":
        kinds = refuse_unready(session, study, of_clips, anyway=order.anyway)
        passed_over = {"anyway": ", ".join(kinds)} if order.anyway else {}
    if study.status == "draft":
        study.opened_at = now()
    study.closed_at = now() if status == "closed" else None
    before = study.status
    record(
        session, identity, "status changed", "study", study.name, before=before, after=status, **passed_over
    )
    study.status = status
    study.revision += 1


def change_settings(session: Session, name: str, order: ChangeSettings, identity: Identity) -> None:
    """Pause or go on, set the quota, name the recruiter."""
    study = for_edit(session, name, order.revision, identity, "run")
    recruiter_before = study.recruiter
    study.paused, study.quota = order.paused, order.quota
    study.recruiter = _checked_recruiter(order.recruiter, study.recruiter)
    if study.recruiter != recruiter_before:
        refuse_recruiter(study, order.recruiter, "Settings")
    study.revision += 1
    record(
        session, identity, "settings changed", "study", name, paused=order.paused, quota=order.quota,
        recruiter=order.recruiter.kind if order.recruiter else None,
    )  # fmt: skip


def _checked_recruiter(sent: Recruiter | None, stored: dict[str, Any] | None) -> dict[str, Any] | None:
    try:
        return None if sent is None else without_refused(sent, stored).model_dump()
    except ValueError as error:
        raise Invalid(f"recruiter.{error}") from error


def delete(session: Session, name: str, identity: Identity) -> None:
    """Delete a draft that nobody has taken part in."""
    study = find_study(session, name, identity, "edit")
    must_not_be_archived(study)
    if study.status != "draft" or repository.run_count(session, study):
        raise Conflict("Only drafts without runs can be deleted. Close this study instead.")
    repository.delete_study(session, study)
    record(session, identity, "study deleted", "study", name)


SHOWN_DAYS = 14
"""Days of complete runs in the list of studies."""


def summaries(session: Session, identity: Identity) -> list[ListedStudy]:
    """The studies that are open to her, the latest first."""
    studies = studies_opened_to(session, identity)
    counts, standing = repository.shown_runs_by_status(session), standing_of(session, studies, identity)
    owners, active = repository.owners(session), repository.last_activities(session)
    today = now().date()
    since = datetime.combine(today - timedelta(days=SHOWN_DAYS - 1), time(), UTC)
    by_day = Counter(
        (study, (today - moment.date()).days)
        for study, moment in repository.completions_since(session, since)
    )
    return [
        ListedStudy(
            **summary(study, counts, standing[study.id]).model_dump(),
            owner=owners.get(study.id, ""),
            last_activity=active.get(study.id, study.created_at),
            completed_by_day=[by_day[study.id, ago] for ago in reversed(range(SHOWN_DAYS))],
        )
        for study in studies
    ]


def summary(study: Study, counts: repository.StatusCounts, standing: Standing) -> StudySummary:
    """One line of the list of studies."""
    return StudySummary.model_validate(
        {
            "name": study.name,
            "title": study.title,
            "status": study.status,
            "paused": study.paused,
            "quota": study.quota,
            "version": study.active_version,
            "revision": study.revision,
            "complete": counts[study.id, "complete"],
            "active": counts[study.id, "active"],
            "created_at": study.created_at,
            "archived_at": study.archived_at,
            "workspace": standing.workspace,
            "rights": standing.rights,
        }
    )


def detail(session: Session, name: str, identity: Identity) -> StudyDetail:
    """A study with its declaration and versions."""
    study, rights = study_with_rights(session, name, identity, "view")
    version = active_version(session, study)
    experiment = definition_of(version)
    planned = design_out(experiment)
    manifest = Manifest.model_validate(version.manifest)
    notes = [*planned.notes, *size_notes(experiment, manifest)]
    return StudyDetail(
        summary=summary(
            study, repository.shown_runs_by_status(session, study), standing_on(session, study, rights)
        ),
        design=planned.model_copy(update={"notes": notes}),
        definition=experiment,
        toml=version.definition_toml,
        definition_sha256=version.definition_sha256,
        versions=[_version_out(row, number) for row, number in repository.versions_with_runs(session, study)],
        series=series_of(session, study),
        recruiter=study.recruiter,
        rendered=any(clip.profile or clip.inputs for clip in manifest.clips),
    )


def _version_out(version: StudyVersion, runs: int) -> VersionOut:
    return VersionOut.model_validate(version).model_copy(update={"runs": runs})


def version_text(session: Session, name: str, number: int, identity: Identity) -> str:
    """The TOML of one version."""
    return version_numbered(session, find_study(session, name, identity, "view"), number).definition_toml


def clips(session: Session, name: str, identity: Identity) -> list[ClipOut]:
    """Every clip of the active version with the closure curve it shows, in the declared order of levels."""
    version = active_version(session, find_study(session, name, identity, "view"))
    told = {clip["sha256"]: clip for clip in version.manifest["clips"]}
    experiment = definition_of(version)
    names = [factor.name for factor in experiment.factors]
    declared = {cell: number for number, cell in enumerate(design.cells(experiment))}

    def order(row: VersionClip) -> tuple[int, int]:
        cell = tuple((name, row.levels.get(name, "")) for name in names)
        return declared.get(cell, len(declared)), row.exemplar

    rows = sorted(repository.clips_of_design(session, version), key=order)
    return [_clip_out(row, told[row.clip_sha256]) for row in rows]


def _clip_out(row: VersionClip, told: dict[str, Any]) -> ClipOut:
    clip = row.clip
    return ClipOut(
        clip_sha256=row.clip_sha256,
        url=clip_address(row.clip_sha256),
        file=row.file,
        cell=row.cell,
        levels=row.levels,
        exemplar=row.exemplar,
        profile=row.profile_id,
        fps=clip.fps,
        frames=clip.frames,
        width_px=clip.width_px,
        height_px=clip.height_px,
        bytes=clip.bytes,
        closure=told.get("closure", []),
        source=(source := told.get("source")) and source | {"frame_map": ()},
    )


# Unsaved work of the builder: kept per person and tab, and shown to nobody else.

OPEN_FOR = timedelta(seconds=45)
"""After this without a sign of life a tab counts as closed; pages send one every 15 s."""
MAX_DRAFTS = 10
"""Drafts of one person on one study; the oldest go."""
MAX_DRAFT_BYTES = 1_000_000


def _own_tab(session: Session, study: Study, identity: Identity, tab: str) -> BuilderDraft:
    key = {"study_id": study.id, "account_id": identity.account_id, "tab": tab}
    insert_once(session, BuilderDraft, [key | {"seen_at": now()}])  # two requests of a new tab may meet
    row = repository.own_builder_tab(session, study, identity.account_id, tab)
    row.seen_at = now()
    return row


def other_editors(session: Session, name: str, tab: str, identity: Identity) -> list[EditorOut]:
    """Note that this tab has the builder open; the other tabs that have."""
    study = find_study(session, name, identity, "edit")
    _own_tab(session, study, identity, tab)
    session.flush()
    since = now() - OPEN_FOR
    repository.delete_closed_tabs(session, study, since)
    others: dict[str, EditorOut] = {}
    for row, account in repository.tabs_open_since(session, study, since):
        if (row.account_id, row.tab) == (identity.account_id, tab):
            continue
        edits = row.saved_at is not None or (account in others and others[account].edits)
        others[account] = EditorOut(name=account, edits=edits, own=row.account_id == identity.account_id)
    return list(others.values())


def save_draft(session: Session, name: str, tab: str, draft: BuilderWork, identity: Identity) -> None:
    """Keep the unsaved work of a tab in the place of what it kept before."""
    study = find_study(session, name, identity, "edit")
    size = len(draft.model_dump_json())
    if size > MAX_DRAFT_BYTES:
        raise Invalid(f"expected a draft of at most {MAX_DRAFT_BYTES:,} bytes, got {size:,}; save a version")
    row = _own_tab(session, study, identity, tab)
    row.draft, row.saved_at = draft.model_dump(mode="json"), now()
    session.flush()
    for old in repository.drafts_of(session, study, identity.account_id)[MAX_DRAFTS:]:
        session.delete(old)


def own_drafts(session: Session, name: str, identity: Identity) -> list[DraftOut]:
    """The unsaved work of this person on a study, the latest first."""
    study = find_study(session, name, identity, "edit")
    return [
        DraftOut(tab=row.tab, at=row.saved_at, work=BuilderWork.model_validate(row.draft))
        for row in repository.drafts_of(session, study, identity.account_id)
        if row.saved_at is not None
    ]


def discard_draft(session: Session, name: str, tab: str, identity: Identity) -> None:
    """Forget the unsaved work of a tab; nothing where there is none."""
    study = find_study(session, name, identity, "edit")
    row = repository.builder_tab(session, study, identity.account_id, tab)
    if row is not None:
        row.draft = row.saved_at = None


# A study copied, put into the archive and taken out.


def clone_study(session: Session, name: str, order: CloneStudy, identity: Identity) -> None:
    """A new draft with declaration and clips of one version; nothing of its people comes along.

    Links, quota and recruiter stay behind too: completion codes belong to one study.
    """
    source = find_study(session, name, identity, "edit")
    version = version_numbered(session, source, order.version or source.active_version)
    home = place_of_copy(session, source, identity, order.workspace)
    copy = create_study(session, order.name, definition_of(version), identity, home)
    note = f"copied from {source.name}, version {version.number}"
    manifest = Manifest.model_validate(version.manifest)
    add_version(session, copy, version.definition_toml, definition_of(version), manifest, identity, note)
    copy.revision = 1


def archive_study(session: Session, name: str, order: ArchiveStudy, identity: Identity) -> None:
    """Into the archive or out of it; Conflict while people can take part."""
    study = for_edit(session, name, order.revision, identity, "run", archived=True)
    if order.archived == (study.archived_at is not None):
        return
    if order.archived and study.status in ("pilot", "live"):
        raise Conflict(f"A study that is {study.status} cannot be archived. Close it first.")
    study.archived_at = now() if order.archived else None
    study.revision += 1
    record(
        session,
        identity,
        "study archived" if order.archived else "study taken out of the archive",
        "study",
        name,
    )
