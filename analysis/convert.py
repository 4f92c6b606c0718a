"""A CSV whose columns are declared as a typed table, and that table as SPSS or Parquet."""

import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

import pandas as pd
from pydantic import TypeAdapter, ValidationError

from experiments.columns import Column
from experiments.columns.column import plain_name, unlike
from experiments.errors import InputError, as_toml, expectation, wrong_value
from table_files.open import reader_of

# A CSV with a separate declaration of its columns, as a table of numbers, times and named levels.

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
            f"{path.name}: expected the JSON file from `server export --format columns` "
            f"({_reason(error.errors()[0])})"
        ) from error


def _reason(detail: Mapping[str, Any]) -> str:
    """What is wrong with the first value refused, without the names of Python's types."""
    if detail["type"] == "json_invalid":
        return "this is not valid JSON"
    parts = [f"column {part + 1}" if isinstance(part, int) else str(part) for part in detail["loc"][:2]]
    said = expectation(detail) is not None or detail["type"] == "missing"
    # its advice after the semicolon is about TOML
    problem = wrong_value(detail).partition("; ")[0] if said else f"got {as_toml(detail['input'])}"
    return ": ".join([*parts, problem])


def read_typed(path: Path, columns: Columns) -> pd.DataFrame:
    """Read the CSV: numbers as float64 (empty is NaN), whole numbers without gaps as int64, times in UTC.

    Text of which every value is declared becomes categorical, in declared order; other text stays.

    Raises
    ------
    InputError
        The CSV has other columns than are declared, or a number that is none.
    """
    reader = reader_of(path)
    names, columns_there = [column.name for column in columns], reader.header()
    if odd := sorted(set(columns_there) ^ set(names)):
        raise InputError(f"{path.name}: expected the declared columns, got others ({odd[0]})")
    frame = reader.cells(names).rows
    return pd.DataFrame({column.name: _typed(frame[column.name], column, path) for column in columns})


def _typed(cells: pd.Series, column: Column, path: Path) -> pd.Series:
    if column.type == "time":
        return pd.to_datetime(cells.mask(cells == ""), format="ISO8601", utc=True)
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


# A typed table as an SPSS file: variable labels, value labels, measurement levels.

MAX_NAME_BYTES, MAX_LABEL_BYTES, MAX_VALUE_LABEL_BYTES = 60, 250, 118
"""Below SPSS's own limits of 64, 256 and 120, which leaves room for a number after a name."""
_RESERVED = {"ALL", "AND", "BY", "EQ", "GE", "GT", "LE", "LT", "NE", "NOT", "OR", "TO", "WITH"}


def write_spss(frame: pd.DataFrame, columns: Columns, target: Path) -> None:
    """Write a .sav file; levels are codes from 1 with their labels."""
    import pyreadstat

    names = spss_names([column.name for column in columns])
    table, labels = {}, {}
    for column, name in zip(columns, names, strict=True):
        cells, said = _coded(frame[column.name], column)
        table[name] = cells
        if said:
            labels[name] = {code: _cut(label, MAX_VALUE_LABEL_BYTES) for code, label in said.items()}
    pyreadstat.write_sav(
        pd.DataFrame(table),
        str(target),
        column_labels=[_cut(column.description, MAX_LABEL_BYTES) for column in columns],
        variable_value_labels=labels,
        variable_measure={name: _measure(column) for column, name in zip(columns, names, strict=True)},
    )


def spss_names(names: list[str]) -> list[str]:
    """The names as SPSS takes them: a letter first, at most 60 bytes, no word of its syntax, none twice."""
    taken: set[str] = set()
    return [unlike(_spss_name(name), taken) for name in names]


def _spss_name(name: str) -> str:
    plain = plain_name(name)[:MAX_NAME_BYTES].rstrip("_")
    plain = plain if plain[:1].isalpha() else f"v{plain}"
    return f"{plain}_1" if plain.upper() in _RESERVED else plain


def _coded(cells: pd.Series, column: Column) -> tuple[pd.Series, dict[Any, str]]:
    """Levels as their numbers from 1, and what every number means; numbers with the labels declared."""
    if isinstance(cells.dtype, pd.CategoricalDtype):
        words = dict(column.labels)
        labels = {
            float(code): words.get(str(level), str(level))
            for code, level in enumerate(cells.cat.categories, 1)
        }
        return (cells.cat.codes + 1).astype("float64").mask(cells.isna()), labels
    if column.type == "time":
        # SPSS has no time zones.
        return cells.dt.tz_localize(None), {}
    if column.type in ("integer", "boolean", "number"):
        return cells, {float(value): label for value, label in column.labels}
    return cells, {}


def _measure(column: Column) -> Literal["nominal", "ordinal", "scale"]:
    if column.type == "number" or column.type == "time":
        return "scale"
    if column.type == "integer":
        return "ordinal" if column.labels else "scale"
    return "nominal"


def _cut(text: str, limit: int) -> str:
    return text.encode("utf-8")[:limit].decode("utf-8", "ignore")


# A typed table as Parquet: levels as categories, the meaning of each column in the file's own metadata.


def write_parquet(frame: pd.DataFrame, columns: Columns, target: Path) -> None:
    """Write a .parquet file; its metadata has one key per column, with its description."""
    from fastparquet import write

    described = {column.name: column.description for column in columns}
    with warnings.catch_warnings():
        # fastparquet takes the UTC times of a column with a time zone, and keeps the zone in the metadata.
        warnings.filterwarnings("ignore", "Series.values returning", DeprecationWarning)
        write(str(target), frame, compression="GZIP", custom_metadata=described)
