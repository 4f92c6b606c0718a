"""Capsules: everything of a study that can be handed on, in one zip, built in the background."""

import json
import mimetypes
import tempfile
import threading
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from datetime import timedelta
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from sqlalchemy.orm import Session

from experiments.capsule import (
    CAPSULE_FILE,
    MANIFEST,
    PROGRAM,
    REPORT_FOLDER,
    SOFTWARE_FILE,
    Capsule,
    CapsuleFile,
    ReportSource,
    Software,
    listed_files,
    pack,
    present_software,
    report_input,
)
from experiments.declaration.experiment import Experiment
from experiments.errors import InputError
from experiments.files import json_text, whole_file
from experiments.manifest import Manifest
from server.accounts.audit import record
from server.accounts.identity import OPERATOR, Identity
from server.core.db import Database
from server.core.errors import Conflict, NotFound
from server.core.locks import Locks
from server.core.settings import Settings
from server.core.storage import ClipStore
from server.core.values import now
from server.exports.psych_ds import Folder, dataset_folder
from server.exports.schemas import CapsuleOut, Extract, NewCapsule
from server.exports.seals import page as seal_page
from server.exports.seals import seal_of
from server.models import Job, Study, StudyVersion
from server.results import repository
from server.results.jobs import begin_job, in_background, is_under_way, job_state, note, run_analysis
from server.results.methods import MethodsFigures, methods_figures, paragraph_of, read_results, write_beside
from server.studies.lookup import definition_of, find_study
from server.studies.series import version_of_series

if TYPE_CHECKING:
    from rocrate.rocrate import ROCrate

# The RO-Crate of a capsule (https://w3id.org/ro/crate/1.2): what each file is, who made it, and how.

CRATE_FILE = "ro-crate-metadata.json"
CRATE_VERSION = "1.2"
_FOLDERS = {
    "": "Description of the dataset, for people and programs",
    "analysis": "Script that analyzes the answers, or the declared analysis plan",
    "data": "Table of data, de-identified",
    "documentation": "Documentation of the data and the software",
    "materials": "Materials: clips and questions",
    "results": "Report of the analysis",
}
_NO_LICENCE = "No license is declared. Ask the creators before you use these data."


def crate_metadata(
    study: str,
    experiment: Experiment,
    files: Iterable[CapsuleFile],
    report: ReportSource,
    software: Software,
    made: str,
) -> str:
    """`ro-crate-metadata.json` of a capsule of these files."""
    from rocrate.model.person import Person  # a quarter of the server's start, for a rare download
    from rocrate.rocrate import ROCrate

    crate = ROCrate(version=CRATE_VERSION)
    about = experiment.dataset
    crate.name = f"{experiment.title} (study {study})"
    crate.description = about.description or f"{experiment.title}. Data, materials and report of the study."
    crate.root_dataset["datePublished"] = made
    crate.root_dataset["license"] = _licence(crate, about.licence_page)
    crate.root_dataset["keywords"] = ["video clips", *(f.label for f in experiment.factors), *about.keywords]
    if about.creators:
        crate.root_dataset["author"] = [
            crate.add(
                Person(crate, one.orcid_page or f"#creator-{number}", _person(one.name, one.affiliation))
            )
            for number, one in enumerate(about.creators, start=1)
        ]
    by_path = {}
    for file in files:
        by_path[file.path] = crate.add_file(dest_path=file.path, properties=_of_file(file))
    listing = {"name": CAPSULE_FILE, "encodingFormat": "application/json", "description": "Hash of each file"}
    crate.add_file(dest_path=CAPSULE_FILE, properties=listing)
    _add_action(crate, by_path, report, software)
    return json.dumps(crate.metadata.generate(), indent=1, ensure_ascii=False) + "\n"


def _of_file(file: CapsuleFile) -> dict[str, Any]:
    folder, _, name = file.path.rpartition("/")
    kind = mimetypes.guess_type(file.path)[0] or {"R": "text/x-r", "toml": "application/toml"}.get(
        file.path.rpartition(".")[2], "application/octet-stream"
    )
    said = _FOLDERS.get(folder.partition("/")[0], "Part of the study")
    return {
        "name": name,
        "encodingFormat": kind,
        "contentSize": str(file.bytes),
        "sha256": file.sha256,
        "description": said,
    }


def _person(name: str, affiliation: str) -> dict[str, Any]:
    return {"name": name, **({"affiliation": affiliation} if affiliation else {})}


def _licence(crate: "ROCrate", page: str | None) -> Any:
    properties = {
        "@type": "CreativeWork",
        "name": page or "No licence",
        "description": f"The license at {page}." if page else _NO_LICENCE,
    }
    from rocrate.model.contextentity import ContextEntity

    return crate.add(ContextEntity(crate, page or "#no-licence", properties=properties))


def _add_action(crate: "ROCrate", by_path: dict[str, Any], report: ReportSource, software: Software) -> None:
    """How the report came about: the program, what it read, what it gave."""
    from rocrate.model.contextentity import ContextEntity

    program = ContextEntity(
        crate,
        f"#{PROGRAM}",
        properties={
            "@type": "CreativeWork",
            "name": PROGRAM,
            "version": software.packages.get(PROGRAM, "unknown"),
            "description": f"Run by Python {software.python} on {software.system}; versions of "
            "all packages are in documentation/software.json",
        },
    )
    results = [entity for path, entity in by_path.items() if path.startswith("results/")]
    action = ContextEntity(
        crate,
        "#analysis",
        properties={
            "@type": "CreateAction",
            "name": f"analysis run: origin {report.origin}, data series {report.series}",
        },
    )
    crate.add(program, action)
    action["instrument"] = program
    action["object"] = [by_path[report.definition], by_path[report.answers], by_path[report.runs]]
    action["result"] = results
    crate.root_dataset["mentions"] = action


# Build a capsule: Psych-DS folder, clips, report, software versions and RO-Crate, then the zip of all.

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
    database: Database,
    clips: ClipStore,
    name: str,
    contents: CapsuleContents,
    target: Path,
    progress: Progress = lambda _, __: None,
) -> Capsule:
    """Write the capsule of a study to `target`, whole or not at all.

    Raises
    ------
    InputError
        There is nothing to analyze, or a clip is missing from the store.
    NotFound
        There is no such data series.
    """
    made = now().date().isoformat()
    target.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=".capsule-", dir=target.parent) as temporary:
        folder, work = Path(temporary) / "capsule", Path(temporary) / "work"
        folder.mkdir()
        work.mkdir()
        progress(0.05, "exporting")
        with database.snapshot() as session:
            study = find_study(session, name, OPERATOR, "view")
            version = version_of_series(session, study, contents.series)
            source = _write_study(session, study, version, folder, made, contents)
            experiment, manifest = definition_of(version), Manifest.model_validate(version.manifest)
            known = methods_figures(session, study, source.origin, source.series)
        # The snapshot has ended: what follows may take an hour, and the database must not wait for it.
        if contents.clips:
            progress(0.15, "copying clips")
            _copy_clips(clips, manifest, folder)
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


def _report(known: MethodsFigures, source: ReportSource, folder: Path, work: Path) -> ReportSource:
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
        raise InputError(f"the capsule could not be made, because its report failed: {message}")
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


# Capsules from the dashboard: built in the background, kept to be downloaded.

_one_at_a_time = threading.Lock()


def start(
    database: Database,
    settings: Settings,
    clips: ClipStore,
    locks: Locks,
    name: str,
    order: NewCapsule,
    identity: Identity,
) -> CapsuleOut:
    """Begin a capsule in the background; Conflict where one of this study is under way.

    NotFound where there is no such data series.
    """
    with database.write() as session:
        study = find_study(session, name, identity, "run")
        version_of_series(session, study, order.series)
        job = begin_job(
            locks,
            session,
            study,
            "capsule",
            order.model_dump(),
            identity,
            "A capsule of this study is already being made. Please wait.",
        )
        record(session, identity, "data downloaded", "study", name, what="capsule", origin=order.origin)
        session.flush()
        capsule = _capsule_out(settings, locks, job)
    in_background(
        database,
        locks,
        capsule.id,
        partial(_build, database, settings, clips, locks, name, capsule.id, order),
    )
    return capsule


def capsules(
    settings: Settings, locks: Locks, session: Session, name: str, identity: Identity
) -> list[CapsuleOut]:
    """Every finished capsule of a study among its latest attempts, newest first."""
    study = find_study(session, name, identity, "view")
    every = repository.jobs_of(session, study, "capsule")
    listed = every[: repository.LISTED_JOBS] + [
        job for job in every[repository.LISTED_JOBS :] if job.status == "done"
    ]
    return [_capsule_out(settings, locks, job) for job in listed]


def capsule_file(settings: Settings, session: Session, name: str, identity: Identity, public_id: str) -> Path:
    """The zip of a finished capsule; NotFound where there is none."""
    study = find_study(session, name, identity, "export")
    job = repository.find_job(session, study, "capsule", public_id)
    path = _zip_of(settings, public_id)
    if job is None or job.status != "done" or not path.is_file():
        raise NotFound(
            "There is no such capsule, or it is not finished. Reload the page to see its progress."
        )
    return path


def remove(
    database: Database, settings: Settings, locks: Locks, name: str, public_id: str, identity: Identity
) -> None:
    """Delete a capsule for good; NotFound where there is none, Conflict while it is made."""
    with database.write() as session:
        study = find_study(session, name, identity, "run")
        job = repository.find_job(session, study, "capsule", public_id)
        if job is None:
            raise NotFound("There is no such capsule. Reload the page to see the current list.")
        if is_under_way(locks, job):
            raise Conflict("This capsule is still being made. You can delete it when it is finished.")
        repository.remove_job(session, study, "capsule", public_id)
        record(session, identity, "capsule removed", "study", name, capsule=public_id)
    _zip_of(settings, public_id).unlink(missing_ok=True)


def remove_old(database: Database, settings: Settings, locks: Locks, name: str) -> None:
    """Remove what a study has too many of, and what has become too old; the audit log says so."""
    oldest = now() - timedelta(days=settings.capsule_keep_days)
    with database.write() as session:
        study = find_study(session, name, OPERATOR, "view")
        ended = [job for job in repository.jobs_of(session, study, "capsule") if not is_under_way(locks, job)]
        recent = [job for job in ended if job.created_at >= oldest]
        surplus = [job for job in recent if job.status == "done"][settings.capsules_kept :]
        gone = [job.public_id for job in ended if job not in recent or job in surplus]
        for public_id in gone:
            repository.remove_job(session, study, "capsule", public_id)
            record(session, OPERATOR, "capsule removed", "study", name, capsule=public_id)
    for public_id in gone:
        _zip_of(settings, public_id).unlink(missing_ok=True)


def _zip_of(settings: Settings, public_id: str) -> Path:
    return settings.common_folder / "capsules" / f"{public_id}.zip"


def _capsule_out(settings: Settings, locks: Locks, job: Job) -> CapsuleOut:
    path, result = _zip_of(settings, job.public_id), job.result or {}
    is_there = job.status == "done" and path.is_file()
    return CapsuleOut.model_validate(
        {
            **job_state(locks, job, "the server stopped before it was finished"),
            "origin": job.parameters.get("origin", "participant"),
            "series": job.parameters.get("series"),
            "clips": job.parameters.get("clips", True),
            "bytes": path.stat().st_size if is_there else None,
            "sha256": result.get("sha256"),
        }
    )


def _build(
    database: Database,
    settings: Settings,
    clips: ClipStore,
    locks: Locks,
    name: str,
    public_id: str,
    order: NewCapsule,
) -> None:
    """The background thread's work."""
    target = _zip_of(settings, public_id)
    with _one_at_a_time:
        note(database, public_id, status="running", started_at=now())
        made = build_capsule(
            database,
            clips,
            name,
            CapsuleContents(order.origin, order.clips, order.sensitivity, order.series),
            target,
            lambda share, step: note(database, public_id, progress=share, message=step),
        )
    ended = {"status": "done", "progress": 1.0, "message": "", "result": {"sha256": made.sha256}}
    note(database, public_id, finished_at=now(), **ended)
    remove_old(database, settings, locks, name)
