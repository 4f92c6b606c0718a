"""Whether the server lives, and whether it can serve."""

import shutil
import sqlite3
from contextlib import closing
from pathlib import Path

from fastapi import APIRouter
from pydantic import BaseModel

from server.context import ServicesDep
from server.db import Database
from server.errors import ERROR_RESPONSES, ApiError
from server.migrate import current_revision, newest_revision
from server.repository import newest_clip
from server.settings import Settings

LOCKED_AFTER_S = 3.0
"""This server's own transactions are over long before."""

router = APIRouter(tags=["health"], responses=ERROR_RESPONSES)


class Health(BaseModel):
    """A short word."""

    status: str


class NotReady(ApiError):
    """The server runs but cannot serve yet."""

    status = 503
    code = "not_ready"


def no_room(settings: Settings) -> str | None:
    """What is wrong where the disk of the data folder is full, or nearly so."""
    needed = settings.free_megabytes_min * 1_000_000
    free = shutil.disk_usage(settings.data_folder if settings.data_folder.exists() else Path()).free
    if free >= needed:
        return None
    room = f"{free / 1e6:.0f} MB free, {needed / 1e6:.0f} MB needed"
    return f"The disk of the data folder is full: {room}; make room."


def is_locked(database: Database) -> bool:
    """Whether a SQLite file cannot be written to within LOCKED_AFTER_S, as this server waits for longer."""
    if not database.url.database:
        return False
    with closing(
        sqlite3.connect(database.url.database, timeout=LOCKED_AFTER_S, isolation_level=None)
    ) as probe:
        try:
            probe.execute("BEGIN IMMEDIATE")
        except sqlite3.OperationalError as error:
            if error.sqlite_errorcode & 0xFF == sqlite3.SQLITE_BUSY:
                return True
            raise NotReady(f"The database cannot be written to: {error}.") from error
        probe.execute("ROLLBACK")
        return False


@router.head("/healthz", include_in_schema=False)
@router.get("/healthz")
async def healthz() -> Health:
    """The process answers."""
    return Health(status="ok")


@router.head("/readyz", include_in_schema=False)
@router.get("/readyz", responses={503: ERROR_RESPONSES["4XX"]})
def readyz(services: ServicesDep) -> Health:
    """The database answers, is writable and has the newest revision; the disk has room, clips are read."""
    revision, expected = current_revision(services.database), newest_revision()
    if revision != expected:
        raise NotReady(
            f"The database has revision {revision}, expected {expected}; run `server database upgrade`."
        )
    if problem := no_room(services.settings):
        raise NotReady(problem)
    if services.database.is_sqlite and is_locked(services.database):
        raise NotReady(
            f"Another program has kept the database locked for {LOCKED_AFTER_S:g} s; end it, or wait for it."
        )
    with services.database.read() as session:
        clip = newest_clip(session)
    if problem := services.clips.problem(clip):
        raise NotReady(f"Clips cannot be read: {problem}; `server doctor` says what to do.")
    return Health(status="ready")
