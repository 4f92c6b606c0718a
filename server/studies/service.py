"""Studies from the dashboard: create, edit as new versions, open and close."""

from pathlib import Path
from typing import Any

from sqlalchemy.orm import Session

from experiments import design
from experiments.assignment.groups import names
from experiments.definition import Experiment
from experiments.definition.languages import unlisted
from experiments.errors import InputError, did_you_mean
from experiments.load import DEMOS, SHIPPED, DefinitionError, locate, parse_experiment, toml_data
from experiments.manifest import MANIFEST_NAME, Manifest, read_manifest
from experiments.own_clips import Placed, check_factorial, levels_from_names, levels_from_table
from experiments.trials import KINDS
from experiments.trials.counts import block_sizes, expected_minutes, trials_per_participant
from server.accounts.audit import record
from server.accounts.identity import Identity
from server.clips.address import clip_address
from server.clock import now
from server.context import Services
from server.errors import Conflict, Invalid
from server.models import Right, Study, StudyVersion, VersionClip
from server.studies import own_clips, repository
from server.studies.importing import add_version, check_against_design, create_study, store_clips
from server.studies.lookup import (
    active_version,
    definition_of,
    find_study,
    must_not_be_archived,
    study_with_rights,
    version_numbered,
)
from server.studies.planned import planned_experiment
from server.studies.schemas import (
    BlockOut,
    ChangeSettings,
    Checked,
    ClipOut,
    DesignOut,
    EditDefinition,
    EditedDefinition,
    FactorOut,
    JudgedEdit,
    LevelOut,
    LevelsPattern,
    LevelsTable,
    NewStudy,
    NewVersion,
    ProblemOut,
    ShippedExperiment,
    StudyDetail,
    StudySummary,
    VersionOut,
)
from server.studies.series import judged, series_of
from server.studies.toml_edit import with_data
from server.studies.uploads import upload_folder
from server.transcoding.records import videos_of
from server.workspaces.repository import studies_opened_to
from server.workspaces.service import Standing, standing_of, standing_on, workspace_for

ALLOWED = {
    "draft": ("pilot", "live"),
    "pilot": ("draft", "live", "closed"),
    "live": ("closed",),
    "closed": ("live", "pilot"),
}


class EditedMeanwhile(Conflict):
    """Somebody else changed the study since this edit began."""

    code = "edited_meanwhile"


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


def check(text: str) -> Checked:
    """Every problem of a definition with its line, or what it expands to."""
    try:
        experiment = planned_experiment(text)
    except DefinitionError as error:
        problems = [ProblemOut(line=p.line, path=p.path, message=p.message) for p in error.problems]
        return Checked(problems=problems, design=None)
    return Checked(problems=[], design=design_out(experiment))


def edit(edited: EditDefinition) -> EditedDefinition:
    """A definition's text with other data in it: what did not change keeps its form and its comments."""
    text = edited.toml if edited.data is None else with_data(edited.toml, edited.data)
    try:
        data = toml_data(text)
    except DefinitionError:
        data = None
    checked = check(text)
    return EditedDefinition(toml=text, data=data, problems=checked.problems, design=checked.design)


def judge_edit(session: Session, name: str, text: str, identity: Identity) -> JudgedEdit:
    """What saving this definition would do to stored answers; DefinitionError where it cannot be used."""
    return judged(session, find_study(session, name, identity, "view"), planned_experiment(text))


def shipped(services: Services) -> list[ShippedExperiment]:
    """The experiments that come with the program; demonstrations where their clips are built."""
    experiments = []
    for name in (*SHIPPED, *DEMOS):
        text = locate(name).read_text(encoding="utf-8")
        ready = (services.settings.stimuli_folder / name / MANIFEST_NAME).is_file()
        if not ready and name in DEMOS:
            continue
        title = parse_experiment(text).title
        experiments.append(ShippedExperiment(name=name, title=title, toml=text, clips_ready=ready))
    return experiments


def create(services: Services, order: NewStudy, identity: Identity) -> str:
    """Create a draft study; everything is checked and every clip stored before the database changes."""
    with services.database.read() as session:
        workspace_for(session, identity, order.workspace)  # refused before anything is stored
    text, experiment, manifest, folder = _materials(services, order, identity)
    check_against_design(experiment, manifest)
    _store(services, manifest, folder)
    with services.database.write() as session:
        study = create_study(
            session, order.name, experiment, identity, workspace_for(session, identity, order.workspace)
        )
        add_version(session, study, text, experiment, manifest, identity, note="created")
        study.revision = 1
    return order.name


def _store(services: Services, manifest: Manifest, folder: Path) -> None:
    """Take the clips of a built set, or of an upload of own clips, into the clip store."""
    if (folder / MANIFEST_NAME).is_file():
        store_clips(services.clips, manifest, folder)
    else:
        own_clips.store_prepared(services.clips, manifest, folder)


def _materials(
    services: Services, order: NewStudy, identity: Identity
) -> tuple[str, Experiment, Manifest, Path]:
    if order.shipped is not None:
        if order.shipped not in (known := (*SHIPPED, *DEMOS)):
            near = did_you_mean(order.shipped, known)
            raise Invalid(f"There is no shipped experiment '{order.shipped}'{near}")
        text = order.toml or locate(order.shipped).read_text(encoding="utf-8")
        folder = services.settings.stimuli_folder / order.shipped
        return text, planned_experiment(text), read_manifest(folder), folder
    if order.upload is None:
        raise Invalid("A study needs clips: choose a shipped experiment or upload clips first.")
    folder = upload_folder(services.settings.upload_folder, order.upload, identity.account_id)
    if (folder / MANIFEST_NAME).is_file():
        if order.toml is None:
            raise Invalid(
                "The upload has a manifest; give the definition (TOML) its clips were built from too."
            )
        return order.toml, planned_experiment(order.toml), read_manifest(folder), folder
    return _own(order, folder)


def _own(order: NewStudy, folder: Path) -> tuple[str, Experiment, Manifest, Path]:
    placed = _placed(order.levels, folder)
    check_factorial(placed)
    if order.toml is None and order.own_clips is None:
        raise Invalid("Give the study a title and a question, or a definition.")
    text = order.toml
    if text is None and order.own_clips is not None:
        text = own_clips.definition_text(order.name, placed, order.own_clips)
    experiment = planned_experiment(text or "")
    return text or "", experiment, own_clips.manifest_of(experiment, placed, folder), folder


def _placed(levels: LevelsTable | LevelsPattern | None, folder: Path) -> Placed:
    files = [path.name for path in videos_of(folder)]
    if levels is None:
        raise Invalid("Say which levels each clip has: by a CSV table or a file-name pattern.")
    if isinstance(levels, LevelsTable):
        return levels_from_table(levels.csv, files)
    return levels_from_names(levels.pattern, files)


def for_edit(
    session: Session, name: str, revision: int, identity: Identity, right: Right, *, archived: bool = False
) -> Study:
    """The study to change; Conflict where somebody changed it since, or where it is in the archive."""
    study = find_study(session, name, identity, right)
    if study.revision != revision:
        raise EditedMeanwhile(
            f"Somebody else changed this study meanwhile (revision {study.revision}, yours was {revision}); "
            "load it again and repeat your edit.",
            revision=study.revision,
        )
    if not archived:
        must_not_be_archived(study)
    return study


def add_definition(services: Services, name: str, order: NewVersion, identity: Identity) -> None:
    """Store a changed definition as a new version, with the clips there are and those of an upload."""
    with services.database.read() as session:
        find_study(session, name, identity, "edit")  # refused before a clip is stored
    experiment = planned_experiment(order.toml)
    added = _added_clips(services, order, experiment, identity)
    with services.database.write() as session:
        study = for_edit(session, name, order.revision, identity, "edit")
        manifest = Manifest.model_validate(active_version(session, study).manifest)
        if added is not None:
            own_clips.check_declared(added, experiment)
            manifest = own_clips.merged_manifest(manifest, added)
        manifest = own_clips.only_declared(manifest, experiment)
        add_version(session, study, order.toml, experiment, manifest, identity, order.note)


def _added_clips(
    services: Services, order: NewVersion, experiment: Experiment, identity: Identity
) -> Manifest | None:
    """The manifest of uploaded clips, their bytes in the store; None where none were uploaded."""
    if order.upload is None:
        return None
    folder = upload_folder(services.settings.upload_folder, order.upload, identity.account_id)
    if (folder / MANIFEST_NAME).is_file():
        manifest = read_manifest(folder)
    else:
        manifest = own_clips.manifest_of(experiment, _placed(order.levels, folder), folder)
    _store(services, manifest, folder)
    return manifest


def change_status(session: Session, name: str, revision: int, status: str, identity: Identity) -> None:
    """draft -> pilot -> live -> closed, and the ways back that lose nothing."""
    study = for_edit(session, name, revision, identity, "run")
    if status == study.status:
        return
    if status not in ALLOWED[study.status]:
        raise Conflict(
            f"A study that is {study.status} can become {' or '.join(ALLOWED[study.status])}, not {status}."
        )
    if study.status == "draft":
        study.opened_at = now()
    study.closed_at = now() if status == "closed" else None
    record(session, identity, "status changed", "study", study.name, before=study.status, after=status)
    study.status = status
    study.revision += 1


def change_settings(session: Session, name: str, order: ChangeSettings, identity: Identity) -> None:
    """Pause or go on, set the quota, name the recruiter."""
    study = for_edit(session, name, order.revision, identity, "run")
    study.paused, study.quota = order.paused, order.quota
    study.recruiter = order.recruiter.model_dump() if order.recruiter else None
    study.revision += 1
    record(
        session, identity, "settings changed", "study", name, paused=order.paused, quota=order.quota,
        recruiter=order.recruiter.kind if order.recruiter else None,
    )  # fmt: skip


def delete(session: Session, name: str, identity: Identity) -> None:
    """Delete a draft that nobody has taken part in."""
    study = find_study(session, name, identity, "edit")
    must_not_be_archived(study)
    if study.status != "draft" or repository.run_count(session, study):
        raise Conflict("Only a draft without runs can be deleted; close this study instead.")
    repository.delete_study(session, study)
    record(session, identity, "study deleted", "study", name)


def summaries(session: Session, identity: Identity) -> list[StudySummary]:
    """The studies that are open to her, the latest first."""
    studies = studies_opened_to(session, identity)
    counts, standing = repository.shown_runs_by_status(session), standing_of(session, studies, identity)
    return [summary(study, counts, standing[study.id]) for study in studies]


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
    return StudyDetail(
        summary=summary(
            study, repository.shown_runs_by_status(session, study), standing_on(session, study, rights)
        ),
        design=design_out(experiment),
        definition=experiment,
        toml=version.definition_toml,
        definition_sha256=version.definition_sha256,
        versions=[_version_out(row, number) for row, number in repository.versions_with_runs(session, study)],
        series=series_of(session, study),
        recruiter=study.recruiter,
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
