"""Work in the background that a row of `jobs` reports on: reports, capsules and rehearsals."""

import logging
import shutil
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from sqlalchemy.exc import SQLAlchemyError
from sqlalchemy.orm import Session

from experiments.errors import InputError
from server.accounts.identity import Identity
from server.core.db import Database
from server.core.errors import ApiError, Conflict
from server.core.locks import LONGEST_S, Locks
from server.core.values import new_public_id, now
from server.models import Job, Study
from server.results import repository
from server.results.repository import JobKind

# Run `analysis run` in a separate process: the server carries no numerics.


def run_analysis(
    definition: Path,
    answers: Path,
    folder: Path,
    *,
    origin: str,
    series: int,
    sensitivity: bool,
    runs: Path,
    seal: Path | None = None,
    manifest: Path | None = None,
) -> str:
    """Write the report into `folder`; return the analysis' own error line where it failed, else ''."""
    command = [str(own_program("analysis")), "run", str(definition), "--csv", str(answers)]
    command += ["--runs", str(runs)]
    command += ["--origin", origin, "--series", str(series), "--out", str(folder)]
    command += [] if sensitivity else ["--no-sensitivity"]
    command += ["--seal", str(seal)] if seal else []
    command += ["--manifest", str(manifest)] if manifest else []
    done = subprocess.run(command, capture_output=True, text=True, timeout=LONGEST_S, check=False)  # noqa: S603
    if done.returncode == 0:
        return ""
    shutil.rmtree(folder, ignore_errors=True)
    reason = last_line(done.stderr or done.stdout)
    return (reason or f"the analysis ended with code {done.returncode}")[:500]


def own_program(name: str) -> Path:
    """A command of this installation, such as `analysis`."""
    return Path(sys.executable).with_name(f"{name}.exe" if sys.platform == "win32" else name)


def last_line(printed: str) -> str:
    """The last line that is not empty, where a command line prints its error, without `error: `."""
    line = next((line for line in reversed(printed.splitlines()) if line.strip()), "")
    return line.removeprefix("error: ")


# Work in the background that a row of `jobs` describes: reports, capsules and rehearsals.

LOG = logging.getLogger(__name__)
FORESEEN = (InputError, ApiError, OSError, subprocess.SubprocessError)
"""Errors whose message says what the experimenter can do."""
UNFORESEEN = "the server met an error that it did not expect; its log says which; please contact its operator"
UNDER_WAY = ("queued", "running")
WRITE_AGAIN_S = (1, 2, 4, 8, 15, 30, 60)
"""How long to wait before the end of a job is written again, where the database did not take it."""


def begin_job(
    locks: Locks,
    session: Session,
    study: Study,
    kind: JobKind,
    parameters: dict[str, Any],
    identity: Identity,
    in_the_way: str,
) -> Job:
    """A new job that waits; Conflict with the words `in_the_way` where one of its kind is under way."""
    repository.lock_study(session, study)  # two that ask at once would each see none under way
    if any(is_under_way(locks, job) for job in repository.latest_jobs(session, study, kind)):
        raise Conflict(in_the_way)
    job = Job(
        public_id=new_public_id(),
        kind=kind,
        study_id=study.id,
        message="waiting",
        parameters=parameters,
        created_by=identity.account_id,
    )
    session.add(job)
    return job


def in_background(database: Database, locks: Locks, public_id: str, work: Callable[[], None]) -> None:
    """Do a job's work in a separate thread; an error in it, foreseen or not, ends the job as failed.

    While it goes on a lock is held: where a process dies with its jobs, others see it by that.
    """
    held = ExitStack()
    held.enter_context(locks.of_job(public_id))
    threading.Thread(target=_run, args=(database, public_id, work, held), daemon=True).start()


def _run(database: Database, public_id: str, work: Callable[[], None], held: ExitStack) -> None:
    with held:
        try:
            work()
        except FORESEEN as error:
            _fail(database, public_id, str(error)[:500])
        except Exception:
            LOG.exception("job %s", public_id)
            _fail(database, public_id, UNFORESEEN)


def _fail(database: Database, public_id: str, message: str) -> None:
    for wait_s in WRITE_AGAIN_S:
        try:
            return note(database, public_id, status="failed", message=message, finished_at=now())
        except SQLAlchemyError:
            LOG.warning("the end of job %s could not be written; again in %d s", public_id, wait_s)
            time.sleep(wait_s)
    return note(database, public_id, status="failed", message=message, finished_at=now())


def job_state(locks: Locks, job: Job, stopped: str) -> dict[str, Any]:
    """What the page shows of a job of any kind; `stopped` is said where the server was stopped meanwhile."""
    stale = is_abandoned(locks, job)
    return {
        "id": job.public_id,
        "status": "failed" if stale else job.status,
        "progress": job.progress,
        "message": stopped if stale else job.message,
        "created_at": job.created_at,
    }


def note(database: Database, public_id: str, **values: Any) -> None:
    """Write how far a job is, or how it ended; one that has ended stays as it is."""
    with database.write() as session:
        job = repository.job_called(session, public_id)
        if job is not None and job.status in UNDER_WAY:
            for name, value in values.items():
                setattr(job, name, value)


def is_under_way(locks: Locks, job: Job) -> bool:
    """Whether a job waits or runs."""
    return job.status in UNDER_WAY and not is_abandoned(locks, job)


def is_abandoned(locks: Locks, job: Job) -> bool:
    """Whether the process that did its work has ended before it."""
    return job.status in UNDER_WAY and locks.job_is_left(job)
