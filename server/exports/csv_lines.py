"""Tables as pieces of CSV bytes and zips, so that a download of any length takes constant memory."""

import io
import zipfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cache
from itertools import islice
from operator import itemgetter
from typing import Any, TypeVar

from sqlalchemy import Connection
from sqlalchemy.orm import Session

from experiments.columns import View
from experiments.columns.view import Dialect, Stretch, Stretches, levels_at, with_levels
from experiments.errors import InputError
from experiments.kinds import KINDS
from server.core.values import encode_text
from server.exports import repository
from server.exports.repository import Rows, Runs
from server.exports.schemas import Extract
from server.models import Study
from server.studies.lookup import active_definition, all_definitions
from table_files.formulas import csv_lines, csv_text

# The lines of the tidy CSV: what the rows of a run or of a clip share is read and written once.
#
# The text is that of `View.csv_row` of every row of the view in a CSV writer's hands.

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
    """Each row as CSV, to be joined with others, so without the line's end.

    A line of one empty cell has quotes, which part of a line has not.
    """
    return ["" if line == _EMPTY else line for line in csv_lines(rows)]


# The tidy CSV: the rows of the view of the study's kind of trial, run after run, in constant memory.


def view_of(session: Session, study: Study, extract: Extract) -> View:
    """The view that holds the answers of the study's kind of trial, as its version in use declares it."""
    view = KINDS[active_definition(session, study).trial.kind].view
    return view.in_old_order() if extract.old_order else view


def factor_names(session: Session, study: Study) -> tuple[str, ...]:
    """Factors of all versions of a study, in declared order."""
    definitions = all_definitions(session, study)
    return tuple(dict.fromkeys(factor.name for one in definitions for factor in one.factors))


def rating_count(session: Session, study: Study, extract: Extract) -> int:
    """Rows that `rating_rows` gives."""
    trials = [one.trial for one in all_definitions(session, study)]
    if any(len(trial.rated_scales()) > 1 for trial in trials):
        # A rating is one row per scale.
        return repository.rows_in_view(session, study, extract, view_of(session, study, extract))
    kind = active_definition(session, study).trial.kind
    of_one_kind = all(trial.kind == kind for trial in trials)
    return repository.play_count(session, study, extract, None if of_one_kind else kind)


def rating_rows(session: Session, study: Study, extract: Extract) -> Iterator[Sequence[Any]]:
    """Rows of the study's view; see `repository.view_rows`."""
    return repository.view_rows(session, study, extract, view_of(session, study, extract))


# Tables as pieces of CSV bytes, so that a download of any length takes constant memory.

ROWS_A_PIECE = 500
Row = TypeVar("Row")


class ExportBrokenOff(InputError):
    """An export holds another number of rows than the study had when it began."""


def check_whole(rows: Iterable[Row], expected: int, extra: int = 0) -> Iterator[Row]:
    """`rows` as they come; ExportBrokenOff at the end where they are not `expected` + `extra`."""
    number = -extra
    for row in rows:
        number += 1
        yield row
    if number != expected:
        raise ExportBrokenOff(f"the export failed: expected {expected} rows, got {number}; try again")


def csv_pieces(rows: Iterable[Sequence[Any]]) -> Iterator[bytes]:
    """Rows as CSV in UTF-8, some hundred rows a piece."""
    remaining = iter(rows)
    while batch := list(islice(remaining, ROWS_A_PIECE)):
        yield encode_text(csv_text(batch))


def rating_pieces(session: Session, study: Study, extract: Extract) -> Iterator[bytes]:
    """Header and lines of the tidy CSV, some hundred lines a piece."""
    factors, view = factor_names(session, study), view_of(session, study, extract)
    yield from csv_pieces([view.csv_header(factors)])
    lines = check_whole(
        rating_lines(session, study, extract, view, factors), rating_count(session, study, extract)
    )
    while batch := list(islice(lines, ROWS_A_PIECE)):
        yield encode_text("\n".join((*batch, "")))


def rating_table(session: Session, study: Study, extract: Extract) -> Iterator[Sequence[Any]]:
    """Header and rows of the tidy CSV."""
    factors, view = factor_names(session, study), view_of(session, study, extract)
    yield view.csv_header(factors)
    rows = (view.csv_row(row, factors) for row in rating_rows(session, study, extract))
    yield from check_whole(rows, rating_count(session, study, extract))


# A zip on its way out: written member by member, taken piece by piece, in constant memory.


class _Sink(io.RawIOBase):
    """What the zip writer writes to; `take` hands on what has come since."""

    def __init__(self) -> None:
        self._pieces: list[bytes] = []

    def writable(self) -> bool:
        """True: this stream only takes."""
        return True

    def write(self, piece: Any) -> int:
        """Keep a piece until it is taken."""
        self._pieces.append(bytes(piece))
        return len(piece)

    def take(self) -> bytes:
        """Everything written since the last call."""
        taken = b"".join(self._pieces)
        self._pieces.clear()
        return taken


def zip_pieces(members: Iterable[tuple[str, Iterable[bytes]]]) -> Iterator[bytes]:
    """The pieces of a zip of these members: each its path and its bytes."""
    sink = _Sink()
    with zipfile.ZipFile(sink, "w", zipfile.ZIP_DEFLATED) as archive:
        for path, pieces in members:
            with archive.open(path, "w", force_zip64=True) as member:
                for piece in pieces:
                    member.write(piece)
                    yield sink.take()
            yield sink.take()
    yield sink.take()
