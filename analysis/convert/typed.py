"""A CSV with the declaration of its columns beside, as a table of numbers, times and named levels."""

from pathlib import Path

import pandas as pd
from pydantic import TypeAdapter, ValidationError

from experiments.columns import Column
from experiments.errors import InputError

Columns = tuple[Column, ...]
_COLUMNS = TypeAdapter(Columns)


def read_columns(path: Path) -> Columns:
    """The declarations (JSON, as the server writes it); InputError where they cannot be used."""
    try:
        return _COLUMNS.validate_json(path.read_bytes())
    except (OSError, ValidationError) as error:
        reason = str(error).splitlines()[0]
        raise InputError(f"{path.name}: expected the columns of a table as JSON ({reason})") from error


def read_typed(path: Path, columns: Columns) -> pd.DataFrame:
    """Read the CSV: numbers as float64 (empty is NaN), whole numbers without gaps as int64, times in UTC.

    Text of which every value is declared becomes categorical, in declared order; other text stays.

    Raises
    ------
    InputError
        The CSV has other columns than are declared, or a number that is none.
    """
    frame = pd.read_csv(path, dtype=str, keep_default_na=False, encoding="utf-8-sig")
    names = [column.name for column in columns]
    if list(frame.columns) != names:
        odd = sorted(set(frame.columns) ^ set(names)) or ["their order"]
        raise InputError(f"{path.name}: expected the declared columns, got others ({odd[0]})")
    return pd.DataFrame({column.name: _typed(frame[column.name], column, path) for column in columns})


def _typed(cells: pd.Series, column: Column, path: Path) -> pd.Series:
    if column.type == "time":
        return pd.to_datetime(cells.mask(cells == ""), format="ISO8601", utc=True).dt.tz_convert(None)
    if column.type == "text":
        return _named(cells, column)
    try:
        numbers = pd.to_numeric(cells.mask(cells == ""))
    except ValueError as error:
        raise InputError(f"{path.name}: {column.name}: expected numbers ({error})") from error
    whole = column.type != "number" and not numbers.isna().any()
    return numbers.astype("int64" if whole else "float64")


def _named(cells: pd.Series, column: Column) -> pd.Series:
    if not column.values or not cells[cells != ""].isin(column.values).all():
        return cells
    return pd.Series(pd.Categorical(cells.mask(cells == ""), list(column.values)), index=cells.index)
