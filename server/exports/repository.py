"""What exports and seals read of the database, batch by batch."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from datetime import datetime
from functools import cache, partial
from typing import Any, NamedTuple

from sqlalchemy import Connection, CursorResult, Select, TextClause, bindparam, func, select, text, true
from sqlalchemy.orm import Session

from experiments.columns import View, names_of
from server.core.db import SIGNING_KEY
from server.exports.schemas import EVERYTHING, Extract
from server.models import (
    AuditEntry,
    FormAnswer,
    IdentityKey,
    Link,
    Rating,
    RecruiterIdentity,
    Study,
    StudyRun,
    StudyVersion,
)
from server.participation.identity_keys import ParticipantIdentity, Sealed, unseal

# What exports read of the database: a study's runs and all they stored, batch by batch.

RUNS_AT_ONCE = 100
RUNS_OF_ROWS_AT_ONCE, ROWS_AT_ONCE = 20, 8_000
IDENTITIES_AT_ONCE = 500
Runs = Sequence[tuple[int, str]]
Rows = Sequence[Sequence[Any]]


class KnownPerson(NamedTuple):
    """A visit whose person is known: to the recruiter, or by the label of a personal link."""

    run: str
    participant: str
    link_kind: str
    label: str
    known_as: ParticipantIdentity


def runs_by_origin(session: Session, study: Study) -> dict[str, int]:
    """How many runs there are of each exported origin."""
    query = select(StudyRun.origin, func.count()).where(EVERYTHING.condition(study))
    return dict(session.execute(query.group_by(StudyRun.origin)).all())


def run_count(session: Session, study: Study, extract: Extract) -> int:
    """Runs of this origin."""
    return session.scalar(select(func.count()).select_from(StudyRun).where(extract.condition(study))) or 0


def answered_versions(session: Session, study: Study, extract: Extract) -> Sequence[StudyVersion]:
    """The versions that these runs are of, newest first."""
    runs = select(StudyRun.version_id).where(extract.condition(study))
    query = select(StudyVersion).where(StudyVersion.id.in_(runs)).order_by(StudyVersion.number.desc())
    return session.scalars(query).all()


def first_start(session: Session, study: Study, extract: Extract) -> datetime | None:
    """When the first of these runs started; None where there are none."""
    return session.scalar(select(func.min(StudyRun.started_at)).where(extract.condition(study)))


def each_run(session: Session, study: Study, extract: Extract) -> Iterator[StudyRun]:
    """The runs of this extract, in the order they began; a batch of them is in memory at a time."""
    latest = 0
    while True:
        query = select(StudyRun).where(extract.condition(study), StudyRun.id > latest)
        runs = session.scalars(query.order_by(StudyRun.id).limit(RUNS_AT_ONCE)).all()
        if not runs:
            return
        latest = runs[-1].id
        yield from runs
        session.expunge_all()


def public_ids(session: Session, study: Study, extract: Extract) -> Sequence[str]:
    """The public ids of the runs of this extract, in the order they began."""
    query = select(StudyRun.public_id).where(extract.condition(study))
    return session.scalars(query.order_by(StudyRun.id)).all()


def answers_by_form(session: Session, run: StudyRun) -> dict[str, dict[str, Any]]:
    """Form -> its answers, of one run."""
    query = select(FormAnswer.form, FormAnswer.answers).where(FormAnswer.study_run_id == run.id)
    return dict(session.execute(query).all())


def play_count(session: Session, study: Study, extract: Extract, kind: str | None) -> int:
    """Stored plays of trials of this kind; None counts those of any, which an index holds."""
    query = select(func.count()).select_from(Rating).join(StudyRun, StudyRun.id == Rating.study_run_id)
    of_kind = true() if kind is None else Rating.kind == kind
    return session.scalar(query.where(extract.condition(study), of_kind)) or 0


def rows_in_view(session: Session, study: Study, extract: Extract, view: View) -> int:
    """Rows that a kind's view has of a study."""
    among: dict[str, str | int] = {"study": study.name}
    among |= {} if extract.origin == "all" else {"run_origin": extract.origin}
    among |= {} if extract.series is None else {"data_series": extract.series}
    condition = " AND ".join(f"{column} = :{column}" for column in among)
    rows = text(f"SELECT count(*) FROM {view.name} WHERE {condition}")  # noqa: S608
    return session.scalar(rows, among) or 0


def view_rows(session: Session, study: Study, extract: Extract, view: View) -> Iterator[Sequence[Any]]:
    """Rows of the view (values in the order of its names) by start of the run, then trial and play.

    Booleans are 0 and 1. The rows of some runs are in memory at a time and are sorted here: asked to sort
    them, PostgreSQL may read every run's trials for each run (1,800 rows a second of a million).
    """
    connection, of_runs, order = session.connection(), _rows_of_runs(view), _order(view)

    def read(runs: Runs) -> Rows:
        number = {public_id: index for index, (_, public_id) in enumerate(runs)}
        rows = plain_rows(connection.execute(of_runs, {"runs": list(number)}))
        return sorted(rows, key=partial(order, number))

    for rows in batches_of_runs(session, study, extract, read):
        yield from rows


def batches_of_runs(
    session: Session, study: Study, extract: Extract, read: Callable[[Runs], Rows]
) -> Iterator[Rows]:
    """The rows that `read` gives of some runs at a time (id and public id), by start of the run.

    They are about `ROWS_AT_ONCE` of at most `RUNS_OF_ROWS_AT_ONCE` runs, judged by the runs before.
    """
    latest, at_once = 0, 1
    while runs := _runs_after(session, study, extract, latest, at_once):
        latest = runs[-1][0]
        rows = read(runs)
        yield rows
        at_once = min(RUNS_OF_ROWS_AT_ONCE, max(1, ROWS_AT_ONCE * len(runs) // max(1, len(rows))))


@cache
def _order(view: View) -> Callable[[Mapping[str, int], Sequence[Any]], tuple[Any, ...]]:
    """By what a row is sorted, given the numbers of the runs: start of the run, trial, play, scale."""
    run, *index = (view.names.index(name) for name in ("run", "trial_index", "play") if name in view.names)
    scale = view.names.index("scale") if "scale" in view.names else None
    if scale is None:
        return lambda number, row: (number[row[run]], *[row[i] for i in index])
    return lambda number, row: (number[row[run]], *[row[i] for i in index], row[scale] or "")


@cache
def _rows_of_runs(view: View) -> TextClause:
    booleans = names_of(view.columns, "boolean")
    # PostgreSQL has true and false where the CSV and SQLite have 1 and 0.
    columns = ", ".join(f"CAST({name} AS INTEGER)" if name in booleans else name for name in view.names)
    rows = text(f"SELECT {columns} FROM {view.name} WHERE run IN :runs")  # noqa: S608
    return rows.bindparams(bindparam("runs", expanding=True))


def read_of_runs(connection: Connection, query: str) -> Callable[[Sequence[int]], Rows]:
    """What reads the rows of `query` for some runs, named by their ids."""
    statement = text(query).bindparams(bindparam("runs", expanding=True))
    return lambda runs: plain_rows(connection.execute(statement, {"runs": runs}))


def read_of_clips(connection: Connection, query: str) -> Callable[[Mapping[str, Any]], Rows]:
    """What reads the row of `query` for the clips that were shown, by the names of their ids."""
    statement = text(query)
    return lambda clips: plain_rows(connection.execute(statement, dict(clips)))


def plain_rows(result: CursorResult[Any]) -> Rows:
    """All rows as the driver gives them: SQLAlchemy's row objects would take a tenth of an export's time."""
    rows = result.cursor.fetchall()
    result.close()
    return rows


def _runs_after(session: Session, study: Study, extract: Extract, latest: int, at_once: int) -> Runs:
    query = select(StudyRun.id, StudyRun.public_id).where(extract.condition(study), StudyRun.id > latest)
    runs = session.execute(query.order_by(StudyRun.id).limit(at_once))
    return [(run, public_id) for run, public_id in runs]


def known_person_count(session: Session, study: Study) -> int:
    """How many visits `known_people` gives."""
    return session.scalar(_known_people(study).with_only_columns(func.count()).order_by(None)) or 0


def known_people(session: Session, study: Study) -> Iterator[KnownPerson]:
    """The visits whose person is known, in the order they began, read as they are asked for."""
    query = _known_people(study).execution_options(yield_per=IDENTITIES_AT_ONCE)
    secret = session.info[SIGNING_KEY]()
    for run, participant, kind, label, content, wrapped in session.execute(query):
        known = (
            unseal(secret, run, Sealed(content, wrapped)) if content and wrapped else ParticipantIdentity()
        )
        yield KnownPerson(run, participant, kind, label, known)


def _known_people(study: Study) -> Select[str, str, str, str, str | None, str | None]:
    columns = (
        StudyRun.public_id,
        StudyRun.participant,
        Link.kind,
        Link.label,
        RecruiterIdentity.sealed,
        IdentityKey.wrapped_key,
    )
    query = (
        select(*columns)
        .join(Link, Link.id == StudyRun.link_id)
        .outerjoin(RecruiterIdentity, RecruiterIdentity.study_run_id == StudyRun.id)
        .outerjoin(IdentityKey, IdentityKey.study_run_id == StudyRun.id)
        .where(StudyRun.study_id == study.id, StudyRun.origin != "preview", StudyRun.erased_at.is_(None))
    )
    named = (Link.kind == "personal") | IdentityKey.study_run_id.is_not(None)
    return query.where(named).order_by(StudyRun.id)


# What sealing asks of the database: who took part, and the seal in the audit log.


def people_of_series(session: Session, study: Study, series: int) -> int:
    """Runs of participants of this data series."""
    query = (
        select(func.count(StudyRun.id))
        .join(StudyVersion, StudyVersion.id == StudyRun.version_id)
        .where(StudyRun.study_id == study.id, StudyRun.origin == "participant", StudyVersion.series == series)
    )
    return session.scalar(query) or 0


def sealed_document(session: Session, study: str, series: int, action: str) -> dict[str, Any] | None:
    """The seal that the audit log keeps of this study's data series.

    A seal of a deleted study does not count for a later one with the same name.
    """
    of_study = (AuditEntry.target_kind == "study", AuditEntry.target == study)
    deleted = select(func.max(AuditEntry.id)).where(*of_study, AuditEntry.action == "study deleted")
    query = select(AuditEntry).where(
        *of_study, AuditEntry.action == action, AuditEntry.id > (session.scalar(deleted) or 0)
    )
    for entry in session.scalars(query.order_by(AuditEntry.id)):
        if entry.details.get("series") == series:
            return dict(entry.details["seal"])
    return None
