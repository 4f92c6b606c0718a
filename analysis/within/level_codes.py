"""Columns of a table as codes into their levels."""

import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.errors import InputError, did_you_mean

Integers = NDArray[np.int64]

# No exponents: 1e5 may be a name.
_NUMBER = re.compile(r"[+-]?[0-9]+(\.[0-9]+)?")

_EXACT = 2**53
"""Whole numbers below have the same order as numbers and as their float64."""


def natural_order(names: Sequence[str]) -> list[str]:
    """Sort names: by value where all are numbers, else by text without case; independent of row order."""
    if all(_NUMBER.fullmatch(name) for name in names):
        # The text as well, so that 1 and 1.0 have one order.
        return sorted(names, key=lambda name: (float(name), name))
    return sorted(names, key=lambda name: (name.casefold(), name))


def factorize_column(column: pd.Series) -> tuple[Integers, Sequence[Any]]:
    """Codes (n,) of a column into its values, in the order in which these appear; -1 where one is missing."""
    # of the array itself: an index of the values would take longer than the codes
    plain = isinstance(column.dtype, np.dtype) or getattr(column.dtype, "storage", None) == "python"
    codes, values = pd.factorize(column.to_numpy() if plain else column.array)
    return np.asarray(codes, dtype=np.int64), list(values)


def level_codes(
    column: pd.Series, name: str, declared: Sequence[str] | None = None
) -> tuple[Integers, list[str]]:
    """Codes (n,) of the column `name` into its declared names, or into those it holds in order.

    The order is that of an ordered categorical column, else the natural one.

    Raises
    ------
    InputError
        A row without a value; a value that is not declared.
    """
    # Whole numbers are counted, which is faster than hashing.
    if declared is None and (counted := _whole_numbers(column)) is not None:
        return counted
    codes, uniques = factorize_column(column)
    # Missing values have the code -1.
    if codes.min() < 0:
        raise InputError(f"'{name}' is empty in row {int(np.argmin(codes)) + 1}; every row needs one")
    texts = [str(text) for text in uniques]
    names = _in_order(column, texts) if declared is None else [str(level) for level in declared]
    position = {text: i for i, text in enumerate(names)}
    for text in texts:
        if text not in position:
            raise InputError(f"'{text}' is not a level of '{name}'{did_you_mean(text, names)}")
    lookup = np.array([position[text] for text in texts], dtype=np.int64)
    # By value and not by row: a few levels, but maybe a million rows.
    return lookup[codes], names


def in_given_order(rows: pd.DataFrame, given: Sequence[str]) -> tuple[pd.DataFrame, tuple[str, ...]]:
    """The rows with levels in the order given, and what is said of it.

    Parameters
    ----------
    rows : DataFrame
        Columns of text.
    given : sequence of str
        `column=first,second,third`, or with `|` between levels that hold a comma; or the name or path of an
        experiment, for the declared order of each of its factors that is a column.

    Raises
    ------
    InputError
        Text of another form, an unknown column, levels that are not exactly those of the column.
    """
    if not given:
        return rows, ()
    levels = {str(name): [str(level) for level in rows[name].unique()] for name in rows.columns}
    orders, said = given_orders(levels, given)
    for name, order in orders.items():
        rows = rows.assign(**{name: pd.Categorical(rows[name].astype(str), order, ordered=True)})
    return rows, said


def given_orders(
    levels: Mapping[str, Sequence[str]], given: Sequence[str]
) -> tuple[dict[str, tuple[str, ...]], tuple[str, ...]]:
    """Orders of levels by the columns that are given one, and what is said of it.

    Parameters
    ----------
    levels : mapping of str to sequence of str
        The levels of each column that may be ordered.
    given : sequence of str
        As in `in_given_order`.

    Raises
    ------
    InputError
        As `in_given_order`.
    """
    orders: dict[str, tuple[str, ...]] = {}
    for text in (order for one in given for order in _listed_orders(one, levels)):
        name, equals, listed = text.partition("=")
        name = name.strip()
        # A bar where levels hold commas.
        order = [level.strip() for level in listed.split("|" if "|" in listed else ",")]
        if not equals or not all(order):
            raise InputError(
                f"--levels should be like time=before,after,later, or an experiment's name or TOML file, "
                f"got '{text}'"
            )
        if name not in levels:
            raise InputError(f"--levels: no factor is called '{name}'{did_you_mean(name, levels)}")
        there = natural_order(list(dict.fromkeys(levels[name])))
        for level in order:
            if level not in there:
                raise InputError(
                    f"--levels: '{level}' is not a level of '{name}'{did_you_mean(level, there)}"
                )
        # All levels once: an order of some would leave the others without a place.
        lacking = [level for level in there if level not in order]
        if lacking or len(set(order)) < len(order):
            named = f"; {', '.join(lacking)} missing" if lacking else ""
            raise InputError(f"--levels: expected each level of '{name}' once ({', '.join(there)}){named}")
        orders[name] = tuple(order)
    return orders, tuple(
        f"levels of '{name}' in the order given: {', '.join(order)}" for name, order in orders.items()
    )


def _listed_orders(text: str, levels: Mapping[str, Sequence[str]]) -> list[str]:
    """The text, or where it is an experiment its declared order of each factor among `levels`."""
    if "=" in text:
        return [text]
    from experiments.load import UnknownExperimentError, load_experiment

    try:
        experiment = load_experiment(text, has_data=True)
    except UnknownExperimentError:
        return [text]
    factors = [factor for factor in experiment.factors if factor.name in levels]
    if not factors:
        names = ", ".join(experiment.factor_names) or "no factors"
        raise InputError(f"--levels: none of the factors of {text} is a factor here; it declares {names}")
    orders = []
    for factor in factors:
        there = set(levels[factor.name])
        declared = [level.name for level in factor.levels]
        if unknown := sorted(there - set(declared)):
            raise InputError(
                f"--levels: '{unknown[0]}' is a level of '{factor.name}' here, but {text} does not declare it"
            )
        orders.append(f"{factor.name}={'|'.join(level for level in declared if level in there)}")
    return orders


def _in_order(column: pd.Series, texts: Sequence[str]) -> list[str]:
    """The names that a column holds: as its own categories are ordered, where they are."""
    if isinstance(column.dtype, pd.CategoricalDtype) and column.dtype.ordered:
        there = set(texts)
        return [str(level) for level in column.dtype.categories if str(level) in there]
    return natural_order(texts)


def _whole_numbers(column: pd.Series) -> tuple[Integers, list[str]] | None:
    """The same of whole numbers in a range no wider than the table is long, which are counted; else None."""
    dtype = column.dtype
    if not isinstance(dtype, np.dtype) or dtype.kind not in "iu" or not len(column):
        return None
    values = column.to_numpy()
    low, high = int(values.min()), int(values.max())
    # A range wider than the table would take more memory than hashing.
    if high - low >= len(values) or max(-low, high) >= _EXACT:
        return None
    codes = values.astype(np.int64, copy=False) - low
    present = np.flatnonzero(np.bincount(codes))
    # Gaps in the range are closed, so that codes count the levels that occur.
    if len(present) <= high - low:
        lookup = np.zeros(high - low + 1, np.int64)
        lookup[present] = np.arange(len(present))
        codes = lookup[codes]
    return codes, [str(level) for level in (present + low).tolist()]
