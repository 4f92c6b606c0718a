"""Recruiters' IDs, encrypted in one table and their keys in another."""

from collections.abc import Iterator

from sqlalchemy import ColumnElement, Select, delete, select, update
from sqlalchemy.orm import Session

from server.core.db import SIGNING_KEY
from server.models import IdentityKey, RecruiterIdentity, StudyRun
from server.participation.identity_keys import (
    ParticipantIdentity,
    Sealed,
    UnreadableError,
    identifier_hash,
    rewrap,
    seal,
    unseal,
)

AT_ONCE = 500


def store_identity(
    session: Session,
    run: StudyRun,
    study_key: str,
    known_as: ParticipantIdentity,
    identifier: str | None = None,
) -> None:
    """Store who the person of a run is, under a separate key.

    Visits are matched by the keyed hash of `identifier`, which stands for all ways to write the person's id;
    without it of the id as it is written.
    """
    sealed = seal(session.info[SIGNING_KEY](), run.public_id, known_as)
    # One person's id can be written in several ways; all should match.
    matched_by = known_as.identifier if identifier is None else identifier
    session.add(
        RecruiterIdentity(
            study_run_id=run.id,
            identifier_hash=identifier_hash(study_key, matched_by),
            sealed=sealed.content,
        )
    )
    # A separate table, which backups leave out.
    session.add(IdentityKey(study_run_id=run.id, wrapped_key=sealed.wrapped_key))


def is_known(session: Session, study_key: str, identifier: str) -> bool:
    """Whether a visit is kept under the id exactly as it is written here."""
    same = RecruiterIdentity.identifier_hash == identifier_hash(study_key, identifier)
    return session.scalar(select(RecruiterIdentity.study_run_id).where(same).limit(1)) is not None


def known_as(session: Session, run: StudyRun) -> ParticipantIdentity | None:
    """Who the person of a run is; None where the address said nothing, or what it said is erased.

    Raises
    ------
    UnreadableError
        The secret key is another than the one it was encrypted under.
    """
    query = _with_keys().where(RecruiterIdentity.study_run_id == run.id)
    row = session.execute(query).one_or_none()
    # No row: nothing was said, or its key is erased.
    return unseal(session.info[SIGNING_KEY](), row[0], Sealed(row[1], row[2])) if row else None


def _with_keys() -> Select[str, str, str]:
    return (
        select(StudyRun.public_id, RecruiterIdentity.sealed, IdentityKey.wrapped_key)
        .join(StudyRun, StudyRun.id == RecruiterIdentity.study_run_id)
        .join(IdentityKey, IdentityKey.study_run_id == RecruiterIdentity.study_run_id)
    )


def same_person(session: Session, run: StudyRun) -> ColumnElement[bool] | None:
    """Which runs are under the recruiter's ID of this one; None where the recruiter named nobody."""
    query = select(RecruiterIdentity.identifier_hash).where(RecruiterIdentity.study_run_id == run.id)
    known = session.scalar(query)
    # An empty hash is of an address that named nobody, and matches nobody.
    if not known:
        return None
    return StudyRun.id.in_(
        select(RecruiterIdentity.study_run_id).where(RecruiterIdentity.identifier_hash == known)
    )


def drop_key(session: Session, run: StudyRun) -> bool:
    """Erase the key of a run and what it opened; False where there was none. The keyed hash stays."""
    # Before the deletion, which it changes.
    _overwrite_deleted(session)
    gone = delete(IdentityKey).where(IdentityKey.study_run_id == run.id).returning(IdentityKey.study_run_id)
    had = session.scalar(gone) is not None
    blank = update(RecruiterIdentity).where(RecruiterIdentity.study_run_id == run.id)
    # The content too: without its key it is noise, but nobody must rely on that alone.
    session.execute(blank.values(sealed=""))
    return had


def _overwrite_deleted(session: Session) -> None:
    """SQLite leaves what was deleted in the file; a key is to be gone from there as well."""
    connection = session.connection()
    if connection.dialect.name == "sqlite":
        connection.exec_driver_sql("PRAGMA secure_delete = ON")


def forget(session: Session, run: StudyRun) -> None:
    """Erase the id of a run, its keyed hash and its key."""
    _overwrite_deleted(session)
    for table in (IdentityKey, RecruiterIdentity):
        session.execute(delete(table).where(table.study_run_id == run.id))


def readable_identities(session: Session) -> Iterator[bool]:
    """For every stored id, whether it can be read."""
    secret = session.info[SIGNING_KEY]()
    query = (
        select(StudyRun.public_id, RecruiterIdentity.sealed, IdentityKey.wrapped_key)
        .join(StudyRun, StudyRun.id == RecruiterIdentity.study_run_id)
        # Outer: an id whose key is gone counts as one that cannot be read.
        .outerjoin(IdentityKey, IdentityKey.study_run_id == RecruiterIdentity.study_run_id)
        .where(RecruiterIdentity.sealed != "")
    )
    for run, content, wrapped in session.execute(query.execution_options(yield_per=AT_ONCE)):
        try:
            unseal(secret, run, Sealed(content, wrapped or ""))
        except UnreadableError:
            yield False
        else:
            yield True


def rewrap_all(session: Session, old_secret: bytes) -> tuple[int, int]:
    """Wrap again every key that was wrapped under `old_secret`.

    Return how many, and how many are under neither.
    """
    secret, done, left = session.info[SIGNING_KEY](), 0, 0
    for key in session.scalars(select(IdentityKey)):
        try:
            key.wrapped_key = rewrap(old_secret, secret, key.wrapped_key)
        # Already under the new secret, or under a third one.
        except UnreadableError:
            left += 1
        else:
            done += 1
    return done, left
