"""Statements that several parts of the server share."""

from collections.abc import Sequence
from typing import Any, NamedTuple

from sqlalchemy import Connection, inspect, select, text
from sqlalchemy.dialects import postgresql, sqlite
from sqlalchemy.orm import DeclarativeBase, Session

from server.models import Clip, StudyRun, StudyVersion, VersionClip

_MIGRATION_LOCK = 7_202_611  # any number, the same for every worker


class VersionClipRow(NamedTuple):
    """A clip's number in the database, its cell and exemplar in a version, and the clip itself."""

    id: int
    cell: str
    exemplar: int
    width_mm: float | None
    clip: Clip


def insert_once(session: Session, table: type[DeclarativeBase], rows: Sequence[dict[str, Any]]) -> None:
    """Insert rows; those that a UNIQUE constraint already knows are left as they are."""
    if not rows:
        return
    dialect = session.get_bind().dialect.name
    statement = postgresql.insert(table) if dialect == "postgresql" else sqlite.insert(table)
    session.execute(statement.on_conflict_do_nothing(), rows)


def version_by_id(session: Session, version_id: int) -> StudyVersion:
    """The version with this id, which there must be."""
    return session.get_one(StudyVersion, version_id)


def clips_of_version(session: Session, version_id: int) -> list[VersionClipRow]:
    """The clips of a version, those of checks too, by their numbers."""
    query = (
        select(VersionClip.id, VersionClip.cell, VersionClip.exemplar, VersionClip.width_mm, Clip)
        .join(Clip, Clip.sha256 == VersionClip.clip_sha256)
        .where(VersionClip.version_id == version_id)
        .order_by(VersionClip.id)
    )
    return [VersionClipRow(*row) for row in session.execute(query)]


def newest_clip(session: Session) -> str | None:
    """The hash of the clip that came last."""
    return session.scalar(select(Clip.sha256).order_by(Clip.created_at.desc()).limit(1))


def run_called(session: Session, public_id: str) -> StudyRun | None:
    """The run with this public id, of whatever study and origin."""
    return session.scalar(select(StudyRun).where(StudyRun.public_id == public_id))


def stored_revision(connection: Connection) -> str | None:
    """The revision of a connection's database; None where it is empty."""
    if not inspect(connection).has_table("alembic_version"):
        return None
    revision: str | None = connection.scalar(text("SELECT version_num FROM alembic_version"))
    return revision


def wait_for_other_migrations(connection: Connection) -> None:
    """On PostgreSQL, hold off other migrations until this transaction ends."""
    connection.execute(text("SELECT pg_advisory_xact_lock(:lock)"), {"lock": _MIGRATION_LOCK})
