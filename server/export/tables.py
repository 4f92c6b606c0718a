"""The tables that exports are made of: answers (a row a play), runs (a row a visit), wide (a row a run)."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain, islice
from typing import Any, Literal

from sqlalchemy.orm import Session

from experiments.columns import Column
from experiments.columns.form_columns import form_columns, run_columns
from server.export.codebook import rating_columns
from server.export.extract import Extract
from server.export.pieces import rating_table, whole
from server.export.ratings_csv import rating_count, view_of
from server.export.repository import run_count
from server.export.runs import run_rows
from server.export.wide import wide_columns, wide_rows
from server.models import Study
from server.studies.lookup import all_definitions

TableName = Literal["answers", "runs", "wide"]
Row = Sequence[Any]


@dataclass(frozen=True)
class ExportTable:
    """A table on its way out.

    Attributes
    ----------
    name : str
        As files are called by it.
    columns : list of Column
        In order.
    rows : iterator of Row
        Without a header; taken once.
    count : int
        Of the rows, which `rows` is held to.
    """

    name: str
    columns: list[Column]
    rows: Iterator[Row]
    count: int

    def with_header(self) -> Iterator[Row]:
        """The names of the columns, then the rows."""
        return chain([[column.name for column in self.columns]], self.rows)


def answers_table(session: Session, study: Study, extract: Extract) -> ExportTable:
    """One row a play (or a scale and play), a column a factor."""
    columns = rating_columns(all_definitions(session, study))
    rows = islice(rating_table(session, study, extract), 1, None)
    name = view_of(session, study).name
    return ExportTable(name, columns, rows, rating_count(session, study, extract))


def runs_table(session: Session, study: Study, extract: Extract) -> ExportTable:
    """One row a visit, a column a question of the forms."""
    forms, number = form_columns(all_definitions(session, study)), run_count(session, study, extract)
    rows = whole(run_rows(session, study, extract, forms), number)
    return ExportTable("runs", run_columns(forms), rows, number)


def wide_table(session: Session, study: Study, extract: Extract) -> ExportTable:
    """One row a visit, a column a cell with the mean rating in it; InputError for trials without a scale."""
    definitions, number = all_definitions(session, study), run_count(session, study, extract)
    newest, forms = extract.definition(session, study), form_columns(definitions)
    rows = whole(wide_rows(session, study, extract, newest, forms), number)
    return ExportTable("wide", wide_columns(newest, forms), rows, number)


TABLES: dict[TableName, Callable[[Session, Study, Extract], ExportTable]] = {
    "answers": answers_table,
    "runs": runs_table,
    "wide": wide_table,
}
