"""A CSV with the declaration of its columns beside, as a table of numbers, times and named levels."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pandas as pd
from pydantic import TypeAdapter, ValidationError

from experiments.columns import Column
from experiments.errors import InputError
from experiments.wrong_values import expectation, shown, wrong_value

Columns = tuple[Column, ...]
_COLUMNS = TypeAdapter(Columns)


def read_columns(path: Path) -> Columns:
    """The declarations (JSON, as the server writes it); InputError where they cannot be used."""
    try:
        return _COLUMNS.validate_json(path.read_bytes())
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error}); check the path") from error
    except ValidationError as error:
        raise InputError(
            f"{path.name}: expected the columns of a table as JSON, as `server export --format columns` "
            f"writes them ({_reason(error.errors()[0])})"
        ) from error


def _reason(detail: Mapping[str, Any]) -> str:
    """What is wrong with the first value refused, without the names of Python's types."""
    if detail["type"] == "json_invalid":
        return "this is no JSON"
    parts = [f"column {part + 1}" if isinstance(part, int) else str(part) for part in detail["loc"][:2]]
    said = expectation(detail) is not None or detail["type"] == "missing"
    # what it says of the way out after the semicolon is TOML's
    problem = wrong_value(detail).partition("; ")[0] if said else f"got {shown(detail['input'])}"
    return ": ".join([*parts, problem])


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
