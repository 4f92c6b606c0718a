"""The tidy CSV: the rows of the view `ratings`, one run after another, in constant memory."""

import csv
from collections.abc import Iterator, Sequence
from typing import Any, TextIO

from sqlalchemy import select, text
from sqlalchemy.orm import Session

from experiments.ratings import COLUMN_NAMES, csv_header, csv_row
from server.models import Study, StudyRun, StudyVersion

_ROWS = text(f"SELECT {', '.join(COLUMN_NAMES)} FROM ratings WHERE run = :run ORDER BY trial_index, play")  # noqa: S608
RUNS_AT_ONCE = 200


def factor_names(session: Session, study: Study) -> tuple[str, ...]:
    """Factors of all versions of a study, in declared order."""
    query = select(StudyVersion.definition).where(StudyVersion.study_id == study.id)
    names: dict[str, None] = {}
    for definition in session.scalars(query.order_by(StudyVersion.number)):
        names.update(dict.fromkeys(factor["name"] for factor in definition["factors"]))
    return tuple(names)


def rating_rows(session: Session, study: Study) -> Iterator[Sequence[Any]]:
    """Rows of the view (values in the order of COLUMN_NAMES) by start of the run, then trial and play.

    One run's rows are in memory at a time.
    """
    connection, latest = session.connection(), 0
    while runs := _runs_after(session, study, latest):
        latest = runs[-1].id
        for run in runs:
            yield from connection.execute(_ROWS, {"run": run.public_id}).all()


def write_ratings_csv(session: Session, study: Study, stream: TextIO) -> int:
    """Write header and rows; return the number of rows."""
    factors = factor_names(session, study)
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(csv_header(factors))
    count = 0
    for row in rating_rows(session, study):
        writer.writerow(csv_row(row, factors))
        count += 1
    return count


def _runs_after(session: Session, study: Study, latest: int) -> Sequence[Any]:
    query = select(StudyRun.id, StudyRun.public_id).where(
        StudyRun.study_id == study.id, StudyRun.id > latest, StudyRun.preview.is_(False)
    )
    return session.execute(query.order_by(StudyRun.id).limit(RUNS_AT_ONCE)).all()
