"""Before a study goes live: its checklist, and dress rehearsals in the background; the latest is kept."""

import atexit
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from pathlib import Path

from pydantic import ValidationError
from sqlalchemy.orm import Session

from experiments.files import json_text
from server.accounts.audit import record
from server.accounts.identity import OPERATOR, Identity
from server.core.db import Database
from server.core.errors import NotFound
from server.core.locks import LONGEST_S, Locks, file_lock
from server.core.settings import Settings
from server.core.values import now
from server.exports.seals import people_begun, seal_of
from server.models import Job, Study
from server.operations.doctor import Finding
from server.rehearsals.schemas import (
    DEFINITION,
    MANIFEST,
    ORDER,
    REPORT,
    RESULT,
    NewRehearsal,
    Order,
    RehearsalOut,
    RehearsalResult,
    Step,
)
from server.results import repository
from server.results.jobs import begin_job, in_background, is_under_way, job_state, note
from server.studies.launch_checks import clip_findings, clips_shown, launch_checks
from server.studies.lookup import active_version, find_study
from server.studies.schemas import LaunchCheck
from server.transcoding.preparing import StoredClips

_KEPT_VARIABLES = ("PATH", "LANG", "LC_ALL", "HOME", "TMPDIR", "VIRTUAL_ENV", "PYTHONPATH")
"""What the sandbox gets of the environment: no address of a database, no key, no setting."""
_LOCK = ".one-at-a-time"
"""Held by the one rehearsal of a server, whichever of its processes runs it."""
_CANCELLED = "cancelled"
"""File that asks for the end, from whichever process the button reached."""
_LOOK_EVERY_S = 0.2


def start(
    database: Database, settings: Settings, locks: Locks, name: str, order: NewRehearsal, identity: Identity
) -> RehearsalOut:
    """Begin a rehearsal in the background in the place of those before; Conflict where one is under way."""
    with database.write() as session:
        study = find_study(session, name, identity, "run")
        version = active_version(session, study)
        parameters = {**order.model_dump(), "version": version.number}
        in_the_way = "A rehearsal of this study is already running. Please wait."
        job = begin_job(locks, session, study, "rehearsal", parameters, identity, in_the_way)
        record(session, identity, "rehearsal asked for", "study", name, **order.model_dump())
        session.flush()
        rehearsal = _out(locks, job)
        before = [one.public_id for one in repository.jobs_of(session, study, "rehearsal") if one is not job]
        for public_id in before:
            repository.remove_job(session, study, "rehearsal", public_id)
    for public_id in before:
        shutil.rmtree(_folder(settings, public_id), ignore_errors=True)
    in_background(database, locks, rehearsal.id, partial(_run, database, settings, name, rehearsal.id, order))
    return rehearsal


def latest(locks: Locks, session: Session, name: str, identity: Identity) -> RehearsalOut | None:
    """The rehearsal of a study; None where there is none."""
    study = find_study(session, name, identity, "view")
    jobs = repository.latest_jobs(session, study, "rehearsal")
    return _out(locks, jobs[0]) if jobs else None


def result(
    settings: Settings, session: Session, name: str, identity: Identity, public_id: str
) -> RehearsalResult:
    """What a rehearsal showed; NotFound while there is nothing."""
    study = find_study(session, name, identity, "view")
    path = _folder(settings, public_id) / RESULT
    if repository.find_job(session, study, "rehearsal", public_id) is None or not path.is_file():
        raise NotFound(
            "There is no such rehearsal, or it is not finished. Reload the page to see its progress."
        )
    return RehearsalResult.model_validate_json(path.read_text(encoding="utf-8"))


def report_file(
    settings: Settings, session: Session, name: str, identity: Identity, public_id: str, file: str
) -> Path:
    """A file of the report that simulated people would give."""
    if file not in result(settings, session, name, identity, public_id).report:
        raise NotFound("There is no such rehearsal, or its report does not contain this file.")
    return _folder(settings, public_id) / REPORT / file


def _folder(settings: Settings, public_id: str) -> Path:
    return settings.common_folder / "rehearsals" / public_id


def _out(locks: Locks, job: Job) -> RehearsalOut:
    return RehearsalOut.model_validate(
        {
            **job_state(locks, job, "the server stopped before it was finished"),
            "version": job.parameters.get("version", 0),
            "participants": job.parameters.get("participants", 0),
        }
    )


def cancel(
    database: Database, settings: Settings, locks: Locks, name: str, identity: Identity, public_id: str
) -> None:
    """End a rehearsal that waits or goes on, with all that it started; one that is over stays as it is."""
    with database.write() as session:
        study = find_study(session, name, identity, "run")
        job = repository.find_job(session, study, "rehearsal", public_id)
        if job is None:
            raise NotFound("There is no such rehearsal. Reload the page.")
        if not is_under_way(locks, job):
            return
        # The file first: a rehearsal whose turn comes in between would be shown as running again.
        folder = _folder(settings, public_id)
        folder.mkdir(parents=True, exist_ok=True)
        (folder / _CANCELLED).touch()
        job.status, job.message, job.finished_at = "cancelled", "", now()
        record(session, identity, "rehearsal cancelled", "study", name)


def _is_cancelled(folder: Path) -> bool:
    """Whether its end was asked for, or another rehearsal has taken its place."""
    return (folder / _CANCELLED).exists() or not (folder / ORDER).exists()


@contextmanager
def _turn(settings: Settings, folder: Path) -> Iterator[bool]:
    """Wait until no process of this server has a rehearsal going on; false where cancelled meanwhile."""
    while not _is_cancelled(folder):
        with ExitStack() as held:
            try:
                held.enter_context(file_lock(settings.data_folder / "rehearsals" / _LOCK, wait=False))
            except BlockingIOError:
                time.sleep(_LOOK_EVERY_S)
                continue
            yield True
            return
    yield False


def _run(database: Database, settings: Settings, name: str, public_id: str, order: NewRehearsal) -> None:
    """The background thread's work."""
    folder = _folder(settings, public_id)
    try:
        _write_inputs(database, name, folder, order)
        with _turn(settings, folder) as mine:
            # One that was canceled and replaced before it had a folder has lost its mark with the folder.
            if not mine or _status(database, public_id) != "queued":
                return
            note(database, public_id, status="running", message="beginning", started_at=now())
            problem = _in_sandbox(database, public_id, folder)
        if _is_cancelled(folder):
            return
        ended = {"status": "failed" if problem else "done", "progress": 1.0, "message": problem}
        note(database, public_id, finished_at=now(), **ended)
    finally:
        shutil.rmtree(folder / "sandbox", ignore_errors=True)
        if _status(database, public_id) is None:
            shutil.rmtree(folder, ignore_errors=True)


def _status(database: Database, public_id: str) -> str | None:
    with database.read() as session:
        return repository.status_of(session, public_id)


def _write_inputs(database: Database, name: str, folder: Path, order: NewRehearsal) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    with database.read() as session:
        version = active_version(session, find_study(session, name, OPERATOR, "view"))
        (folder / DEFINITION).write_text(version.definition_toml, encoding="utf-8")
        (folder / MANIFEST).write_text(json_text(version.manifest), encoding="utf-8")
    told = Order(participants=order.participants, seed=order.seed)
    (folder / ORDER).write_text(told.model_dump_json(), encoding="utf-8")


def _in_sandbox(database: Database, public_id: str, folder: Path) -> str:
    """Rehearse in a process that knows no database but its own; return why it failed, or ''."""
    environment = {name: os.environ[name] for name in _KEPT_VARIABLES if name in os.environ}
    problem = "the rehearsal ended before it was finished"
    with subprocess.Popen(  # noqa: S603 - this interpreter, a folder of ours
        _program(folder),
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        env=environment,
        start_new_session=True,
    ) as process:
        over = threading.Event()
        threading.Thread(target=_guard, args=(process.pid, folder, over), daemon=True).start()
        atexit.register(_kill, process.pid)
        try:
            for line in process.stdout or ():
                try:
                    step = Step.model_validate_json(line)
                except ValidationError:  # something else that was printed
                    continue
                problem = step.problem or problem
                note(database, public_id, progress=step.share, message=step.step)
            process.wait()
        finally:
            over.set()
            atexit.unregister(_kill)
            _kill(process.pid)
    return "" if process.returncode == 0 else problem


def _guard(group: int, folder: Path, over: threading.Event) -> None:
    """End the rehearsal where it is cancelled, or takes too long."""
    limit = time.monotonic() + LONGEST_S
    while not over.wait(_LOOK_EVERY_S):
        if _is_cancelled(folder) or time.monotonic() > limit:
            _kill(group)
            return


def _program(folder: Path) -> list[str]:
    return [sys.executable, "-m", "server.rehearsals.sandbox", str(folder)]


def _kill(group: int) -> None:
    """End the rehearsal with all that it started: an analysis would go on without it."""
    with suppress(ProcessLookupError, PermissionError):
        os.killpg(group, signal.SIGKILL)


# The checklist before a study goes live: its declaration, rehearsal and plan, and the server.


def preflight(
    database: Database,
    settings: Settings,
    stored: StoredClips,
    examine_server: Callable[[], Sequence[Finding]],
    name: str,
    identity: Identity,
) -> list[LaunchCheck]:
    """Everything that speaks against opening the active version of a study, blocking findings first.

    `examine_server` asks the doctor (`server.operations.doctor.findings_for_studies`), once the account has
    turned out to be allowed to see the study. Of clips it says what is known by now.
    """
    with database.read() as session:
        findings = launch_checks(session, name, identity)
        study = find_study(session, name, identity, "view")
        findings += [*_plan(session, study), *_rehearsal(session, study)]
        clips = clips_shown(session, study)
    findings += clip_findings(stored.known_faults(clips))
    return sorted([*findings, *_server(settings, examine_server())], key=lambda finding: not finding.blocks)


def _plan(session: Session, study: Study) -> Iterator[LaunchCheck]:
    """A plan that can still be sealed."""
    if seal_of(session, study) is None and not people_begun(session, study):
        yield LaunchCheck(
            kind="plan",
            blocks=False,
            text="The analysis plan is not sealed. It can be sealed only before the first participant, under "
            "Data. Without a seal, the report cannot list deviations.",
            page="data",
        )


def _rehearsal(session: Session, study: Study) -> Iterator[LaunchCheck]:
    """A version that simulated people have not gone through to its end."""
    jobs = repository.latest_jobs(session, study, "rehearsal")
    number = active_version(session, study).number
    if any(job.status == "done" and job.parameters.get("version") == number for job in jobs):
        return
    if not jobs:
        what = "There is no rehearsal yet."
    elif jobs[0].status == "failed":
        what = f"The last rehearsal failed: {jobs[0].message}."
    elif jobs[0].status == "done":
        what = (
            f"The last rehearsal was of version {jobs[0].parameters.get('version')}, not of version {number}."
        )
    else:
        what = "The last rehearsal is not finished."
    text = f"{what} Rehearse with simulated people to see orders, columns, the report and the power."
    yield LaunchCheck(kind="rehearsal", blocks=False, text=text, page="rehearsal")


_OF_SERVER = {
    "data folder": "disk",
    "shared folder": "disk",
    "backups": "backups",
    "public address": "address",
}
"""Findings of `server doctor` that matter for a study, and the kind of their check."""


def _server(settings: Settings, of_server: Sequence[Finding]) -> Iterator[LaunchCheck]:
    """A full disk, old backups, an address that participants cannot reach."""
    for finding in of_server:
        kind = _OF_SERVER.get(finding.subject)
        if kind is not None and finding.verdict != "ok":
            yield of_finding(kind, finding)
    if settings.is_local:
        yield LaunchCheck(
            kind="address",
            blocks=False,
            text=f"Links begin with {settings.public_url}, which opens only on this machine. Set "
            "PALPEBRA_PUBLIC_URL before you send links to people on other machines.",
            page="server",
        )
    if not _has_backups(settings):
        yield LaunchCheck(
            kind="backups",
            blocks=False,
            text="Backups are not monitored: PALPEBRA_BACKUP_FOLDER is not set. Set it, and run "
            "`server backup` every day.",
            page="server",
        )


def of_finding(kind: str, finding: Finding) -> LaunchCheck:
    """A finding of `server doctor` as a line of the checklist."""
    # Folders of the server are nothing for people of a study: the doctor names them to its operator.
    state = re.split(r", |: ", finding.state)[-1] if kind == "disk" else finding.state
    if kind == "backups" and finding.verdict == "failed":
        state = "they cannot be read"
    text = f"{finding.subject.capitalize()}: {state}. {finding.advice[:1].upper()}{finding.advice[1:]}."
    return LaunchCheck(kind=kind, blocks=False, text=text, page="server")


def _has_backups(settings: Settings) -> bool:
    return bool(settings.backup_folder)
