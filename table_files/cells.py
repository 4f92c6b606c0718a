"""What every reader of a file gives: a header and cells of text."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import date, datetime, time
from numbers import Integral, Real
from typing import TYPE_CHECKING, Any

from table_files.formulas import unguarded_cell

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd
    from numpy.typing import NDArray

# The text of a value, as a person would type it; free of pandas, for readers in a new process.


def cell_text(value: Any) -> str:
    """A value of a sheet as a person would type it: whole numbers without a point, days as 2026-11-22."""
    if value is None or value != value:  # NaN, and pandas' time that is none
        return ""
    if isinstance(value, bool):
        return str(value)
    if isinstance(value, Real) and not isinstance(value, Integral):  # numpy's floats are such too
        number = float(value)
        return str(int(number)) if number.is_integer() and abs(number) < 1e15 else repr(number)
    if isinstance(value, datetime):
        return value.date().isoformat() if value.time() == time() else value.isoformat(" ")
    return value.isoformat() if isinstance(value, date | time) else str(value)


@dataclass(frozen=True)
class Cells:
    """The columns asked for as text.

    Attributes
    ----------
    rows : DataFrame
        Columns of text, named; the index counts rows from 0.
    header : tuple of str
        Names of all columns of the file.
    lines : int64 array
        Line (or row of the sheet) of each row, (rows,).
    labels : mapping of str to mapping of str to str
        Of a column, the word for each coded value, where the file has such words (SPSS).
    numeric : frozenset of str
        Columns whose every cell is a number to the program that wrote the file, and no text like one.
    decisions : tuple of str
        What was understood, for the reader of the tables.
    files : array of str or None
        Name of the file of each row, (rows,), if there are several.
    """

    rows: "pd.DataFrame"
    header: tuple[str, ...]
    lines: "NDArray[np.int64]" = field(repr=False)
    labels: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    numeric: frozenset[str] = frozenset()
    decisions: tuple[str, ...] = ()
    files: "NDArray[np.str_] | None" = field(default=None, repr=False)

    def of_rows(self, keep: "NDArray[np.bool_]") -> "Cells":
        """The rows to `keep` (rows,) alone."""
        files = None if self.files is None else self.files[keep]
        rows = self.rows[keep].reset_index(drop=True)
        return replace(self, rows=rows, lines=self.lines[keep], files=files)


def cells_of(
    header: list[str], rows: list[list[Any]], names: list[str], first_line: int, **more: Any
) -> Cells:
    """Cells of rows of values; rows without any value are left out, as blank lines of CSV are."""
    import numpy as np
    import pandas as pd

    texts = [[cell_text(value) for value in row] for row in rows]
    filled = [i for i, row in enumerate(texts) if any(row)]
    positions = [header.index(name) for name in names]
    columns = {name: [texts[i][p] for i in filled] for name, p in zip(names, positions, strict=True)}
    lines = np.array(filled, dtype=np.int64) + first_line
    numeric = frozenset(
        name for name, p in zip(names, positions, strict=True) if all(_is_number(rows[i][p]) for i in filled)
    )
    return Cells(pd.DataFrame(columns, dtype=str), tuple(header), lines, numeric=numeric, **more)


def _is_number(value: Any) -> bool:
    """Whether a cell is a number, or empty."""
    return value is None or (isinstance(value, Real) and not isinstance(value, bool))


def text_cells(
    rows: Sequence[tuple[str, ...]],
    lines: Sequence[int],
    names: list[str],
    header: tuple[str, ...],
    decisions: tuple[str, ...],
) -> Cells:
    """Cells of rows of text, as they were before a writer guarded them against being run as formulas."""
    import numpy as np
    import pandas as pd

    columns = zip(*rows, strict=True) if rows else ((),) * len(names)
    plain = {
        position: [unguarded_cell(cell) for cell in column] if any("'" in cell for cell in column) else column
        for position, column in enumerate(columns)
    }
    frame = pd.DataFrame(plain, dtype=str)
    frame.columns = pd.Index(names)
    return Cells(frame, header, np.array(lines, dtype=np.int64), decisions=decisions)
