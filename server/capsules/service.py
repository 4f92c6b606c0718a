"""Capsules from the dashboard: built in the background, kept to be downloaded."""

import threading
from datetime import timedelta
from functools import partial
from pathlib import Path

from sqlalchemy.orm import Session

from server.accounts.audit import record
from server.accounts.identity import OPERATOR, Identity
from server.capsules.build import CapsuleContents, build_capsule
from server.capsules.schemas import CapsuleOut, NewCapsule
from server.clock import now
from server.context import Services
from server.errors import Conflict, NotFound
from server.models import Job
from server.reports import repository
from server.reports.jobs import begun, in_background, is_under_way, note, shown
from server.studies.lookup import find_study
from server.studies.series import version_of_series

_one_at_a_time = threading.Lock()


def start(services: Services, name: str, order: NewCapsule, identity: Identity) -> CapsuleOut:
    """Begin a capsule in the background; Conflict where one of this study is under way.

    NotFound where there is no such data series.
    """
    with services.database.write() as session:
        study = find_study(session, name, identity, "run")
        version_of_series(session, study, order.series)
        job = begun(
            services,
            session,
            study,
            "capsule",
            order.model_dump(),
            identity,
            "A capsule of this study is being made already; wait for it.",
        )
        record(session, identity, "data downloaded", "study", name, what="capsule", origin=order.origin)
        session.flush()
        capsule = _capsule_out(services, job)
    in_background(services, capsule.id, partial(_build, services, name, capsule.id, order))
    return capsule


def capsules(services: Services, session: Session, name: str, identity: Identity) -> list[CapsuleOut]:
    """Every finished capsule of a study among its latest attempts, newest first."""
    study = find_study(session, name, identity, "view")
    every = repository.jobs(session, study, "capsule")
    listed = every[: repository.LISTED] + [job for job in every[repository.LISTED :] if job.status == "done"]
    return [_capsule_out(services, job) for job in listed]


def capsule_file(services: Services, session: Session, name: str, identity: Identity, public_id: str) -> Path:
    """The zip of a finished capsule; NotFound where there is none."""
    study = find_study(session, name, identity, "export")
    job = repository.find_job(session, study, "capsule", public_id)
    path = _zip_of(services, public_id)
    if job is None or job.status != "done" or not path.is_file():
        raise NotFound("There is no such capsule, or it is not done; reload the page to see how far it is.")
    return path


def remove(services: Services, name: str, public_id: str, identity: Identity) -> None:
    """Delete a capsule for good; NotFound where there is none, Conflict while it is made."""
    with services.database.write() as session:
        study = find_study(session, name, identity, "run")
        job = repository.find_job(session, study, "capsule", public_id)
        if job is None:
            raise NotFound("There is no such capsule; reload the page to see which there are.")
        if is_under_way(services, job):
            raise Conflict("This capsule is being made; delete it when it is done.")
        repository.remove_job(session, study, "capsule", public_id)
        record(session, identity, "capsule removed", "study", name, capsule=public_id)
    _zip_of(services, public_id).unlink(missing_ok=True)


def remove_old(services: Services, name: str) -> None:
    """Remove what a study has too many of, and what has become too old; the audit log says so."""
    oldest = now() - timedelta(days=services.settings.capsule_keep_days)
    with services.database.write() as session:
        study = find_study(session, name, OPERATOR, "view")
        ended = [job for job in repository.jobs(session, study, "capsule") if not is_under_way(services, job)]
        recent = [job for job in ended if job.created_at >= oldest]
        surplus = [job for job in recent if job.status == "done"][services.settings.capsules_kept :]
        gone = [job.public_id for job in ended if job not in recent or job in surplus]
        for public_id in gone:
            repository.remove_job(session, study, "capsule", public_id)
            record(session, OPERATOR, "capsule removed", "study", name, capsule=public_id)
    for public_id in gone:
        _zip_of(services, public_id).unlink(missing_ok=True)


def _zip_of(services: Services, public_id: str) -> Path:
    return services.settings.common_folder / "capsules" / f"{public_id}.zip"


def _capsule_out(services: Services, job: Job) -> CapsuleOut:
    path, result = _zip_of(services, job.public_id), job.result or {}
    is_there = job.status == "done" and path.is_file()
    return CapsuleOut.model_validate(
        {
            **shown(services, job, "the server was stopped while it was made"),
            "origin": job.parameters.get("origin", "participant"),
            "series": job.parameters.get("series"),
            "clips": job.parameters.get("clips", True),
            "bytes": path.stat().st_size if is_there else None,
            "sha256": result.get("sha256"),
        }
    )


def _build(services: Services, name: str, public_id: str, order: NewCapsule) -> None:
    """The background thread's work."""
    target = _zip_of(services, public_id)
    target.parent.mkdir(parents=True, exist_ok=True)
    with _one_at_a_time:
        note(services, public_id, status="running", started_at=now())
        made = build_capsule(
            services,
            name,
            CapsuleContents(order.origin, order.clips, order.sensitivity, order.series),
            target,
            lambda share, step: note(services, public_id, progress=share, message=step),
        )
    ended = {"status": "done", "progress": 1.0, "message": "", "result": {"sha256": made.sha256}}
    note(services, public_id, finished_at=now(), **ended)
    remove_old(services, name)
