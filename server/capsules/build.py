"""Build a capsule: Psych-DS folder, clips, report, software versions and RO-Crate, then the zip of all."""

import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from sqlalchemy.orm import Session

from experiments.capsule.declaration import (
    CAPSULE_FILE,
    MANIFEST,
    REPORT_FOLDER,
    SOFTWARE_FILE,
    Capsule,
    ReportSource,
)
from experiments.capsule.packing import listed_files, pack, report_input
from experiments.definition import Experiment
from experiments.errors import InputError
from experiments.files import whole_file
from experiments.json import json_text
from experiments.manifest import Manifest
from experiments.software import present_software
from server.accounts.identity import OPERATOR
from server.capsules.crate import CRATE_FILE, crate_metadata
from server.clock import now
from server.context import Services
from server.export.extract import Extract
from server.export.psych_ds import Folder, dataset_folder
from server.methods.service import Counted, counted, paragraph_of, read_results, write_beside
from server.models import Study, StudyVersion
from server.reports.process import run_analysis
from server.seals.page import page as seal_page
from server.seals.service import seal_of
from server.storage.clips import ClipStore
from server.studies.lookup import definition_of, find_study
from server.studies.series import version_of_series

CapsuleOrigin = Literal["participant", "pilot", "simulated"]
Progress = Callable[[float, str], None]
ANSWERS = "answers.csv"
SEAL = "materials/sealed-plan.json"


@dataclass(frozen=True)
class CapsuleContents:
    """What a capsule holds.

    Attributes
    ----------
    clips : bool
        Whether the clips are in it; their hashes are in the manifest always.
    sensitivity : bool
        Whether the report has the parts that take long.
    series : int or None
        The data series whose data, definition, clips and report it holds. Without it: the data of every
        series, and all else of the active version.
    """

    origin: CapsuleOrigin = "participant"
    clips: bool = True
    sensitivity: bool = True
    series: int | None = None


def build_capsule(
    services: Services,
    name: str,
    contents: CapsuleContents,
    target: Path,
    progress: Progress = lambda _, __: None,
) -> Capsule:
    """Write the capsule of a study to `target`, whole or not at all.

    Raises
    ------
    InputError
        There is nothing to analyse, or a clip is missing from the store.
    NotFound
        There is no such data series.
    """
    made = now().date().isoformat()
    with tempfile.TemporaryDirectory(prefix=".capsule-", dir=target.parent) as temporary:
        folder, work = Path(temporary) / "capsule", Path(temporary) / "work"
        folder.mkdir()
        work.mkdir()
        progress(0.05, "exporting")
        with services.database.snapshot() as session:
            study = find_study(session, name, OPERATOR, "view")
            version = version_of_series(session, study, contents.series)
            source = _write_study(session, study, version, folder, made, contents)
            experiment, manifest = definition_of(version), Manifest.model_validate(version.manifest)
            known = counted(session, study, source.origin, source.series)
        # The snapshot has ended: what follows may take an hour, and the database must not wait for it.
        if contents.clips:
            progress(0.15, "copying clips")
            _copy_clips(services.clips, manifest, folder)
        progress(0.3, "analysing")
        source = _report(known, source, folder, work)
        progress(0.9, "packing")
        capsule = _list(known.study, experiment, source, folder, made)
        with whole_file(target) as unfinished:
            pack(folder, unfinished)
    return capsule


def _without_answers(manifest: Mapping[str, Any]) -> dict[str, Any]:
    """The manifest without what would answer the motion checks of a study that still runs."""
    kept = {key: value for key, value in manifest.items() if key != "checks_seed"}
    if "checks" in kept:
        checks = kept["checks"]
        kept["checks"] = [{key: one[key] for key in one if key != "answer"} for one in checks]
    return kept


def _write_study(
    session: Session, study: Study, version: StudyVersion, folder: Path, made: str, contents: CapsuleContents
) -> ReportSource:
    exported: Folder = dataset_folder(session, study, made, Extract(contents.origin, contents.series))
    for path, pieces in exported.members:
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        with (folder / path).open("wb") as stream:
            for piece in pieces:
                stream.write(piece)
    experiment, seal = definition_of(version), seal_of(session, study)
    texts = {
        MANIFEST: json_text(_without_answers(version.manifest)),
        "analysis/plan.json": json_text(_plan(experiment)),
        SOFTWARE_FILE: json_text(present_software().model_dump(mode="json")),
    }
    if seal is not None:
        texts |= {SEAL: seal.text(), SEAL.replace(".json", ".html"): seal_page(seal)}
    for path, text in texts.items():
        (folder / path).write_text(text, encoding="utf-8")
    return ReportSource(
        definition=f"materials/{experiment.name}.toml",
        answers=exported.answers,
        runs=exported.runs,
        origin=contents.origin,
        series=version.series,
        sensitivity=contents.sensitivity,
        renamed=exported.renamed,
        seal=SEAL if seal else None,
        rebuilt=(),
    )


def _plan(experiment: Experiment) -> dict[str, object]:
    """What was fixed of the analysis, for people and programs that do not read TOML."""
    return experiment.model_dump(
        mode="json", include={"analysis", "exclusions", "attention", "screening", "playback", "participants"}
    )


def _copy_clips(store: ClipStore, manifest: Manifest, folder: Path) -> None:
    clips = folder / "materials" / "clips"
    clips.mkdir(parents=True)
    for clip in manifest.files:
        target, size = clips / clip.file, store.size(clip.sha256)
        if size is None:
            raise InputError(f"clip {clip.file} is missing from the clip store; run: server doctor")
        with target.open("wb") as stream:
            for piece in store.read(clip.sha256, 0, size):
                stream.write(piece)


def _report(known: Counted, source: ReportSource, folder: Path, work: Path) -> ReportSource:
    """Make the report from the capsule's own table, so that it can be made from it again."""
    answers, results = work / ANSWERS, folder / REPORT_FOLDER
    report_input(folder / source.answers, answers, source.renamed)
    message = run_analysis(
        folder / source.definition,
        answers,
        results,
        origin=source.origin,
        series=source.series,
        sensitivity=source.sensitivity,
        runs=folder / source.runs,
        seal=folder / source.seal if source.seal else None,
        manifest=folder / MANIFEST,
    )
    if message:
        raise InputError(f"a capsule holds the report, which could not be made: {message}")
    rebuilt = tuple(sorted(path.name for path in results.iterdir()))
    write_beside(results, paragraph_of(known, read_results(results)))
    return source.model_copy(update={"rebuilt": rebuilt})


def _list(study: str, experiment: Experiment, source: ReportSource, folder: Path, made: str) -> Capsule:
    software = present_software()
    crate = crate_metadata(study, experiment, listed_files(folder), source, software, made)
    (folder / CRATE_FILE).write_text(crate, encoding="utf-8")
    capsule = Capsule(study=study, made=made, report=source, software=software, files=listed_files(folder))
    (folder / CAPSULE_FILE).write_text(capsule.text(), encoding="utf-8")
    return capsule
