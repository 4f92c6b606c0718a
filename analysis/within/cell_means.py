"""From long rows, one per trial, to the participants x cells table of means that the ANOVA takes."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.within.level_codes import level_codes
from experiments.errors import InputError, did_you_mean

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

ROUNDING = 1e-10
"""Means that differ by less than this share of them (or of 1) may be of one and the same rating."""

LAST_DIGITS = 4 * float(np.finfo(np.float64).eps)
"""Ratings that differ by no more than this share of them are one and the same: 0.1 + 0.2 and 0.3."""

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
        One row per trial; `participant` and `within` columns hold text, `rating` finite numbers.
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
    if not len(rows):
        raise InputError("there are no ratings to analyze; the table has a header but no rows")
    person, people = level_codes(rows[participant], participant)
    coded = [level_codes(rows[name], name, (levels or {}).get(name)) for name in within]
    # Each row's cell as one number in mixed radix: participants slowest, the last factor fastest.
    slot, shape = person, (len(people), *(len(names) for _, names in coded))
    for codes, names in coded:
        slot = slot * len(names) + codes
    values = rows[rating].to_numpy(dtype=np.float64)
    size = math.prod(shape)
    # Counting by number is one pass however many factors there are; a pivot sorts all rows.
    counts = np.bincount(slot, minlength=size).reshape(shape)
    sums = np.asarray(np.bincount(slot, weights=values, minlength=size), dtype=np.float64).reshape(shape)
    table = _complete(people, list(within), [names for _, names in coded], sums, counts)
    # Comparing single ratings takes long; only flat rows of cell means can be constant throughout.
    if not _flat(table).any():
        return table
    return replace(table, constant=_constant(table, people, person, values))


def _flat(table: CellTable) -> NDArray[np.bool_]:
    """Whose cells all have one mean (N,): only they can have given one and the same rating throughout."""
    means = table.y.reshape(len(table.y), -1)
    spread: Floats = means.max(axis=1) - means.min(axis=1)
    return np.asarray(spread <= 4 * ROUNDING * np.maximum(np.abs(means[:, 0]), 1.0))


def _constant(table: CellTable, people: list[str], person: Integers, values: Floats) -> tuple[str, ...]:
    """Participants of a table who gave one and the same rating throughout (and more than one)."""
    number = np.bincount(person)
    first = np.zeros(len(number))
    # Written backward, so that the first rating of each participant is written last and stays.
    first[person[::-1]] = values[::-1]
    apart = np.abs(values - first[person]) > LAST_DIGITS * np.abs(first[person])
    constant = (np.bincount(person, weights=apart) == 0) & (number > 1)
    kept = set(table.participants)
    return tuple(people[i] for i in np.flatnonzero(constant) if people[i] in kept)


def _complete(
    people: list[str], factors: list[str], levels: list[list[str]], sums: Floats, counts: Integers
) -> CellTable:
    whole = counts.reshape(len(people), -1).all(axis=1)
    if whole.all():
        return _table(people, factors, levels, sums, counts)
    _refuse_empty_cells(factors, levels, counts)
    dropped = tuple(
        DroppedParticipant(people[i], _cells_at(factors, levels, counts[i] == 0))
        for i in np.flatnonzero(~whole)
    )
    if not whole.any():
        # One row each does not come from missing data but from a wrong table (wide), or a wrong id column.
        if counts.reshape(len(counts), -1).sum(axis=1).max() == 1:
            raise InputError(
                "each participant is in only one row, so nothing varies within participants. Is the table "
                "wide (one row per person; see analysis reshape), or is this not the participant column?"
            )
        _refuse_between_factors(factors, counts)
        first = dropped[0]
        raise InputError(
            f"no participant has a rating in every cell (e.g. '{first.participant}' lacks "
            f"{name_cells(first.missing_cells)}){_case_alone(factors, levels)}; remove a factor or collect "
            "the missing cells"
        )
    complete = [people[i] for i in np.flatnonzero(whole)]
    return _table(complete, factors, levels, sums[whole], counts[whole], dropped)


def _table(
    people: list[str],
    factors: list[str],
    levels: list[list[str]],
    sums: Floats,
    counts: Integers,
    dropped: tuple[DroppedParticipant, ...] = (),
) -> CellTable:
    return CellTable(
        participants=tuple(people),
        factors=tuple(factors),
        levels=tuple(tuple(names) for names in levels),
        # Every cell has a rating here, so no count is zero.
        y=sums / counts,
        counts=counts,
        dropped=dropped,
    )


def _refuse_between_factors(factors: list[str], counts: Integers) -> None:
    """A factor of which everybody has one level alone lies between participants."""
    for axis, name in enumerate(factors, start=1):
        # All axes but the participants' and the factor's own.
        others = tuple(other for other in range(1, counts.ndim) if other != axis)
        seen = (counts > 0).any(axis=others)
        if seen.shape[1] > 1 and (seen.sum(axis=1) <= 1).all():
            raise InputError(
                f"'{name}' never varies within a participant, so it cannot be a within factor; use --between "
                f"{name}"
            )


def _case_alone(factors: list[str], levels: list[list[str]]) -> str:
    """Which levels of a factor differ only in case: the likely cause of missing cells."""
    for name, own in zip(factors, levels, strict=True):
        by_letters: dict[str, str] = {}
        for level in own:
            # The first spelling is kept, so that the message names both.
            if by_letters.setdefault(level.casefold(), level) != level:
                return (
                    f"; levels '{by_letters[level.casefold()]}' and '{level}' of {name} differ only in case"
                )
    return ""


def _refuse_empty_cells(factors: list[str], levels: list[list[str]], counts: Integers) -> None:
    empty = _cells_at(factors, levels, counts.sum(axis=0) == 0)
    if empty:
        raise InputError(
            f"nobody rated {name_cells(empty)}: the design is not fully crossed; remove a factor or level"
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
