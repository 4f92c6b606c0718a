"""New studies and new versions: definition and clips are checked and stored before the database changes."""

import shlex
from functools import cache
from pathlib import Path

from experiments.definition import Experiment
from experiments.errors import did_you_mean
from experiments.load import DEMOS, SHIPPED, locate, parse_experiment
from experiments.manifest import MANIFEST_NAME, Manifest, read_manifest
from experiments.own_clips import Placed, check_factorial, levels_from_names, levels_from_table
from server.accounts.identity import Identity
from server.context import Services
from server.errors import Invalid
from server.studies import own_clips
from server.studies.clip_schemas import LevelsPattern, LevelsTable
from server.studies.edits import for_edit
from server.studies.importing import add_version, check_against_design, create_study, store_clips
from server.studies.launch_checks import refuse_if_live
from server.studies.lookup import active_version, find_study
from server.studies.planned import planned_experiment
from server.studies.schemas import NewStudy, NewVersion, ShippedExperiment
from server.studies.uploads import upload_folder
from server.transcoding.records import videos_of
from server.workspaces.service import workspace_for


def shipped(services: Services) -> list[ShippedExperiment]:
    """The experiments and demonstrations that come with the program, their clips built or not."""
    experiments = []
    for name in (*SHIPPED, *DEMOS):
        text = locate(name).read_text(encoding="utf-8")
        folder = services.settings.stimuli_folder / name
        experiments.append(
            ShippedExperiment(
                name=name,
                title=_title(text),
                toml=text,
                demonstration=name in DEMOS,
                clips_ready=(folder / MANIFEST_NAME).is_file(),
                build=f"stimuli build {name} --out {shlex.quote(str(folder.resolve()))}",
            )
        )
    return experiments


@cache
def _title(text: str) -> str:
    """The declared title; kept, as all shipped declarations take most of a second to read."""
    return parse_experiment(text).title


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
        refuse_if_live(session, study)


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
