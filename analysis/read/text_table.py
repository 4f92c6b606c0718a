"""Read a long table from CSV as text, with every doubt about it raised as one line."""

import csv
import re
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.read.raggedness import refuse_ragged
from experiments.errors import InputError, did_you_mean

MISSING_MARKS = frozenset({"", "NA", "NaN", "nan", "N/A", "n/a", "."})
"""What counts as 'no rating here' in a rating column; never applied to names of people or levels."""

_DECIMAL_COMMA = re.compile(r"[+-]?[0-9]+,[0-9]+")
_DECIMAL_POINT = re.compile(r"[+-]?[0-9]*\.[0-9]+")
_THOUSANDS = re.compile(r"[+-]?[1-9][0-9]{0,2},[0-9]{3}")
NAMED_ROWS = 5


@dataclass
class TextTable:
    """Columns of text (categorical, kept as written, stripped) and what was decided while reading."""

    columns: pd.DataFrame
    source: str
    header: tuple[str, ...]
    separator: str
    decisions: list[str] = field(default_factory=list)

    @property
    def synthetic(self) -> bool:
        """Whether a column `synthetic`, where it was read, marks a row as made and not given by a person."""
        return "synthetic" in self.columns and bool((self.columns["synthetic"] == "1").any())

    def line(self, row: int) -> int:
        """Line of the file on which data row `row` (from 0) stands, where no cell spans lines."""
        return row + 2


def read_text_table(path: Path, wanted: Sequence[str] | None, optional: Sequence[str] = ()) -> TextTable:
    """Read the `wanted` columns (all must exist; None: every one) and those of `optional` there, as text.

    The separator (comma, semicolon or tab) is taken from the header line. Ids keep their leading zeros,
    and names like `None` or `NA` stay names.

    Raises
    ------
    InputError
        No file, no text, no rows, rows of unequal length, a column missing or there twice.
    """
    header, separator = _header(path)
    wanted = header if wanted is None else wanted
    for name in wanted:
        if name not in header:
            raise InputError(f"{path.name} has no column '{name}'{did_you_mean(name, header)}")
    for name in header:
        if name and header.count(name) > 1 and name in (*wanted, *optional):
            raise InputError(f"{path.name} has two columns called '{name}'; rename one")
    names = list(dict.fromkeys([*wanted, *(name for name in optional if name in header)]))
    frame = _parse(path, separator, [header.index(name) for name in names], len(header))
    if frame.empty:
        raise InputError(f"{path.name} has a header but no rows")
    frame.columns = pd.Index(names)
    table = TextTable(frame, path.name, tuple(header), separator)
    for name in names:
        frame[name] = _stripped(frame[name])
    return table


def _header(path: Path) -> tuple[list[str], str]:
    if path.is_dir():
        raise InputError(f"{path} is a folder; expected a CSV file")
    if not path.is_file():
        raise InputError(f"no file {path}; expected a CSV file with one row a trial")
    try:
        with path.open(encoding="utf-8-sig", newline="") as lines:
            first = lines.readline()
            separator = max(",;\t", key=first.count)
            lines.seek(0)
            rows = csv.reader(lines, delimiter=separator)
            header = next(rows, [])
    except UnicodeDecodeError as error:
        raise InputError(f"{path.name} is not UTF-8 text ({error.reason}); save it as CSV UTF-8") from error
    except csv.Error as error:
        raise InputError(f"{path.name} is not a CSV file: {error}") from error
    if not any(name.strip() for name in header):
        raise InputError(f"{path.name} is empty; expected a header line and one row a trial")
    return [name.strip() for name in header], separator


def _parse(path: Path, separator: str, positions: list[int], width: int) -> pd.DataFrame:
    refuse_ragged(path, separator, width)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            frame = pd.read_csv(
                path,
                sep=separator,
                header=None,
                skiprows=1,
                names=range(width),
                usecols=sorted(positions),
                dtype=str,
                keep_default_na=False,
                encoding="utf-8-sig",
                index_col=False,
                skip_blank_lines=True,
            )
    except pd.errors.EmptyDataError:
        return pd.DataFrame(columns=positions)
    except (pd.errors.ParserError, pd.errors.ParserWarning) as error:
        text = " ".join(str(error).split())
        raise InputError(f"{path.name}: not a CSV file ({text})") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path.name} is not UTF-8 text ({error.reason}); save it as CSV UTF-8") from error
    return frame[positions].copy()


def _stripped(column: "pd.Series[str]") -> "pd.Series[Any]":
    """The column as categories, without surrounding blanks."""
    codes, texts = pd.factorize(column)
    return pd.Series(categorical(codes, [str(text).strip() for text in texts]), index=column.index)


def categorical(codes: NDArray[np.integer[Any]], found: Sequence[str]) -> "pd.Categorical[str]":
    """Categories, sorted, from codes into the names `found`; equal names become one."""
    names = sorted(set(found))
    position = {name: i for i, name in enumerate(names)}
    lookup = np.array([position[name] for name in found], dtype=np.int64)
    index: pd.Index[str] = pd.Index(names, dtype=object)
    return pd.Categorical.from_codes(lookup[codes], categories=index)


def refuse_shared_roles(names: Sequence[str]) -> None:
    """Refuse a column that is named for two roles."""
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"column '{name}' is named for two roles; each role needs a column of its own")


def texts_required(table: TextTable, name: str) -> None:
    """Refuse empty cells in a column of names."""
    column = table.columns[name]
    if "" in column.cat.categories:
        row = int(np.argmax((column == "").to_numpy()))
        raise InputError(f"{table.source}: '{name}' is empty in line {table.line(row)}; every row needs one")
    folded: dict[str, str] = {}
    for text in column.cat.categories:
        other = folded.setdefault(text.casefold(), text)
        if other != text:
            table.decisions.append(f"'{other}' and '{text}' of '{name}' differ in case only; kept apart")


def numbers(table: TextTable, name: str) -> NDArray[np.float64]:
    """Parse a column of numbers; decimal commas are read (and reported), missing marks become NaN."""
    categories = list(table.columns[name].cat.categories)
    commas = [text for text in categories if _DECIMAL_COMMA.fullmatch(text)]
    _refuse_two_readings(table, name, categories, commas)
    values = np.array([_number(table, name, text) for text in [*categories, ""]])
    if commas:
        table.decisions.append(f"decimal commas in '{name}' (e.g. '{commas[0]}') read as decimal points")
    parsed: NDArray[np.float64] = values[table.columns[name].cat.codes.to_numpy().astype(np.int64)]
    return parsed


def _refuse_two_readings(table: TextTable, name: str, categories: list[str], commas: list[str]) -> None:
    """Refuse a column in which a comma may part thousands as well as decimals, with both readings."""
    thousands = [text for text in commas if _THOUSANDS.fullmatch(text)]
    points = [text for text in categories if _DECIMAL_POINT.fullmatch(text)]
    if not thousands or (len(thousands) < len(commas) and not points):
        return
    text, beside = thousands[0], next((t for t in points or categories if t and t not in commas), "")
    decimal, whole = text.replace(",", "."), text.replace(",", "")
    row = int(np.argmax((table.columns[name] == text).to_numpy()))
    raise InputError(
        f"{table.source}: '{text}' of '{name}' in line {table.line(row)} can be read as {decimal} or as "
        f"{whole}{f' (beside it stands {beside})' if beside else ''}; write decimals with a point and "
        "thousands without a mark"
    )


def unusual_numbers(table: TextTable, name: str, values: NDArray[np.float64]) -> None:
    """Say it where a few whole-number ratings lie far outside all others: typing errors, codes for missing.

    Far: beyond the others by more than their whole range, where the others span at most 11 points and the
    few are no more than one in twenty.
    """
    given = values[~np.isnan(values)]
    if len(given) < 20 or (given != np.round(given)).any():
        return
    low, high = np.quantile(given, [0.05, 0.95], method="nearest")
    width = high - low
    far = ~np.isnan(values) & ((values > high + width + 1) | (values < low - width - 1))
    if 0 < width <= 10 and far.any() and far.sum() <= len(given) / 20:
        named = ", ".join(f"{value:g}" for value in sorted(set(values[far])))
        inside = given[(given <= high + width + 1) & (given >= low - width - 1)]
        table.decisions.append(
            f"'{name}' holds {named} ({name_lines(table, far)}), far from the others ({inside.min():g} to "
            f"{inside.max():g}); they count: correct them, leave them empty, or refuse them with --scale"
        )


def _number(table: TextTable, name: str, text: str) -> float:
    if text in MISSING_MARKS:
        return np.nan
    plain = text.replace(",", ".") if _DECIMAL_COMMA.fullmatch(text) else text
    try:
        value = float(plain)
    except ValueError:
        value = np.nan
    if not np.isfinite(value) or "_" in plain:
        row = int(np.argmax((table.columns[name] == text).to_numpy()))
        raise InputError(
            f"{table.source}: '{name}' should be a number, got '{text}' in line {table.line(row)}"
        )
    return value


def name_lines(table: TextTable, rows: NDArray[np.bool_]) -> str:
    """The lines of some rows in words, the first few only."""
    found = np.flatnonzero(rows)
    named = ", ".join(str(table.line(int(row))) for row in found[:NAMED_ROWS])
    rest = len(found) - NAMED_ROWS
    return f"line{'s' if len(found) > 1 else ''} {named}{f' and {rest} more' if rest > 0 else ''}"
