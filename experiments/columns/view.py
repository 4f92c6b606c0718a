"""A view: the columns of one kind of trial's rows, the SQL that selects them, and their place in a CSV."""

import json
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import groupby
from typing import Any, Literal

from experiments.columns.base import CLIP_TABLE, LEVELS, RUN_ALIASES, RUN_JOINS
from experiments.columns.column import JOINED, Column, ColumnType, in_old_order, names_of

Dialect = Literal["sqlite", "postgresql"]
MADE_FROM = "made from the columns in experiments"
"""Part of the text of every view, so that an upgrade recognizes views of removed kinds."""

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
        What one row is, as in the heading of the codebook.
    columns : tuple of Column
        In order. One of them may be `LEVELS`, which the CSV replaces with one column per factor.
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
        """The columns with these names; KeyError if a name is not a column."""
        by_name = {column.name: column for column in self.columns}
        return tuple(by_name[name] for name in names)

    def create(self, dialect: Dialect) -> str:
        """The statement that makes the view, as every upgrade runs it."""
        selected = ",\n       ".join(
            f"{column_sql(column, dialect)} AS {column.name}" for column in self.columns
        )
        return f"CREATE VIEW {self.name} AS\n-- {MADE_FROM}\nSELECT {selected}\n{self.rows_in(dialect)}"

    def in_old_order(self) -> "View":
        """The same view with its columns in the order used until 0.2."""
        return replace(self, columns=in_old_order(self.name, self.columns))

    def rows_in(self, dialect: Dialect) -> str:
        """The SQL after SELECT, in the dialect of one database; it ends in the conditions."""
        return self.rows if isinstance(self.rows, str) else self.rows(dialect)

    def csv_header(self, factors: Sequence[str]) -> list[str]:
        """Column names of the CSV export: like the view, with one column per factor instead of `levels`."""
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
        """The factor columns of a CSV export: every column that the view does not name, in order."""
        return [name for name in header if name not in self.names]


def levels_at(columns: Iterable[Column]) -> int | None:
    """Index of `LEVELS` in these columns; None if it is not one of them."""
    return next((index for index, column in enumerate(columns) if column.name == LEVELS.name), None)


# Decision 0002: Factors are one JSON column in SQL and one column each in CSV.
def with_levels(row: Sequence[Any], index: int | None, factors: tuple[str, ...]) -> tuple[Any, ...]:
    """The cells with one cell per factor instead of the levels at `index`."""
    if index is None:
        return tuple(row)
    return (*row[:index], *_level_cells(row[index], factors), *row[index + 1 :])


def column_sql(column: Column, dialect: Dialect) -> str:
    """The SQL behind a column in the dialect of one database, as the view selects it."""
    if column.member:
        member = _member(column, dialect)
        return f"coalesce({member}, {column.otherwise})" if column.otherwise else member
    if column.type == "time":
        return _TIME[dialect].format(column.expression)
    if column.json:
        return _JSON[dialect].format(column.expression)
    return column.expression.replace(JOINED, _JOIN[dialect])


def _member(column: Column, dialect: Dialect) -> str:
    """The value at a path of a JSON object; SQLite infers its type, PostgreSQL needs a cast."""
    if dialect == "sqlite":
        return f"json_extract({column.source}, '$.{column.member}')"
    *outer, last = column.member.split(".")
    path = "".join(f" -> '{name}'" for name in outer)
    value = f"{column.source}{path} ->> '{last}'"
    return f"CAST({value} AS {_CAST[column.type]})" if column.type in _CAST else value


# A study has few cells but many rows: the JSON of each cell is parsed once.
@lru_cache(maxsize=4096)
def _level_cells(levels: str | None, factors: tuple[str, ...]) -> tuple[str, ...]:
    level_of: Mapping[str, str] = json.loads(levels) if levels else {}
    return tuple(level_of.get(factor, "") for factor in factors)


# A view's columns by what they change with: an export reads and writes once what many rows share.
#
# Which columns these are is read from their SQL: what names the run's tables alone is the same in all rows
# of a run, what names clips alone is the same wherever the same clips are shown. Everything else is of the
# answer.

_ALIAS = re.compile(r"\b([a-z_]+)\.(?=[a-z_])")
_OF_THE_RUN = tuple(sorted(RUN_ALIASES))
_ORDER = ("trial_index", "play", "scale")


@dataclass(frozen=True)
class Stretch:
    """Neighboring columns that change together.

    Attributes
    ----------
    columns : tuple of Column
        In the view's order.
    clips : tuple of str
        Aliases of the clips they are of; empty where they are of no clip.
    of_run : bool
        Whether they are of the run; what is neither of a run nor of clips is of the answer.
    """

    columns: tuple[Column, ...]
    clips: tuple[str, ...]
    of_run: bool

    @property
    def of_answer(self) -> bool:
        """Whether the values can differ in every row."""
        return not self.of_run and not self.clips


@dataclass(frozen=True)
class Stretches:
    """A view cut into stretches, and the SQL that reads each kind of them in one database."""

    view: View
    dialect: Dialect

    @cached_property
    def all(self) -> tuple[Stretch, ...]:
        """The stretches in the order of the view's columns."""
        clips = frozenset(self.clips)
        return tuple(
            Stretch(tuple(columns), () if of == _OF_THE_RUN else of, of == _OF_THE_RUN)
            for of, columns in groupby(self.view.columns, key=lambda column: self._of(column, clips))
        )

    @cached_property
    def clips(self) -> tuple[str, ...]:
        """Aliases under which the view's rows have clips."""
        return tuple(re.findall(rf"\b{CLIP_TABLE} (\w+)", self.view.rows_in(self.dialect)))

    def _of(self, column: Column, clips: frozenset[str]) -> tuple[str, ...]:
        named = frozenset(_ALIAS.findall(column_sql(column, self.dialect)))
        if named and named <= RUN_ALIASES:
            return _OF_THE_RUN
        return tuple(sorted(named)) if named <= clips else ()

    @cached_property
    def order(self) -> tuple[str, ...]:
        """SQL of what the rows of a run are sorted by."""
        return tuple(
            f"coalesce({column_sql(column, self.dialect)}, '')"
            if column.type == "text"
            else column_sql(column, self.dialect)
            for name in _ORDER
            if name in self.view.names
            for column in self.view.pick(name)
        )

    def answers(self) -> str:
        """Rows of some runs: the run, the sort keys, the IDs of the clips, then the cells of the answer."""
        cells = [cell for one in self.all if one.of_answer for cell in self._cells(one)]
        first = ("r.id", *self.order, *(f"{alias}.id" for alias in self.clips))
        return f"SELECT {', '.join((*first, *cells))}\n{self.view.rows_in(self.dialect)} AND r.id IN :runs"

    def slices(self) -> Iterator[slice]:
        """Positions of the cells of each answer stretch in a row of `answers`."""
        begin = 1 + len(self.order) + len(self.clips)
        for one in self.all:
            if one.of_answer:
                yield slice(begin, begin + len(one.columns))
                begin += len(one.columns)

    def clip_at(self, alias: str) -> int:
        """Position of a clip's ID in a row of `answers`."""
        return 1 + len(self.order) + self.clips.index(alias)

    def runs(self, stretch: Stretch) -> str:
        """IDs of some runs, and the cells of a stretch that depends on the run."""
        cells = ", ".join(("r.id", *self._cells(stretch)))
        return f"SELECT {cells} FROM study_runs r\n{RUN_JOINS}WHERE r.id IN :runs"  # noqa: S608

    def shown(self, stretch: Stretch) -> str:
        """The cells of a stretch that depends on clips; each alias is a parameter, NULL without a clip."""
        joins = " ".join(f"LEFT JOIN {CLIP_TABLE} {clip} ON {clip}.id = :{clip}" for clip in stretch.clips)
        return f"SELECT {', '.join(self._cells(stretch))} FROM (SELECT 1 AS one) o {joins}"  # noqa: S608

    def _cells(self, stretch: Stretch) -> Iterator[str]:
        for column in stretch.columns:
            sql = column_sql(column, self.dialect)
            # PostgreSQL has true and false where the CSV and SQLite have 1 and 0.
            yield f"CAST({sql} AS INTEGER)" if column.type == "boolean" else sql
