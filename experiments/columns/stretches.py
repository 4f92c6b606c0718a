"""A view's columns by what they change with: an export reads and writes once what many rows share.

Which columns these are is read from their SQL: what names the run's tables alone is the same in all rows of a
run, what names clips alone is the same wherever the same clips are shown. Everything else is of the answer.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import groupby

from experiments.columns.column import Column
from experiments.columns.tables import CLIP_TABLE, RUN_ALIASES, RUN_JOINS
from experiments.columns.view import Dialect, View, spelled

_ALIAS = re.compile(r"\b([a-z_]+)\.(?=[a-z_])")
_OF_THE_RUN = tuple(sorted(RUN_ALIASES))
_ORDER = ("trial_index", "play", "scale")


@dataclass(frozen=True)
class Stretch:
    """Neighbouring columns that change together.

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
        """Whether every row may have other values."""
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
        named = frozenset(_ALIAS.findall(spelled(column, self.dialect)))
        if named and named <= RUN_ALIASES:
            return _OF_THE_RUN
        return tuple(sorted(named)) if named <= clips else ()

    @cached_property
    def order(self) -> tuple[str, ...]:
        """SQL of what the rows of a run are sorted by."""
        return tuple(
            f"coalesce({spelled(column, self.dialect)}, '')"
            if column.type == "text"
            else spelled(column, self.dialect)
            for name in _ORDER
            if name in self.view.names
            for column in self.view.pick(name)
        )

    def answers(self) -> str:
        """Rows of some runs: the run, what they are sorted by, the clips' ids, then the answer's cells."""
        cells = [cell for one in self.all if one.of_answer for cell in self._cells(one)]
        first = ("r.id", *self.order, *(f"{alias}.id" for alias in self.clips))
        return f"SELECT {', '.join((*first, *cells))}\n{self.view.rows_in(self.dialect)} AND r.id IN :runs"

    def slices(self) -> Iterator[slice]:
        """Where the cells of each of the answer's stretches stand in a row of `answers`."""
        begin = 1 + len(self.order) + len(self.clips)
        for one in self.all:
            if one.of_answer:
                yield slice(begin, begin + len(one.columns))
                begin += len(one.columns)

    def clip_at(self, alias: str) -> int:
        """Where a clip's id stands in a row of `answers`."""
        return 1 + len(self.order) + self.clips.index(alias)

    def runs(self, stretch: Stretch) -> str:
        """Ids of some runs, and the cells of a stretch that is of the run."""
        cells = ", ".join(("r.id", *self._cells(stretch)))
        return f"SELECT {cells} FROM study_runs r\n{RUN_JOINS}WHERE r.id IN :runs"  # noqa: S608

    def shown(self, stretch: Stretch) -> str:
        """The cells of a stretch that is of clips; each alias is a parameter, NULL where there is no clip."""
        joins = " ".join(f"LEFT JOIN {CLIP_TABLE} {clip} ON {clip}.id = :{clip}" for clip in stretch.clips)
        return f"SELECT {', '.join(self._cells(stretch))} FROM (SELECT 1 AS one) o {joins}"  # noqa: S608

    def _cells(self, stretch: Stretch) -> Iterator[str]:
        for column in stretch.columns:
            sql = spelled(column, self.dialect)
            # PostgreSQL has true and false where the CSV and SQLite have 1 and 0.
            yield f"CAST({sql} AS INTEGER)" if column.type == "boolean" else sql
