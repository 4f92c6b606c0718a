"""The lines of the tidy CSV: what the rows of a run or of a clip share is read and written once.

The text is that of `View.csv_row` of every row of the view in a CSV writer's hands.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cache
from operator import itemgetter
from typing import Any

from sqlalchemy import Connection
from sqlalchemy.orm import Session

from experiments.columns import View
from experiments.columns.stretches import Stretch, Stretches
from experiments.columns.view import Dialect, levels_at, with_levels
from experiments.spreadsheet import csv_lines
from server.export import repository
from server.export.extract import Extract
from server.export.repository import Rows, Runs
from server.models import Study

CLIPS_KEPT = 20_000
_EMPTY = '""'
Part = Callable[[Rows], Iterable[str]]
"""The text of one stretch for each of some rows."""


def rating_lines(
    session: Session, study: Study, extract: Extract, view: View, factors: tuple[str, ...]
) -> Iterator[str]:
    """Lines of CSV without their ends, by start of the run, then trial, play and scale."""
    connection = session.connection()
    stretches = _stretches(view, "sqlite" if connection.dialect.name == "sqlite" else "postgresql")
    answers = repository.read_of_runs(connection, stretches.answers())
    order = itemgetter(*range(1 + len(stretches.order)))
    parts = list(_parts(connection, stretches, factors))

    def read(runs: Runs) -> Rows:
        return sorted(answers([run for run, _ in runs]), key=order)

    for rows in repository.batches_of_runs(session, study, extract, read):
        yield from map(",".join, zip(*(part(rows) for part in parts), strict=True))


@cache
def _stretches(view: View, dialect: Dialect) -> Stretches:
    return Stretches(view, dialect)


def _parts(connection: Connection, stretches: Stretches, factors: tuple[str, ...]) -> Iterator[Part]:
    slices = stretches.slices()
    for stretch in stretches.all:
        if stretch.of_run:
            yield _RunPart(connection, stretches, stretch, factors)
        elif stretch.clips:
            yield _ClipPart(connection, stretches, stretch, factors)
        else:
            yield _AnswerPart(next(slices), stretch, factors)


class _AnswerPart:
    """Text that is another one in every row."""

    def __init__(self, cells: slice, stretch: Stretch, factors: tuple[str, ...]) -> None:
        self._cells, self._factors = itemgetter(cells), factors
        self._levels = levels_at(stretch.columns)

    def __call__(self, rows: Rows) -> Iterable[str]:
        cells: Iterable[Sequence[Any]] = map(self._cells, rows)
        if self._levels is not None:
            cells = (with_levels(row, self._levels, self._factors) for row in cells)
        return csv_texts(cells)


class _RunPart:
    """Text that is the same in all rows of a run."""

    def __init__(
        self, connection: Connection, stretches: Stretches, stretch: Stretch, factors: tuple[str, ...]
    ) -> None:
        self._read = repository.read_of_runs(connection, stretches.runs(stretch))
        self._levels, self._factors = levels_at(stretch.columns), factors

    def __call__(self, rows: Rows) -> Iterable[str]:
        runs = [row[0] for row in rows]
        text_of = {
            run: _text(with_levels(cells, self._levels, self._factors))
            for run, *cells in self._read(list(set(runs)))
        }
        return map(text_of.__getitem__, runs)


class _ClipPart(dict[Any, str]):
    """Text that is the same wherever the same clips were shown, by their ids."""

    def __init__(
        self, connection: Connection, stretches: Stretches, stretch: Stretch, factors: tuple[str, ...]
    ) -> None:
        super().__init__()
        self._read = repository.read_of_clips(connection, stretches.shown(stretch))
        self._levels, self._factors, self._clips = levels_at(stretch.columns), factors, stretch.clips
        self._ids = itemgetter(*map(stretches.clip_at, stretch.clips))

    def __call__(self, rows: Rows) -> Iterable[str]:
        return map(self.__getitem__, map(self._ids, rows))

    def __missing__(self, ids: Any) -> str:
        if len(self) >= CLIPS_KEPT:
            self.clear()
        shown = dict(zip(self._clips, ids if isinstance(ids, tuple) else (ids,), strict=True))
        (cells,) = self._read(shown)
        self[ids] = _text(with_levels(cells, self._levels, self._factors))
        return self[ids]


def _text(cells: Iterable[Any]) -> str:
    return csv_texts([cells])[0]


def csv_texts(rows: Iterable[Iterable[Any]]) -> list[str]:
    """Each row as CSV, to be put beside others, so without the line's end.

    A line of one empty cell has quotes, which part of a line has not.
    """
    return ["" if line == _EMPTY else line for line in csv_lines(rows)]
