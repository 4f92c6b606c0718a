"""Clips of shipped experiments, built in the background by `stimuli build`: the buttons of New study."""

import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from importlib.util import find_spec

from pydantic import BaseModel, Field
from sqlalchemy.orm import Session

from experiments.errors import InputError
from experiments.load import DEMOS, SHIPPED
from experiments.manifest import MANIFEST_NAME
from server.accounts.audit import record
from server.accounts.identity import Identity
from server.core.db import Database
from server.core.errors import Conflict, NotFound
from server.core.locks import Locks, LockTaken
from server.core.settings import Settings
from server.core.values import new_public_id, now
from server.models import Job
from server.results import repository
from server.results.jobs import in_background, is_under_way, job_state, last_line, note, own_program

KIND, PROGRAM = "demo clips", "stimuli"
RENDERS_WITH = "skia"
"""The module of the extra `render` without which no clip can be drawn."""
NOTED_EVERY_S = 1.0


class ClipBuild(BaseModel):
    """The latest build of a shipped experiment's clips; where it failed, `message` says why."""

    experiment: str
    status: str = Field(description="queued, running, done or failed.")
    progress: float = Field(description="Share of the clips that are built, 0 to 1.")
    message: str


class ClipBuilds(BaseModel):
    """What can be built on this server, and what is."""

    lacks: str = Field(description="Why this server cannot build clips; empty where it can.")
    builds: list[ClipBuild]


def clip_builds(database: Database, locks: Locks) -> ClipBuilds:
    """How far the clips of shipped experiments are."""
    with database.read() as session:
        latest = _latest_jobs(session)
        builds = [_build_out(locks, name, job) for name, job in latest.items()]
    return ClipBuilds(lacks=_what_is_missing(), builds=builds)


def start_clip_build(
    database: Database, settings: Settings, locks: Locks, experiment: str, identity: Identity
) -> ClipBuild:
    """Begin to build the clips of a shipped experiment; one experiment at a time, as it takes every core.

    Raises
    ------
    NotFound, Conflict
        There is no such experiment; clips cannot be rendered here, or others are being built.
    """
    if experiment not in (*SHIPPED, *DEMOS):
        raise NotFound(f"There is no shipped experiment '{experiment}'.")
    if missing := _what_is_missing():
        raise Conflict(missing)
    with _only_one(locks), database.write() as session:
        for name, earlier in _latest_jobs(session).items():
            if is_under_way(locks, earlier):
                raise Conflict(f"The clips of '{name}' are being built. Wait until they are done.")
        parameters = {"experiment": experiment}
        job = Job(
            public_id=new_public_id(),
            kind=KIND,
            message="waiting",
            parameters=parameters,
            created_by=identity.account_id,
        )
        session.add(job)
        record(session, identity, "clips built", "experiment", experiment)
        session.flush()
        begun = _build_out(locks, experiment, job)
        public_id = job.public_id
    in_background(database, locks, public_id, partial(build_clips, database, settings, public_id, experiment))
    return begun


@contextmanager
def _only_one(locks: Locks) -> Iterator[None]:
    """The second of two simultaneous requests is refused: each would see no build under way."""
    try:
        with locks.held(KIND):
            yield
    except LockTaken as error:
        raise Conflict("Clips are being built. Wait until they are done.") from error


def _what_is_missing() -> str:
    if find_spec(RENDERS_WITH) is not None and own_program(PROGRAM).is_file():
        return ""
    return "This server cannot render clips. Its operator can install Palpebra with the extra 'render'."


def _latest_jobs(session: Session) -> dict[str, Job]:
    """The latest build of each experiment."""
    return {job.parameters["experiment"]: job for job in repository.jobs_without_study(session, KIND)}


def _build_out(locks: Locks, experiment: str, job: Job) -> ClipBuild:
    stopped = "the server stopped before the clips were built; build again to continue"
    return ClipBuild.model_validate({"experiment": experiment, **job_state(locks, job, stopped)})


def build_clips(database: Database, settings: Settings, public_id: str, experiment: str) -> None:
    """Run `stimuli build` in a separate process, and note the clips done as it prints them."""
    note(database, public_id, status="running", message="preparing", started_at=now())
    folder = settings.stimuli_folder / experiment
    folder.parent.mkdir(parents=True, exist_ok=True)
    command = [
        str(own_program(PROGRAM)),
        "build",
        experiment,
        "--out",
        str(folder.resolve()),
        "--progress-lines",
    ]
    with subprocess.Popen(  # noqa: S603
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, encoding="utf-8"
    ) as process:
        lines, noted = [""], 0.0
        for line in process.stdout or ():
            done, _, total = line.strip().partition(" of ")
            if not (done.isdecimal() and total.isdecimal()):
                lines.append(line)
            elif time.monotonic() - noted > NOTED_EVERY_S:
                noted = time.monotonic()
                share = int(done) / max(1, int(total))
                note(database, public_id, progress=share, message=f"{done} of {total} clips")
    if process.returncode or not (folder / MANIFEST_NAME).is_file():
        reason = last_line("".join(lines))
        raise InputError(reason or f"`stimuli build` ended with code {process.returncode}")
    note(database, public_id, status="done", progress=1.0, message="", finished_at=now())
