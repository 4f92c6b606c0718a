"""Take a declared experiment and a folder of clips into the server: all of it, or nothing."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from sqlalchemy.orm import Session

from experiments import design
from experiments.assignment.checks import motion_checks_by_block
from experiments.checks import CHECK_CELL
from experiments.definition import Experiment
from experiments.errors import InputError
from experiments.manifest import UPLOADED, CheckClip, Manifest, check_files, check_originals
from experiments.manifest import Clip as DesignClip
from experiments.schema.canonical import definition_sha256
from experiments.schema.upgrades import FORMAT
from experiments.source_video import SourceVideo
from server.accounts.audit import record
from server.accounts.identity import Identity
from server.errors import Conflict
from server.models import Study, StudyVersion, Workspace
from server.row_security_repository import every_row
from server.storage.clips import ClipStore
from server.studies import repository
from server.studies.series import series_for
from server.workspaces.repository import default_workspace
from video_conversion.prepared import QUICKTIME, major_brand


class NameTaken(Conflict):
    """Another study has this name."""

    code = "name_taken"


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
            f"the manifest holds {len(extra)} clips that the definition does not declare, "
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
        raise NameTaken(f"There is already a study called '{name}' on this server; choose another name.")
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
        series=series_for(study, experiment, manifest),
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
    """Store the rows of a version's clips by one statement a table: objects of 5,000 clips take seconds."""
    stored = {video.sha256: video for video in (*manifest.files, *manifest.sources)}
    known = repository.known_clips(session, stored)
    repository.insert_clips(
        session, (_stored(video) for video in stored.values() if video.sha256 not in known)
    )
    repository.insert_version_clips(session, version, map(_placed, manifest.files))


def _stored(video: DesignClip | CheckClip | SourceVideo) -> dict[str, Any]:
    return {
        "sha256": video.sha256,
        "bytes": video.bytes,
        "fps": video.fps,
        "frames": video.frames,
        "width_px": video.width_px,
        "height_px": video.height_px,
    }


def _placed(clip: DesignClip | CheckClip) -> dict[str, Any]:
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
