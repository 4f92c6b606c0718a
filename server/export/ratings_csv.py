"""The tidy CSV: the rows of the view of the study's kind of trial, run after run, in constant memory."""

from collections.abc import Iterator, Sequence
from functools import cache
from typing import Any

from sqlalchemy import CursorResult, TextClause, func, select, text
from sqlalchemy.orm import Session

from experiments.columns import View, names_of
from experiments.trials import KINDS
from server.export.origins import ExportOrigin, of_origin
from server.models import Rating, Study, StudyRun, StudyVersion
from server.studies.lookup import active_definition, all_definitions

RUNS_AT_ONCE = 200


@cache
def _rows_of_a_run(view: View) -> TextClause:
    booleans = names_of(view.columns, "boolean")
    # PostgreSQL has true and false where the CSV and SQLite have 1 and 0.
    columns = ", ".join(f"CAST({name} AS INTEGER)" if name in booleans else name for name in view.names)
    order = ", ".join(name for name in ("trial_index", "play", "scale") if name in view.names)
    return text(f"SELECT {columns} FROM {view.name} WHERE run = :run ORDER BY {order}")  # noqa: S608


def view_of(session: Session, study: Study) -> View:
    """The view that holds the answers of the study's kind of trial, as its version in use declares it."""
    return KINDS[active_definition(session, study).trial.kind].view


def factor_names(session: Session, study: Study) -> tuple[str, ...]:
    """Factors of all versions of a study, in declared order."""
    query = select(StudyVersion.definition).where(StudyVersion.study_id == study.id)
    names: dict[str, None] = {}
    for definition in session.scalars(query.order_by(StudyVersion.number)):
        names.update(dict.fromkeys(factor["name"] for factor in definition["factors"]))
    return tuple(names)


def rating_count(session: Session, study: Study, origin: ExportOrigin) -> int:
    """Rows that `rating_rows` gives."""
    kind = active_definition(session, study).trial.kind
    if any(len(one.trial.rated_scales()) > 1 for one in all_definitions(session, study)):
        return _rows_in_view(session, study, origin)  # a rating is a row a scale
    query = select(func.count()).select_from(Rating).join(StudyRun, StudyRun.id == Rating.study_run_id)
    query = query.where(of_origin(study, origin), Rating.kind == kind)
    return session.scalar(query) or 0


def _rows_in_view(session: Session, study: Study, origin: ExportOrigin) -> int:
    view = view_of(session, study)
    among = "" if origin == "all" else " AND run_origin = :origin"
    rows = text(f"SELECT count(*) FROM {view.name} WHERE study = :study{among}")  # noqa: S608
    values = {"study": study.name} if origin == "all" else {"study": study.name, "origin": origin}
    return session.scalar(rows, values) or 0


def rating_rows(session: Session, study: Study, origin: ExportOrigin) -> Iterator[Sequence[Any]]:
    """Rows of the view (values in the order of its names) by start of the run, then trial and play.

    Booleans are 0 and 1. One run's rows are in memory at a time.
    """
    connection, latest = session.connection(), 0
    of_a_run = _rows_of_a_run(view_of(session, study))
    while runs := _runs_after(session, study, origin, latest):
        latest = runs[-1].id
        for run in runs:
            yield from _plain_rows(connection.execute(of_a_run, {"run": run.public_id}))


def _plain_rows(result: CursorResult[Any]) -> Sequence[Any]:
    """All rows as the driver gives them: SQLAlchemy's row objects would take a tenth of an export's time."""
    rows = result.cursor.fetchall()
    result.close()
    return rows


def _runs_after(session: Session, study: Study, origin: ExportOrigin, latest: int) -> Sequence[Any]:
    query = select(StudyRun.id, StudyRun.public_id).where(of_origin(study, origin), StudyRun.id > latest)
    return session.execute(query.order_by(StudyRun.id).limit(RUNS_AT_ONCE)).all()
