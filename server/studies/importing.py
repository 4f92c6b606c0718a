"""Take a declared experiment and a folder of clips into the server: all of it, or nothing."""

from pathlib import Path

from sqlalchemy.orm import Session

from experiments import design
from experiments.checks import CHECK_CELL
from experiments.definition import Experiment
from experiments.errors import InputError
from experiments.manifest import CheckClip, Manifest, check_files
from experiments.manifest import Clip as DesignClip
from experiments.schema.canonical import definition_sha256
from experiments.schema.upgrades import FORMAT
from server.accounts.audit import record
from server.accounts.identity import Identity
from server.errors import Conflict
from server.models import Clip, Study, StudyVersion, VersionClip, Workspace
from server.storage.clips import ClipStore
from server.studies import repository
from server.studies.series import series_for
from server.workspaces.repository import default_workspace


def check_against_design(experiment: Experiment, manifest: Manifest) -> None:
    """InputError unless the manifest holds each clip of the design exactly once."""
    wanted = {(spec.cell, spec.exemplar) for spec in design.clips(experiment)}
    found = [(clip.cell, clip.exemplar) for clip in manifest.clips]
    if missing := sorted(wanted - set(found)):
        cell, exemplar = missing[0]
        raise InputError(
            f"expected {len(wanted)} clips, {len(missing)} are missing from the manifest, "
            f"the first is {cell}, exemplar {exemplar}; build the clips with this definition"
        )
    if extra := sorted(set(found) - wanted):
        cell, exemplar = extra[0]
        raise InputError(
            f"the manifest holds {len(extra)} clips that the definition does not declare, "
            f"the first is {cell}, exemplar {exemplar}"
        )
    if len(found) != len(wanted):
        raise InputError(f"expected each of {len(wanted)} clips once, the manifest lists {len(found)}")
    _check_checks(experiment, manifest)


def _check_checks(experiment: Experiment, manifest: Manifest) -> None:
    """InputError where there are fewer check clips than a participant is asked, or of kinds not declared."""
    declared = experiment.evidence.motion_checks
    asked = declared.per_block * len(design.blocks(experiment))
    if not asked:
        return
    fitting = [clip for clip in manifest.checks if clip.check in declared.kinds]
    if len(fitting) < asked or len(fitting) < len(manifest.checks):
        raise InputError(
            f"expected clips of at least {asked} motion checks ({', '.join(declared.kinds)}), the manifest "
            f"has {len(fitting)} of {len(manifest.checks)}; make them with `stimuli checks` and upload them"
        )


def store_clips(store: ClipStore, manifest: Manifest, folder: Path) -> int:
    """Check every file's hash, then copy what is new into the clip store; return how many were new."""
    check_files(manifest, folder)
    added = 0
    for clip in manifest.files:
        with (folder / clip.file).open("rb") as stream:
            added += store.add(stream, clip.sha256)
    return added


def create_study(
    session: Session,
    name: str,
    experiment: Experiment,
    who: Identity | None,
    workspace: Workspace | None = None,
) -> Study:
    """A new draft, in the default workspace where none is given; Conflict where the name is taken."""
    if repository.study_called(session, name) is not None:
        raise Conflict(f"There is already a study called '{name}' on this server; choose another name.")
    study = Study(
        name=name,
        title=experiment.title,
        active_version=0,
        created_by=who.account_id if who else None,
        workspace_id=(workspace or default_workspace(session)).id,
    )
    session.add(study)
    session.flush()
    record(session, who, "study created", "study", name)
    return study


def add_version(
    session: Session,
    study: Study,
    text: str,
    experiment: Experiment,
    manifest: Manifest,
    who: Identity | None,
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
        series=series_for(study, experiment, manifest),
        note=note,
        created_by=who.account_id if who else None,
    )
    study.versions.append(version)
    study.active_version, study.title = version.number, experiment.title
    study.revision = (study.revision or 0) + 1
    _add_clips(session, version, manifest)
    session.flush()
    record(session, who, "version added", "study", study.name, version=version.number, note=note)
    return version


def _add_clips(session: Session, version: StudyVersion, manifest: Manifest) -> None:
    for clip in manifest.files:
        if not repository.is_known_clip(session, clip.sha256):
            session.add(
                Clip(
                    sha256=clip.sha256,
                    bytes=clip.bytes,
                    fps=clip.fps,
                    frames=clip.frames,
                    width_px=clip.width_px,
                    height_px=clip.height_px,
                )
            )
            session.flush()
        version.clips.append(_placed(clip))


def _placed(clip: DesignClip | CheckClip) -> VersionClip:
    shared = {"clip_sha256": clip.sha256, "file": clip.file, "width_mm": clip.width_mm}
    if isinstance(clip, CheckClip):
        return VersionClip(cell=CHECK_CELL, levels={"check": clip.check}, exemplar=clip.number, **shared)
    return VersionClip(
        cell=clip.cell,
        levels=clip.levels,
        exemplar=clip.exemplar,
        profile_id=clip.profile,
        blinks_s=list(clip.blinks_s) or None,
        **shared,
    )
