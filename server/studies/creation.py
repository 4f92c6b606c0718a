"""New studies and versions: definition and clips are checked and stored, all of it or nothing."""

from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

from sqlalchemy.orm import Session

from experiments import design
from experiments.assignment.order import motion_checks_by_block
from experiments.checks import CHECK_CELL
from experiments.declaration.experiment import Experiment
from experiments.errors import InputError, counted, did_you_mean
from experiments.kinds import KINDS
from experiments.load import DEMOS, SHIPPED, DefinitionError, Problem, line_of, locate, parse_experiment
from experiments.manifest import (
    MANIFEST_NAME,
    UPLOADED,
    CheckClip,
    Manifest,
    SourceVideo,
    check_files,
    check_originals,
    read_manifest,
)
from experiments.manifest import Clip as DesignClip
from experiments.own_clips import Placed, check_factorial, levels_from_names, levels_from_table
from experiments.schema.canonical import definition_sha256
from experiments.schema.stored import FORMAT
from server.accounts.audit import record
from server.accounts.identity import Identity
from server.accounts.workspace_repository import default_workspace
from server.accounts.workspaces import workspace_for
from server.core.db import Database
from server.core.errors import Conflict, Invalid
from server.core.row_security import every_row
from server.core.settings import Settings
from server.core.storage import ClipStore
from server.models import Right, Study, StudyVersion, Workspace
from server.studies import own_clips, repository
from server.studies.launch_checks import CLIPS_WITHIN_S, clip_findings, refuse_if_live
from server.studies.lookup import active_version, find_study, must_not_be_archived
from server.studies.schemas import (
    LaunchCheck,
    LevelsPattern,
    LevelsTable,
    NewStudy,
    NewVersion,
    ShippedExperiment,
)
from server.studies.series import content_of, series_for, sizes_of
from server.studies.uploads import upload_folder
from server.transcoding.preparing import StoredClips
from server.transcoding.records import videos_of
from video_conversion.prepared import QUICKTIME, major_brand

# A definition that may be stored: one that can be read, and whose design can be analyzed.


def planned_experiment(text: str, source: str = "definition") -> Experiment:
    """Parse a definition and plan its trials.

    Raises
    ------
    DefinitionError
        With every problem and its line; or with the one that the plan names, such as clips that
        are never compared with the others.
    """
    experiment = parse_experiment(text, source)
    try:
        KINDS[experiment.trial.kind].plan(experiment)
    except InputError as error:
        message = str(error).removeprefix(f"'{experiment.name}': ")
        raise DefinitionError(source, [Problem(line_of(text, ("trial",)), "trial", message)]) from error
    return experiment


# What every change of a study begins with: nobody else changed it meanwhile.


class EditedMeanwhile(Conflict, code="edited_meanwhile"):
    """Somebody else changed the study since this edit began."""


def for_edit(
    session: Session, name: str, revision: int, identity: Identity, right: Right, *, archived: bool = False
) -> Study:
    """The study to change; Conflict where somebody changed it since, or where it is in the archive."""
    study = find_study(session, name, identity, right)
    if study.revision != revision:
        raise EditedMeanwhile(
            f"Not saved: someone else edited this study (revision {study.revision}, yours was {revision}). "
            f"Review their change and re-apply yours.",
            revision=study.revision,
        )
    if not archived:
        must_not_be_archived(study)
    return study


# Take a declared experiment and a folder of clips into the server: all of it, or nothing.


class NameTaken(Conflict, code="name_taken"):
    """Another study has this name."""


def check_name(declared: Experiment, manifest: Manifest, clips: Path) -> None:
    """InputError where the clips are another experiment's."""
    if manifest.experiment == declared.name:
        return
    if manifest.made_elsewhere:
        raise InputError(
            f"the manifest in {clips} is of '{manifest.experiment}', not of '{declared.name}'; write it "
            "again with `stimuli manifest` and --experiment"
        )
    raise InputError(
        f"the clips in {clips} were built for '{manifest.experiment}', not for '{declared.name}'"
    )


def check_against_design(experiment: Experiment, manifest: Manifest) -> None:
    """InputError unless the manifest holds each clip of the design exactly once."""
    declared = {(spec.cell, spec.exemplar) for spec in design.clips(experiment)}
    built = [(clip.cell, clip.exemplar) for clip in manifest.clips]
    if missing := sorted(declared - set(built)):
        cell, exemplar = missing[0]
        raise InputError(
            f"expected {len(declared)} clips, {len(missing)} are missing from the manifest, "
            f"the first is {cell}, exemplar {exemplar}; {_remedy(manifest)}"
        )
    if extra := sorted(set(built) - declared):
        cell, exemplar = extra[0]
        raise InputError(
            f"the manifest holds {counted(len(extra), 'clip')} that the definition does not declare, "
            f"the first is {cell}, exemplar {exemplar}; {_remedy(manifest)}"
        )
    if len(built) != len(declared):
        raise InputError(f"expected each of {len(declared)} clips once, the manifest lists {len(built)}")
    _check_checks(experiment, manifest)


def _remedy(manifest: Manifest) -> str:
    """What makes the clips agree with the definition, by where they came from."""
    if manifest.made_elsewhere:
        return (
            "correct the file names or the definition, then write the manifest again with `stimuli manifest` "
            "and --experiment"
        )
    if manifest.program_version == UPLOADED:
        return "upload those it declares, or correct the definition"
    return "build the clips with this definition"


def _check_checks(experiment: Experiment, manifest: Manifest) -> None:
    """InputError where there are fewer check clips than a participant is asked, or of kinds not declared."""
    declared = experiment.evidence.motion_checks
    asked = sum(motion_checks_by_block(experiment))
    if not asked:
        return
    fitting = [clip for clip in manifest.checks if clip.check in declared.kinds]
    if len(fitting) < asked or len(fitting) < len(manifest.checks):
        raise InputError(
            f"expected clips of at least {asked} motion checks ({', '.join(declared.kinds)}), the manifest "
            f"has {len(fitting)} of {len(manifest.checks)}; make them with `stimuli checks` and upload them"
        )


def store_clips(store: ClipStore, manifest: Manifest, folder: Path) -> int:
    """Check every file's hash, then copy what is new into the clip store; return how many were new.

    Originals of converted clips are kept too, and are not counted.
    """
    check_files(manifest, folder)
    check_originals(manifest, folder)
    for clip in manifest.files:
        if major_brand(folder / clip.file) == QUICKTIME:  # older releases took such files as they are
            raise InputError(
                f"'{clip.file}' is a QuickTime file, which no participant's browser can show; write the "
                "manifest again with `stimuli manifest`, which converts it"
            )
    for source in manifest.sources:
        with (folder / source.kept_as).open("rb") as stream:
            store.add(stream, source.sha256)
    added = 0
    for clip in manifest.files:
        with (folder / clip.file).open("rb") as stream:
            added += store.add(stream, clip.sha256)
    return added


def create_study(
    session: Session,
    name: str,
    experiment: Experiment,
    identity: Identity | None,
    workspace: Workspace | None = None,
) -> Study:
    """A new draft, in the default workspace where none is given; NameTaken where another has the name."""
    with every_row(session):
        is_taken = repository.study_called(session, name) is not None
    if is_taken:
        raise NameTaken(f"A study called '{name}' already exists on this server. Choose another name.")
    study = Study(
        name=name,
        title=experiment.title,
        active_version=0,
        created_by=identity.account_id if identity else None,
        workspace_id=(workspace or default_workspace(session)).id,
    )
    session.add(study)
    session.flush()
    record(session, identity, "study created", "study", name)
    return study


def notes_of(declared: Experiment, manifest: Manifest, version: StudyVersion) -> Iterator[str]:
    """What an experimenter may want to know of a study as it was taken in."""
    if manifest.definition_sha256 != version.definition_sha256:
        yield "the clips were built with another wording of the declaration; their cells agree"
    yield from size_notes(declared, manifest)


def size_notes(declared: Experiment, manifest: Manifest) -> Iterator[str]:
    """What is to be said where participants measure their screens for clips that have no size."""
    sized = manifest.inter_ocular_px or any(clip.width_mm for clip in manifest.clips)
    if declared.display.calibrate != "off" and not sized:
        yield (
            "no clip says how large it is to be shown, so they are shown pixel by pixel although "
            f'participants measure their screens (calibrate = "{declared.display.calibrate}"); give clips a '
            'width_mm in manifest.json, or declare calibrate = "off" in [display]'
        )


def add_version(
    session: Session,
    study: Study,
    text: str,
    experiment: Experiment,
    manifest: Manifest,
    identity: Identity | None,
    note: str = "",
) -> StudyVersion:
    """Add a version of `study` and make it the one new runs use. The clips must be in the store already."""
    check_against_design(experiment, manifest)
    version = StudyVersion(
        study_id=study.id,
        number=max((known.number for known in study.versions), default=0) + 1,
        experiment=experiment.name,
        definition_toml=text,
        definition=experiment.model_dump(mode="json"),
        definition_sha256=definition_sha256(experiment),
        manifest=manifest.model_dump(mode="json"),
        inter_ocular_px=manifest.inter_ocular_px,
        format=FORMAT,
        series=series_for(study, experiment, content_of(manifest.clips), sizes_of(manifest)),
        note=note,
        created_by=identity.account_id if identity else None,
    )
    study.versions.append(version)
    study.active_version, study.title = version.number, experiment.title
    study.revision = (study.revision or 0) + 1
    session.flush()
    _add_clips(session, version, manifest)
    record(session, identity, "version added", "study", study.name, version=version.number, note=note)
    return version


def _add_clips(session: Session, version: StudyVersion, manifest: Manifest) -> None:
    """Store the rows of a version's clips by one statement per table: objects of 5,000 clips take seconds."""
    stored = {video.sha256: video for video in (*manifest.files, *manifest.sources)}
    known = repository.known_clips(session, stored)
    repository.insert_clips(
        session, (_stored_source(video) for video in stored.values() if video.sha256 not in known)
    )
    repository.insert_version_clips(session, version, map(_placed_clips, manifest.files))


def _stored_source(video: DesignClip | CheckClip | SourceVideo) -> dict[str, Any]:
    return {
        "sha256": video.sha256,
        "bytes": video.bytes,
        "fps": video.fps,
        "frames": video.frames,
        "width_px": video.width_px,
        "height_px": video.height_px,
    }


def _placed_clips(clip: DesignClip | CheckClip) -> dict[str, Any]:
    shared = {"clip_sha256": clip.sha256, "file": clip.file, "width_mm": clip.width_mm}
    if isinstance(clip, CheckClip):
        check = {"cell": CHECK_CELL, "levels": {"check": clip.check}, "exemplar": clip.number}
        return shared | check | {"profile_id": "", "blinks_s": None}
    return shared | {
        "cell": clip.cell,
        "levels": clip.levels,
        "exemplar": clip.exemplar,
        "profile_id": clip.profile,
        "blinks_s": list(clip.blinks_s) or None,
    }


# New studies and new versions: definition and clips are checked and stored before the database changes.


def shipped_experiments(settings: Settings) -> list[ShippedExperiment]:
    """The experiments and demonstrations that come with the program, their clips built or not."""
    experiments = []
    for name in (*SHIPPED, *DEMOS):
        text = locate(name).read_text(encoding="utf-8")
        folder = settings.stimuli_folder / name
        experiments.append(
            ShippedExperiment(
                name=name,
                title=_title(text),
                toml=text,
                demonstration=name in DEMOS,
                clips_ready=(folder / MANIFEST_NAME).is_file(),
            )
        )
    return experiments


@cache
def _title(text: str) -> str:
    """The declared title; kept, as all shipped declarations take most of a second to read."""
    return parse_experiment(text).title


def create(
    database: Database, settings: Settings, clips: ClipStore, order: NewStudy, identity: Identity
) -> str:
    """Create a draft study; everything is checked and every clip stored before the database changes."""
    with database.read() as session:
        workspace_for(session, identity, order.workspace)  # refused before anything is stored
    text, experiment, manifest, folder = _materials(settings, order, identity)
    check_against_design(experiment, manifest)
    _store(clips, manifest, folder)
    with database.write() as session:
        study = create_study(
            session, order.name, experiment, identity, workspace_for(session, identity, order.workspace)
        )
        add_version(session, study, text, experiment, manifest, identity, note="created")
        study.revision = 1
    return order.name


def _store(clips: ClipStore, manifest: Manifest, folder: Path) -> None:
    """Take the clips of a built set, or of an upload of own clips, into the clip store."""
    if (folder / MANIFEST_NAME).is_file():
        store_clips(clips, manifest, folder)
    else:
        own_clips.store_prepared(clips, manifest, folder)


def _materials(
    settings: Settings, order: NewStudy, identity: Identity
) -> tuple[str, Experiment, Manifest, Path]:
    if order.shipped is not None:
        if order.shipped not in (known := (*SHIPPED, *DEMOS)):
            near = did_you_mean(order.shipped, known)
            raise Invalid(f"There is no shipped experiment '{order.shipped}'{near}")
        text = order.toml or locate(order.shipped).read_text(encoding="utf-8")
        folder = settings.stimuli_folder / order.shipped
        return text, planned_experiment(text), read_manifest(folder), folder
    if order.upload is None:
        raise Invalid("A study needs clips. Choose a shipped experiment or upload clips first.")
    folder = upload_folder(settings.upload_folder, order.upload, identity.account_id)
    if (folder / MANIFEST_NAME).is_file():
        if order.toml is None:
            raise Invalid(
                "The upload has a manifest. Also provide the definition (TOML) from which its clips were "
                "built."
            )
        return order.toml, planned_experiment(order.toml), read_manifest(folder), folder
    return _own_study(order, folder)


def _own_study(order: NewStudy, folder: Path) -> tuple[str, Experiment, Manifest, Path]:
    placed = _placed_levels(order.levels, folder)
    check_factorial(placed)
    if order.toml is None and order.own_clips is None:
        raise Invalid("Enter a title and a question for the study, or a definition.")
    text = order.toml
    if text is None and order.own_clips is not None:
        text = own_clips.definition_text(
            order.name, placed, order.own_clips, own_clips.largest_of(placed, folder)
        )
    experiment = planned_experiment(text or "")
    return text or "", experiment, own_clips.manifest_of(experiment, placed, folder), folder


def _placed_levels(levels: LevelsTable | LevelsPattern | None, folder: Path) -> Placed:
    files = [path.name for path in videos_of(folder)]
    if levels is None:
        raise Invalid("Specify the levels of each clip, with a CSV table or a file-name pattern.")
    if isinstance(levels, LevelsTable):
        return levels_from_table(levels.csv, files)
    return levels_from_names(levels.pattern, files)


def add_definition(
    database: Database,
    settings: Settings,
    clips: ClipStore,
    stored: StoredClips,
    name: str,
    order: NewVersion,
    identity: Identity,
) -> None:
    """Store a changed definition as a new version, with the clips there are and those of an upload.

    Where the study is live, each clip that the version adds is decoded before.
    """
    with database.read() as session:
        study = find_study(session, name, identity, "edit")  # refused before a clip is stored
        is_live = study.status == "live"
        known = {clip.sha256 for clip in active_manifest(session, study).files}
    experiment = planned_experiment(order.toml)
    added = _added_clips(settings, clips, order, experiment, identity)
    of_clips: list[LaunchCheck] = []
    if is_live and added is not None:
        new = [clip for clip in added.files if clip.sha256 not in known]
        of_clips = clip_findings(*stored.find_faults(new, CLIPS_WITHIN_S))
    with database.write() as session:
        study = for_edit(session, name, order.revision, identity, "edit")
        if study.status == "live" and not is_live:  # its new clips were not decoded
            raise Conflict(
                "Not saved: the study was set live meanwhile. Save again; its clips are checked then."
            )
        manifest = active_manifest(session, study)
        if order.places is not None:
            manifest = own_clips.placed_manifest(manifest, added, order.places, experiment)
        elif added is not None:
            own_clips.check_declared(added, experiment)
            manifest = own_clips.merged_manifest(manifest, added)
        manifest = own_clips.only_declared(manifest, experiment)
        add_version(session, study, order.toml, experiment, manifest, identity, order.note)
        refuse_if_live(session, study, of_clips)


def active_manifest(session: Session, study: Study) -> Manifest:
    """The clips that new runs of a study use."""
    return Manifest.model_validate(active_version(session, study).manifest)


def _added_clips(
    settings: Settings, clips: ClipStore, order: NewVersion, experiment: Experiment, identity: Identity
) -> Manifest | None:
    """The manifest of uploaded clips, their bytes in the store; None where none were uploaded."""
    if order.upload is None:
        return None
    folder = upload_folder(settings.upload_folder, order.upload, identity.account_id)
    if (folder / MANIFEST_NAME).is_file():
        manifest = read_manifest(folder)
    else:
        placed = (
            _placed_levels(order.levels, folder)
            if order.places is None
            else own_clips.places_in(folder, order.places)
        )
        if not placed:
            return None
        manifest = own_clips.manifest_of(experiment, placed, folder)
    _store(clips, manifest, folder)
    return manifest
