"""Columns of numbers in a table of text: decimal commas, marks and codes for missing, unusual ratings."""

import re
from collections.abc import Iterable

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.read.text_table import TextTable, name_lines
from experiments.errors import InputError

MISSING_MARKS = frozenset({"", "NA", "NaN", "nan", "N/A", "n/a", "."})
"""What counts as 'no rating here' in a rating column; never applied to names of people or levels."""

_DECIMAL_COMMA = re.compile(r"[+-]?[0-9]+,[0-9]+")
_DECIMAL_POINT = re.compile(r"[+-]?[0-9]*\.[0-9]+")
_THOUSANDS = re.compile(r"[+-]?[1-9][0-9]{0,2},[0-9]{3}")
_POINTED_THOUSANDS = re.compile(r"[+-]?[1-9][0-9]{0,2}\.[0-9]{3}")
_COMMA_OR_WHOLE = re.compile(r"[+-]?[0-9]+(,[0-9]+)?")
_HUNDREDS = re.compile(r"[+-]?[1-9][0-9]{2}")
MISSING_CODES = (-9999.0, -999.0, -99.0, -88.0, -77.0, -9.0, 99.0, 999.0, 9999.0)
"""Numbers by which people mark that there is none."""
SIZE_MIN = 1e-100
"""Numbers all below it, or one above its inverse, have sums of squares that a float64 cannot tell apart."""
IN_COVARIATE = "correct them or leave them empty"
"""What to do about unusual numbers where there is no scale that would reject them."""


def holds_numbers(texts: Iterable[object]) -> bool:
    """Whether texts are numbers alone, with a decimal point or comma, apart from marks of missing values."""
    given = pd.Series([str(text) for text in texts if str(text) not in MISSING_MARKS], dtype=object)
    values = pd.to_numeric(given.str.replace(",", ".", regex=False), errors="coerce") if len(given) else given
    return bool(len(values)) and bool(values.notna().all())


def numbers(table: TextTable, name: str) -> NDArray[np.float64]:
    """Parse a column of numbers; decimal commas are read (and reported), missing marks become NaN."""
    categories = list(table.columns[name].cat.categories)
    commas = [text for text in categories if _DECIMAL_COMMA.fullmatch(text)]
    if name not in table.numeric:
        _refuse_two_readings(table, name, categories, commas)
    # The last entry is for code -1, of rows without a category: it gives NaN.
    values = np.array([_number(text) for text in [*categories, ""]])
    numeric = np.isfinite(values)
    _refuse_words(
        table, name, {t for t, fine in zip(categories, numeric, strict=False) if not fine} - MISSING_MARKS
    )
    _refuse_out_of_bounds(table, name, values[:-1])
    if commas:
        table.decisions.append(f"decimal commas in '{name}' (e.g. '{commas[0]}') read as decimal points")
    parsed: NDArray[np.float64] = values[table.columns[name].cat.codes.to_numpy().astype(np.int64)]
    return parsed


def _refuse_out_of_bounds(table: TextTable, name: str, values: NDArray[np.float64]) -> None:
    """Refuse numbers whose squares, which every test sums, are too large or too small for a float64."""
    sizes = np.abs(values[np.isfinite(values)])
    if not sizes.size or not sizes.max():
        return
    if sizes.max() > 1 / SIZE_MIN:
        text = table.columns[name].cat.categories[int(np.nanargmax(np.abs(values)))]
        row = int(np.argmax((table.columns[name] == text).to_numpy()))
        raise InputError(
            f"{table.source}: '{name}' is {text} in line {table.line(row)}: sums of squares of such numbers "
            "cannot be computed. Correct it, or use a larger unit for the column"
        )
    if sizes.max() < SIZE_MIN:
        raise InputError(
            f"{table.source}: every number of '{name}' is below {SIZE_MIN:g}: sums of squares of such "
            "numbers cannot be computed; use a smaller unit for the column"
        )


def _refuse_two_readings(table: TextTable, name: str, categories: list[str], commas: list[str]) -> None:
    """Refuse a column whose commas or points may part thousands as well as decimals, with both readings."""
    thousands = [text for text in commas if _THOUSANDS.fullmatch(text)]
    points = [text for text in categories if _DECIMAL_POINT.fullmatch(text)]
    hundreds = [text for text in categories if _HUNDREDS.fullmatch(text)]
    if points and not commas and hundreds and all(map(_POINTED_THOUSANDS.fullmatch, points)):
        # 1.003 next to 950, as spreadsheets write it where the comma is the decimal mark
        text, beside = points[0], hundreds[0]
    elif points and not commas and (elsewhere := _decimal_comma_elsewhere(table, name, categories)):
        text, beside = points[0], elsewhere
    elif thousands and (len(thousands) == len(commas) or points):
        text, beside = thousands[0], next((t for t in points or categories if t and t not in commas), "")
    else:
        return
    decimal, whole = text.replace(",", "."), re.sub("[.,]", "", text)
    row = int(np.argmax((table.columns[name] == text).to_numpy()))
    raise InputError(
        f"{table.source}: '{text}' of '{name}' in line {table.line(row)} can be read as {decimal} or as "
        f"{whole}{f' (also found: {beside})' if beside else ''}; write decimals with a point and "
        "thousands without a separator"
    )


def _decimal_comma_elsewhere(table: TextTable, name: str, categories: list[str]) -> str:
    """A decimal comma of another column where every number here is like 1.003; none without such a column.

    Only such a column makes the points doubtful, so that other files are read once.
    """
    given = [text for text in categories if text not in MISSING_MARKS]
    if table.reader is None or not all(map(_POINTED_THOUSANDS.fullmatch, given)):
        return ""
    others = [other for other in dict.fromkeys(table.header) if other and other != name]
    if not others:
        return ""
    rows = table.reader.cells(others).rows
    for other in others:
        texts = {str(text).strip() for text in rows[other].unique()}
        if shown := _shown_decimal_comma(texts - MISSING_MARKS):
            return f"{shown} of '{other}'"
    return ""


def _shown_decimal_comma(texts: set[str]) -> str:
    """The first number whose comma can only be a decimal one, of a column of numbers without points."""
    if not all(map(_COMMA_OR_WHOLE.fullmatch, texts)):
        return ""
    return min((t for t in texts if "," in t and not _THOUSANDS.fullmatch(t)), default="")


def unusual_numbers(
    table: TextTable,
    name: str,
    values: NDArray[np.float64],
    remedy: str = "correct them, leave them empty, or reject them with --scale",
) -> None:
    """Say it where a few whole-number ratings lie far outside all others: typing errors, codes for missing.

    Far: beyond the others by more than their whole range, where the others span at most 11 points and the
    few are no more than one in twenty. Codes for missing (-99, 999) that lie so far, or below zero where
    nothing else does, are named however many they are.
    """
    coded = _missing_codes(values)
    if coded.any():
        named = ", ".join(f"{value:g}" for value in sorted(set(values[coded])))
        table.decisions.append(
            f"'{name}' has {named} ({name_lines(table, coded)}), often a code for missing values; they were "
            f"counted: {remedy}"
        )
    given = values[~np.isnan(values) & ~coded]
    values = np.where(coded, np.nan, values)
    if len(given) < 20 or (given != np.round(given)).any():
        return
    low, high = np.quantile(given, [0.05, 0.95], method="nearest")
    width = high - low
    far = ~np.isnan(values) & ((values > high + width + 1) | (values < low - width - 1))
    if 0 < width <= 10 and far.any() and far.sum() <= len(given) / 20:
        named = ", ".join(f"{value:g}" for value in sorted(set(values[far])))
        inside = given[(given <= high + width + 1) & (given >= low - width - 1)]
        table.decisions.append(
            f"'{name}' has {named} ({name_lines(table, far)}), far from the others ({inside.min():g} to "
            f"{inside.max():g}); they were counted: {remedy}"
        )


def _missing_codes(values: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which values are codes for missing that lie where no other value does."""
    coded = np.isin(values, MISSING_CODES)
    others = values[~coded & ~np.isnan(values)]
    if not coded.any() or len(others) < 2:
        return np.zeros(len(values), dtype=bool)
    low, high = others.min(), others.max()
    beyond = (values > high + (high - low) + 1) | (values < low - (high - low) - 1)
    return np.asarray(coded & (beyond | ((values < 0) & (low >= 0))))


def _number(text: str) -> float:
    """The number; NaN where the text is none, or is not finite."""
    plain = text.replace(",", ".") if _DECIMAL_COMMA.fullmatch(text) else text
    try:
        # Python would read 1_000 as a number, which nobody means in a table.
        value = np.nan if "_" in plain else float(plain)
    except ValueError:
        value = np.nan
    return value if np.isfinite(value) else np.nan


def _refuse_words(table: TextTable, name: str, words: set[str]) -> None:
    """Reject texts that are not numbers, naming the first line with one."""
    if words:
        row = int(np.argmax(table.columns[name].isin(words).to_numpy()))
        raise InputError(
            f"{table.source}: '{name}' should be a number, got '{table.columns[name].iloc[row]}' in line "
            f"{table.line(row)}; correct it, or leave the cell empty (or write NA) if it is missing"
        )
