"""Tables as pieces of CSV bytes, so that a download of any length takes constant memory."""

from collections.abc import Iterable, Iterator, Sequence
from itertools import islice
from typing import Any, TypeVar

from sqlalchemy.orm import Session

from experiments.errors import InputError
from experiments.spreadsheet import csv_text
from server.export.extract import Extract
from server.export.rating_lines import rating_lines
from server.export.ratings_csv import factor_names, rating_count, rating_rows, view_of
from server.models import Study
from server.text import encoded

ROWS_A_PIECE = 500
Row = TypeVar("Row")


class ExportBrokenOff(InputError):
    """An export holds another number of rows than the study had when it began."""


def whole(rows: Iterable[Row], expected: int, extra: int = 0) -> Iterator[Row]:
    """`rows` as they come; ExportBrokenOff at the end where they are not `expected` + `extra`."""
    number = -extra
    for row in rows:
        number += 1
        yield row
    if number != expected:
        raise ExportBrokenOff(f"the export broke off: expected {expected} rows, got {number}; try it again")


def csv_pieces(rows: Iterable[Sequence[Any]]) -> Iterator[bytes]:
    """Rows as CSV in UTF-8, some hundred rows a piece."""
    remaining = iter(rows)
    while batch := list(islice(remaining, ROWS_A_PIECE)):
        yield encoded(csv_text(batch))


def rating_pieces(session: Session, study: Study, extract: Extract) -> Iterator[bytes]:
    """Header and lines of the tidy CSV, some hundred lines a piece."""
    factors, view = factor_names(session, study), view_of(session, study)
    yield from csv_pieces([view.csv_header(factors)])
    lines = whole(rating_lines(session, study, extract, view, factors), rating_count(session, study, extract))
    while batch := list(islice(lines, ROWS_A_PIECE)):
        yield encoded("\n".join((*batch, "")))


def rating_table(session: Session, study: Study, extract: Extract) -> Iterator[Sequence[Any]]:
    """Header and rows of the tidy CSV."""
    factors, view = factor_names(session, study), view_of(session, study)
    yield view.csv_header(factors)
    rows = (view.csv_row(row, factors) for row in rating_rows(session, study, extract))
    yield from whole(rows, rating_count(session, study, extract))
