"""Studies from the dashboard: create, edit as new versions, open and close."""

import tomllib
from pathlib import Path

from sqlalchemy.orm import Session

from experiments import design
from experiments.assignment.groups import names
from experiments.definition import Experiment
from experiments.errors import InputError, did_you_mean
from experiments.load import DEMOS, SHIPPED, DefinitionError, locate, parse_experiment
from experiments.manifest import MANIFEST_NAME, Manifest, read_manifest
from experiments.own_clips import Placed, check_factorial, levels_from_names, levels_from_table
from experiments.schema.stored import load_stored
from experiments.trials import KINDS
from experiments.trials.counts import block_sizes, expected_minutes, trials_per_participant
from server.accounts.audit import record
from server.accounts.identity import Identity
from server.clock import now
from server.context import Services
from server.errors import Conflict, Invalid, NotFound
from server.models import Right, Study, StudyVersion, VersionClip
from server.studies import own_clips, repository
from server.studies.importing import add_version, check_against_design, create_study, store_clips
from server.studies.lookup import active_version, find_study, must_not_be_archived
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
from server.studies.uploads import FILMS, upload_folder
from server.workspaces.repository import studies_opened_to
from server.workspaces.service import Standing, standing_of, workspace_for

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
    )


def _notes(experiment: Experiment) -> list[str]:
    """What the kind's plan adds, or why the design cannot be analysed as it stands."""
    try:
        return list(KINDS[experiment.trial.kind].plan(experiment))
    except InputError as error:
        return [str(error)]


def check(text: str) -> Checked:
    """Every problem of a definition with its line, or what it expands to."""
    try:
        experiment = planned_experiment(text)
    except DefinitionError as error:
        problems = [ProblemOut(line=p.line, path=p.path, message=p.message) for p in error.problems]
        return Checked(problems=problems, design=None)
    return Checked(problems=[], design=design_out(experiment))


def edit(wanted: EditDefinition) -> EditedDefinition:
    """A definition's text with other data in it: what did not change keeps its form and its comments."""
    text = wanted.toml if wanted.data is None else with_data(wanted.toml, wanted.data)
    try:
        data = tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError):
        data = None
    checked = check(text)
    return EditedDefinition(toml=text, data=data, problems=checked.problems, design=checked.design)


def judge_edit(session: Session, name: str, text: str, who: Identity) -> JudgedEdit:
    """What saving this definition would do to stored answers; DefinitionError where it cannot be used."""
    return judged(session, find_study(session, name, who, "view"), planned_experiment(text))


def shipped(services: Services) -> list[ShippedExperiment]:
    """The experiments that come with the program; demonstrations where their clips are built."""
    found = []
    for name in (*SHIPPED, *DEMOS):
        text = locate(name).read_text(encoding="utf-8")
        ready = (services.settings.stimuli_folder / name / MANIFEST_NAME).is_file()
        if not ready and name in DEMOS:
            continue
        title = parse_experiment(text).title
        found.append(ShippedExperiment(name=name, title=title, toml=text, clips_ready=ready))
    return found


def create(services: Services, wanted: NewStudy, who: Identity) -> str:
    """Create a draft study; everything is checked and every clip stored before the database changes."""
    with services.database.read() as session:
        workspace_for(session, who, wanted.workspace)  # refused before anything is stored
    text, experiment, manifest, folder = _materials(services, wanted, who)
    check_against_design(experiment, manifest)
    store_clips(services.clips, manifest, folder)
    with services.database.write() as session:
        study = create_study(
            session, wanted.name, experiment, who, workspace_for(session, who, wanted.workspace)
        )
        add_version(session, study, text, experiment, manifest, who, note="created")
        study.revision = 1
    return wanted.name


def _materials(services: Services, wanted: NewStudy, who: Identity) -> tuple[str, Experiment, Manifest, Path]:
    if wanted.shipped is not None:
        if wanted.shipped not in (known := (*SHIPPED, *DEMOS)):
            near = did_you_mean(wanted.shipped, known)
            raise Invalid(f"There is no shipped experiment '{wanted.shipped}'{near}")
        text = wanted.toml or locate(wanted.shipped).read_text(encoding="utf-8")
        folder = services.settings.stimuli_folder / wanted.shipped
        return text, planned_experiment(text), read_manifest(folder), folder
    if wanted.upload is None:
        raise Invalid("A study needs clips: choose a shipped experiment or upload clips first.")
    folder = upload_folder(services.settings.upload_folder, wanted.upload, who.account_id)
    if (folder / MANIFEST_NAME).is_file():
        if wanted.toml is None:
            raise Invalid(
                "The upload has a manifest; give the definition (TOML) its clips were built from too."
            )
        return wanted.toml, planned_experiment(wanted.toml), read_manifest(folder), folder
    return _own(wanted, folder)


def _own(wanted: NewStudy, folder: Path) -> tuple[str, Experiment, Manifest, Path]:
    placed = _placed(wanted.levels, folder)
    check_factorial(placed)
    if wanted.toml is None and wanted.own_clips is None:
        raise Invalid("Give the study a title and a question, or a definition.")
    text = wanted.toml
    if text is None and wanted.own_clips is not None:
        text = own_clips.definition_text(wanted.name, placed, wanted.own_clips)
    experiment = planned_experiment(text or "")
    return text or "", experiment, own_clips.manifest_of(experiment, placed, folder), folder


def _placed(levels: LevelsTable | LevelsPattern | None, folder: Path) -> Placed:
    files = sorted(path.name for path in folder.iterdir() if path.suffix.lower() in FILMS)
    if levels is None:
        raise Invalid("Say which levels each clip has: by a CSV table or a file-name pattern.")
    if isinstance(levels, LevelsTable):
        return levels_from_table(levels.csv, files)
    return levels_from_names(levels.pattern, files)


def for_edit(
    session: Session, name: str, revision: int, who: Identity, right: Right, *, archived: bool = False
) -> Study:
    """The study to change; Conflict where somebody changed it since, or where it is in the archive."""
    study = find_study(session, name, who, right)
    if study.revision != revision:
        raise EditedMeanwhile(
            f"Somebody else changed this study meanwhile (revision {study.revision}, yours was {revision}); "
            "load it again and repeat your edit.",
            revision=study.revision,
        )
    if not archived:
        must_not_be_archived(study)
    return study


def add_definition(services: Services, name: str, wanted: NewVersion, who: Identity) -> None:
    """Store a changed definition as a new version, with the clips there are and those of an upload."""
    with services.database.read() as session:
        find_study(session, name, who, "edit")  # refused before a clip is stored
    experiment = planned_experiment(wanted.toml)
    added = _added_clips(services, wanted, experiment, who)
    with services.database.write() as session:
        study = for_edit(session, name, wanted.revision, who, "edit")
        manifest = Manifest.model_validate(active_version(session, study).manifest)
        if added is not None:
            own_clips.check_declared(added, experiment)
            manifest = own_clips.merged_manifest(manifest, added)
        manifest = own_clips.only_declared(manifest, experiment)
        add_version(session, study, wanted.toml, experiment, manifest, who, wanted.note)


def _added_clips(
    services: Services, wanted: NewVersion, experiment: Experiment, who: Identity
) -> Manifest | None:
    """The manifest of uploaded clips, their bytes in the store; None where none were uploaded."""
    if wanted.upload is None:
        return None
    folder = upload_folder(services.settings.upload_folder, wanted.upload, who.account_id)
    if (folder / MANIFEST_NAME).is_file():
        manifest = read_manifest(folder)
    else:
        manifest = own_clips.manifest_of(experiment, _placed(wanted.levels, folder), folder)
    store_clips(services.clips, manifest, folder)
    return manifest


def change_status(session: Session, name: str, revision: int, status: str, who: Identity) -> None:
    """draft -> pilot -> live -> closed, and the ways back that lose nothing."""
    study = for_edit(session, name, revision, who, "run")
    if status == study.status:
        return
    if status not in ALLOWED[study.status]:
        raise Conflict(
            f"A study that is {study.status} can become {' or '.join(ALLOWED[study.status])}, not {status}."
        )
    if study.status == "draft":
        study.opened_at = now()
    study.closed_at = now() if status == "closed" else None
    record(session, who, "status changed", "study", study.name, before=study.status, after=status)
    study.status = status
    study.revision += 1


def change_settings(session: Session, name: str, wanted: ChangeSettings, who: Identity) -> None:
    """Pause or go on, set the quota, name the recruiter."""
    study = for_edit(session, name, wanted.revision, who, "run")
    study.paused, study.quota = wanted.paused, wanted.quota
    study.recruiter = wanted.recruiter.model_dump() if wanted.recruiter else None
    study.revision += 1
    record(
        session, who, "settings changed", "study", name, paused=wanted.paused, quota=wanted.quota,
        recruiter=wanted.recruiter.kind if wanted.recruiter else None,
    )  # fmt: skip


def delete(session: Session, name: str, who: Identity) -> None:
    """Delete a draft that nobody has taken part in."""
    study = find_study(session, name, who, "edit")
    must_not_be_archived(study)
    if study.status != "draft" or repository.run_count(session, study):
        raise Conflict("Only a draft without runs can be deleted; close this study instead.")
    repository.delete_study(session, study)
    record(session, who, "study deleted", "study", name)


def summaries(session: Session, who: Identity) -> list[StudySummary]:
    """The studies that are open to her, the latest first."""
    studies = studies_opened_to(session, who)
    counts, standing = repository.shown_runs_by_status(session), standing_of(session, studies, who)
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


def detail(session: Session, name: str, who: Identity) -> StudyDetail:
    """A study with its declaration and versions."""
    study = find_study(session, name, who, "view")
    version = active_version(session, study)
    experiment = load_stored(version.definition)
    return StudyDetail(
        summary=summary(
            study, repository.shown_runs_by_status(session), standing_of(session, [study], who)[study.id]
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


def version_text(session: Session, name: str, number: int, who: Identity) -> str:
    """The TOML of one version."""
    study = find_study(session, name, who, "view")
    for version in study.versions:
        if version.number == number:
            return version.definition_toml
    raise NotFound(f"Study '{name}' has no version {number}.")


def clips(session: Session, name: str, who: Identity) -> list[ClipOut]:
    """Every clip of the active version with the closure curve it shows."""
    version = active_version(session, find_study(session, name, who, "view"))
    curves = {clip["sha256"]: clip.get("closure", []) for clip in version.manifest["clips"]}
    rows = repository.clips_of_design(session, version)
    return [_clip_out(row, curves[row.clip_sha256]) for row in rows]


def _clip_out(row: VersionClip, closure: list[float]) -> ClipOut:
    clip = row.clip
    return ClipOut(
        clip_sha256=row.clip_sha256,
        url=f"/clips/{row.clip_sha256}.mp4",
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
        closure=closure,
    )
