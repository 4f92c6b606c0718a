"""Build a report: export the ratings, run `analysis run` in a separate process, keep what it wrote."""

import shutil
import threading
from functools import partial
from pathlib import Path
from typing import Any

from sqlalchemy.orm import Session

from experiments.files import json_text
from experiments.manifest import MANIFEST_NAME
from server.accounts.audit import record
from server.accounts.identity import OPERATOR, Identity
from server.core.db import Database
from server.core.errors import NotFound
from server.core.locks import Locks
from server.core.settings import Settings
from server.core.values import now
from server.exports.csv_lines import csv_pieces, rating_table
from server.exports.formats import runs_csv
from server.exports.schemas import Extract, NewReport, ReportOut
from server.exports.seals import seal_of
from server.models import Job
from server.results import repository
from server.results.jobs import begin_job, in_background, job_state, note, run_analysis
from server.results.methods import methods_of, read_results, write
from server.studies.lookup import find_study
from server.studies.series import version_of_series

SEAL = "sealed-plan.json"
# A report is one page with its own styles and pictures inside; it may load and run nothing.
REPORT_POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data:; sandbox allow-popups"
_one_at_a_time = threading.Lock()


def start(
    database: Database, settings: Settings, locks: Locks, name: str, order: NewReport, identity: Identity
) -> ReportOut:
    """Queue a report and begin it in the background; Conflict where one of this study is under way."""
    with database.write() as session:
        study = find_study(session, name, identity, "run")
        job = begin_job(
            locks,
            session,
            study,
            "report",
            order.model_dump(),
            identity,
            "A report of this study is already being made. Please wait.",
        )
        record(session, identity, "report asked for", "study", name, **order.model_dump())
        session.flush()
        report = report_out(settings, locks, job)
    in_background(database, locks, report.id, partial(_build, database, settings, name, report.id, order))
    return report


def reports(
    settings: Settings, locks: Locks, session: Session, name: str, identity: Identity
) -> list[ReportOut]:
    """The latest reports of a study."""
    study = find_study(session, name, identity, "view")
    return [report_out(settings, locks, job) for job in repository.latest_jobs(session, study, "report")]


def report_out(settings: Settings, locks: Locks, job: Job) -> ReportOut:
    """A report as the page shows it."""
    folder = report_folder(settings, job.public_id)
    done = job.status == "done" and folder.is_dir()
    return ReportOut.model_validate(
        {
            **job_state(locks, job, "the server stopped before it was finished"),
            "origin": job.parameters.get("origin") or _origin_of_older(job.parameters),
            "series": job.parameters.get("series"),
            "finished_at": job.finished_at,
            "files": sorted(path.name for path in folder.iterdir() if path.is_file()) if done else [],
        }
    )


def _origin_of_older(parameters: dict[str, Any]) -> str:
    # Reports made before there were origins have a phase instead.
    return "pilot" if parameters.get("phase") == "pilot" else "participant"


def report_folder(settings: Settings, public_id: str) -> Path:
    """Where the files of a report lie."""
    return settings.common_folder / "reports" / public_id


def report_file(
    settings: Settings,
    locks: Locks,
    session: Session,
    name: str,
    identity: Identity,
    public_id: str,
    file: str,
) -> Path:
    """One file of a finished report; NotFound where it is not one of its files.

    Its tables have rows of single persons (means of each, exclusions), so it takes the right of downloads.
    """
    study = find_study(session, name, identity, "export")
    job = repository.find_job(session, study, "report", public_id)
    if job is None or file not in report_out(settings, locks, job).files:
        raise NotFound("There is no such report, or it does not contain this file.")
    return report_folder(settings, public_id) / file


def _build(database: Database, settings: Settings, name: str, public_id: str, order: NewReport) -> None:
    """The background thread's work."""
    folder = report_folder(settings, public_id)
    inputs = folder.with_name(f".{public_id}.input")
    try:
        with _one_at_a_time:
            note(database, public_id, status="running", progress=0.05, message="exporting", started_at=now())
            series = _export(database, name, inputs, order)
            note(database, public_id, progress=0.2, message="analysing")
            message = _analyse(inputs, folder, order, series)
            if not message:
                _add_methods(database, name, folder, order, series)
        status = "failed" if message else "done"
        note(database, public_id, status=status, progress=1.0, message=message, finished_at=now())
    finally:
        shutil.rmtree(inputs, ignore_errors=True)


def _export(database: Database, name: str, inputs: Path, order: NewReport) -> int:
    """Write the ratings, the runs and the declaration of a series; return the series."""
    inputs.mkdir(parents=True, exist_ok=True)
    with database.snapshot() as session:  # answers and runs are of one moment
        study = find_study(session, name, OPERATOR, "view")
        version = version_of_series(session, study, order.series)
        (inputs / "definition.toml").write_text(version.definition_toml, encoding="utf-8")
        with (inputs / "answers.csv").open("wb") as stream:
            stream.writelines(csv_pieces(rating_table(session, study, Extract(order.origin))))
        with (inputs / "runs.csv").open("wb") as stream:
            stream.writelines(runs_csv(session, study, Extract(order.origin)))
        if (seal := seal_of(session, study)) and version.number == study.active_version:
            (inputs / SEAL).write_text(seal.text(), encoding="utf-8")
            (inputs / MANIFEST_NAME).write_text(json_text(version.manifest), encoding="utf-8")
        return version.series


def _analyse(inputs: Path, folder: Path, order: NewReport, series: int) -> str:
    """Run the analysis; return its own error line where it failed, else an empty text."""
    return run_analysis(
        inputs / "definition.toml",
        inputs / "answers.csv",
        folder,
        origin=order.origin,
        series=series,
        sensitivity=order.sensitivity,
        runs=inputs / "runs.csv",
        seal=seal if (seal := inputs / SEAL).is_file() else None,
        manifest=manifest if (manifest := inputs / MANIFEST_NAME).is_file() else None,
    )


def _add_methods(database: Database, name: str, folder: Path, order: NewReport, series: int) -> None:
    with database.read() as session:
        study = find_study(session, name, OPERATOR, "view")
        methods = methods_of(session, study, order.origin, series, read_results(folder))
    write(folder, methods)
