"""A view: the columns of one kind of trial's rows, the SQL that selects them, and their place in a CSV."""

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, Literal

from experiments.columns.base import LEVELS
from experiments.columns.column import JOINED, Column, ColumnType, names_of

Dialect = Literal["sqlite", "postgresql"]

_TIME: dict[Dialect, str] = {
    "sqlite": "replace({}, ' ', 'T') || 'Z'",
    "postgresql": """to_char({} AT TIME ZONE 'UTC', 'YYYY-MM-DD"T"HH24:MI:SS.US"Z"')""",
}
_JSON: dict[Dialect, str] = {"sqlite": "{}", "postgresql": "CAST({} AS text)"}
_JOIN: dict[Dialect, str] = {"sqlite": "group_concat", "postgresql": "string_agg"}
_CAST: dict[ColumnType, str] = {"integer": "integer", "number": "numeric", "boolean": "boolean"}


@dataclass(frozen=True)
class View:
    """A SQL view and the CSV export made from it.

    Attributes
    ----------
    name : str
        Of the view in the database.
    title : str
        What one row is, as a heading of the codebook says it.
    columns : tuple of Column
        In order. One of them may be `LEVELS`: the CSV has a column a factor in its place.
    rows : str or callable
        The SQL after SELECT: tables, joins, and which rows count; by database where they differ.
    """

    name: str
    title: str
    columns: tuple[Column, ...]
    rows: str | Callable[[Dialect], str]

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Column names in order."""
        return names_of(self.columns)

    def pick(self, *names: str) -> tuple[Column, ...]:
        """The columns called so; KeyError for a name that is no column."""
        by_name = {column.name: column for column in self.columns}
        return tuple(by_name[name] for name in names)

    def create(self, dialect: Dialect) -> str:
        """The statement that makes the view; a migration keeps a copy of it as it was then."""
        selected = ",\n       ".join(
            f"{spelled(column, dialect)} AS {column.name}" for column in self.columns
        )
        return f"CREATE VIEW {self.name} AS\nSELECT {selected}\n{self.rows_in(dialect)}"

    def rows_in(self, dialect: Dialect) -> str:
        """The SQL after SELECT, in the words of one database; it ends in the conditions."""
        return self.rows if isinstance(self.rows, str) else self.rows(dialect)

    def csv_header(self, factors: Sequence[str]) -> list[str]:
        """Column names of the CSV export: as the view, with a column a factor in the place of `levels`."""
        header: list[str] = []
        for name in self.names:
            header.extend(factors if name == LEVELS.name else [name])
        return header

    def csv_row(self, row: Sequence[Any], factors: tuple[str, ...]) -> tuple[Any, ...]:
        """One row of the view (values in column order, booleans as 0 and 1) as CSV cells.

        What is missing stays None, which a CSV writer leaves empty.
        """
        return with_levels(row, self._levels_at, factors)

    @cached_property
    def _levels_at(self) -> int | None:
        return levels_at(self.columns)

    def factors_in_header(self, header: Iterable[str]) -> list[str]:
        """The factor columns of a CSV export: every column the view does not name, in order."""
        return [name for name in header if name not in self.names]


def levels_at(columns: Iterable[Column]) -> int | None:
    """Which of these columns `LEVELS` is; None where it is none of them."""
    return next((index for index, column in enumerate(columns) if column.name == LEVELS.name), None)


def with_levels(row: Sequence[Any], index: int | None, factors: tuple[str, ...]) -> tuple[Any, ...]:
    """The cells with one a factor in the place of the levels, which stand at `index`."""
    if index is None:
        return tuple(row)
    return (*row[:index], *_level_cells(row[index], factors), *row[index + 1 :])


def spelled(column: Column, dialect: Dialect) -> str:
    """The SQL behind a column in the words of one database, as the view selects it."""
    if column.member:
        member = _member(column, dialect)
        return f"coalesce({member}, {column.otherwise})" if column.otherwise else member
    if column.type == "time":
        return _TIME[dialect].format(column.expression)
    if column.json:
        return _JSON[dialect].format(column.expression)
    return column.expression.replace(JOINED, _JOIN[dialect])


def _member(column: Column, dialect: Dialect) -> str:
    """The value at a path of a JSON object; SQLite types it by itself, PostgreSQL is told its type."""
    if dialect == "sqlite":
        return f"json_extract({column.source}, '$.{column.member}')"
    *outer, last = column.member.split(".")
    path = "".join(f" -> '{name}'" for name in outer)
    value = f"{column.source}{path} ->> '{last}'"
    return f"CAST({value} AS {_CAST[column.type]})" if column.type in _CAST else value


# A study has few cells but many rows: their JSON is parsed once each.
@lru_cache(maxsize=4096)
def _level_cells(levels: str | None, factors: tuple[str, ...]) -> tuple[str, ...]:
    level_of: Mapping[str, str] = json.loads(levels) if levels else {}
    return tuple(level_of.get(factor, "") for factor in factors)
