"""A typed table as an SPSS file: variable labels, value labels, measurement levels."""

from pathlib import Path
from typing import Any, Literal

import pandas as pd

from analysis.convert.typed import Columns
from experiments.columns.column import Column
from experiments.columns.names import plain_name, unlike

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
