"""From long rows, one a trial, to the participants x cells table of means that the ANOVA takes."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.errors import InputError, did_you_mean

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

_NUMBER = re.compile(r"[+-]?[0-9]+(\.[0-9]+)?")

NAMED_CELLS = 5
"""How many empty cells a one-line message names before it counts the rest."""


@dataclass(frozen=True)
class DroppedParticipant:
    """A participant left out of the ANOVA because some cells hold no rating, and which cells these are."""

    participant: str
    missing_cells: tuple[dict[str, str], ...]


@dataclass(frozen=True)
class CellTable:
    """Unweighted means of every complete participant in every cell.

    `y` and `counts` are (N, a, b, ...), axes in factor order; `counts` are the trials behind each mean.
    `constant` names participants (kept) who gave one and the same rating throughout.
    """

    participants: tuple[str, ...]
    factors: tuple[str, ...]
    levels: tuple[tuple[str, ...], ...]
    y: Floats = field(repr=False)
    counts: Integers = field(repr=False)
    dropped: tuple[DroppedParticipant, ...] = ()
    constant: tuple[str, ...] = ()

    @property
    def cells(self) -> list[dict[str, str]]:
        """Every cell as a mapping from factor to level, last factor fastest."""
        return [dict(zip(self.factors, combination, strict=True)) for combination in product(*self.levels)]


def natural_order(names: Sequence[str]) -> list[str]:
    """Sort names: by value where all are numbers, else by text without case; independent of row order."""
    if all(_NUMBER.fullmatch(name) for name in names):
        return sorted(names, key=lambda name: (float(name), name))
    return sorted(names, key=lambda name: (name.casefold(), name))


def cell_table(
    rows: pd.DataFrame,
    participant: str,
    rating: str,
    within: Sequence[str],
    levels: Mapping[str, Sequence[str]] | None = None,
) -> CellTable:
    """Average a participant's trials in each cell; drop and name participants with empty cells.

    Parameters
    ----------
    rows : DataFrame
        One row a trial; `participant` and `within` columns hold text, `rating` finite numbers.
    within : sequence of str
        Factor columns, in the order wanted.
    levels : mapping of str to sequence of str, optional
        Declared levels of some or all factors, in order; the levels found, sorted, for the others.

    Raises
    ------
    InputError
        An unknown column or level, a cell that is empty for everyone, or nobody complete.
    """
    for name in (participant, rating, *within):
        if name not in rows.columns:
            raise InputError(f"no column is called '{name}'{did_you_mean(name, map(str, rows.columns))}")
    if rows.empty:
        raise InputError("there are no ratings to analyse; the table has a header but no rows")
    person, people = _codes(rows[participant], None, participant)
    coded = [_codes(rows[name], (levels or {}).get(name), name) for name in within]
    shape = tuple(len(names) for _, names in coded)
    cell = (
        np.ravel_multi_index(tuple(codes for codes, _ in coded), shape) if within else np.zeros_like(person)
    )
    values = rows[rating].to_numpy(dtype=np.float64)
    slot, slots = person * int(np.prod(shape)) + cell, len(people) * int(np.prod(shape))
    counts = np.bincount(slot, minlength=slots).reshape(len(people), *shape)
    sums: Floats = np.zeros(counts.shape)
    sums += np.bincount(slot, weights=values, minlength=slots).reshape(counts.shape)
    return _complete(
        people, list(within), [names for _, names in coded], sums, counts, _constant(person, values)
    )


def factorized(column: pd.Series) -> tuple[Integers, Sequence[Any]]:
    """Codes (n,) of a column into its values, in the order in which these appear; -1 where one is missing."""
    # of the array itself: an index of the values would take longer than the codes
    codes, values = pd.factorize(column.to_numpy() if isinstance(column.dtype, np.dtype) else column.array)
    return np.asarray(codes, dtype=np.int64), list(values)


def _codes(column: pd.Series, declared: Sequence[str] | None, name: str) -> tuple[Integers, list[str]]:
    """Codes of a column into its sorted (or declared) names."""
    codes, uniques = factorized(column)
    if (codes < 0).any():
        raise InputError(f"'{name}' is empty in row {int(np.argmin(codes)) + 1}; every row needs one")
    texts = [str(text) for text in uniques]
    names = natural_order(texts) if declared is None else [str(level) for level in declared]
    position = {text: i for i, text in enumerate(names)}
    for text in texts:
        if text not in position:
            raise InputError(f"'{text}' is no level of '{name}'{did_you_mean(text, names)}")
    lookup = np.array([position[text] for text in texts], dtype=np.int64)
    return lookup[codes], names


def _constant(person: Integers, values: Floats) -> NDArray[np.bool_]:
    """Which participants gave one and the same rating throughout (and more than one)."""
    number = np.bincount(person)
    mean = np.bincount(person, weights=values) / number
    deviation = np.bincount(person, weights=(values - mean[person]) ** 2)
    return (deviation <= 1e-20 * np.maximum(mean**2, 1.0)) & (number > 1)


def _complete(
    people: list[str],
    factors: list[str],
    levels: list[list[str]],
    sums: Floats,
    counts: Integers,
    constant: NDArray[np.bool_],
) -> CellTable:
    _refuse_empty_cells(factors, levels, counts)
    whole = (counts > 0).reshape(len(people), -1).all(axis=1)
    dropped = tuple(
        DroppedParticipant(people[i], _cells_at(factors, levels, counts[i] == 0))
        for i in np.flatnonzero(~whole)
    )
    if not whole.any():
        _refuse_between_factors(factors, counts)
        first = dropped[0]
        raise InputError(
            f"no participant has a rating in every cell (e.g. '{first.participant}' lacks "
            f"{name_cells(first.missing_cells)}){_case_alone(factors, levels)}; "
            "leave a factor out or collect the missing cells"
        )
    return CellTable(
        participants=tuple(people[i] for i in np.flatnonzero(whole)),
        factors=tuple(factors),
        levels=tuple(tuple(names) for names in levels),
        y=sums[whole] / counts[whole],
        counts=counts[whole],
        dropped=dropped,
        constant=tuple(people[i] for i in np.flatnonzero(whole & constant)),
    )


def _refuse_between_factors(factors: list[str], counts: Integers) -> None:
    """A factor of which everybody has one level alone lies between participants."""
    for axis, name in enumerate(factors, start=1):
        others = tuple(other for other in range(1, counts.ndim) if other != axis)
        seen = (counts > 0).any(axis=others)
        if seen.shape[1] > 1 and (seen.sum(axis=1) <= 1).all():
            raise InputError(
                f"'{name}' never varies within a participant, so it cannot be a factor within; "
                f"give it as a factor between participants (--between {name})"
            )


def _case_alone(factors: list[str], levels: list[list[str]]) -> str:
    """Which levels of a factor are told apart by their case alone: the likely cause of missing cells."""
    for name, own in zip(factors, levels, strict=True):
        by_letters: dict[str, str] = {}
        for level in own:
            if by_letters.setdefault(level.casefold(), level) != level:
                return (
                    f"; levels '{by_letters[level.casefold()]}' and '{level}' of {name} differ in case alone"
                )
    return ""


def _refuse_empty_cells(factors: list[str], levels: list[list[str]], counts: Integers) -> None:
    empty = _cells_at(factors, levels, counts.sum(axis=0) == 0)
    if empty:
        raise InputError(
            f"nobody rated {name_cells(empty)}: the design is not fully crossed; leave out a factor or level"
        )


def _cells_at(
    factors: list[str], levels: list[list[str]], where: NDArray[np.bool_]
) -> tuple[dict[str, str], ...]:
    return tuple(
        {factor: levels[axis][i] for axis, (factor, i) in enumerate(zip(factors, index, strict=True))}
        for index in np.argwhere(where)
    )


def name_cells(cells: Sequence[Mapping[str, str]]) -> str:
    """Cells in words, e.g. `blur=MB amplitude=NC`, the first few only."""
    named = "; ".join(" ".join(f"{f}={level}" for f, level in cell.items()) for cell in cells[:NAMED_CELLS])
    rest = len(cells) - NAMED_CELLS
    return f"{named} and {rest} more" if rest > 0 else named
