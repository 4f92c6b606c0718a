"""Columns of a long table in a mixed model: their roles, values and units."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.errors import InputError, did_you_mean

# What the columns of a table are in a mixed or ordinal model, and who may differ in effects.

Slopes = Literal["none", "main", "all", "correlated"]
RandomSlopes = Literal["none", "main", "all"]


@dataclass(frozen=True)
class ModelTerms:
    """What a model is of: columns by their role.

    `within` vary within participants, `between` do not; `item` (several columns together) names what was
    rated; `covariates` are numbers, centered; `interactions` are products of covariates with covariates or
    factors, by the names of their members; `random` are further groupings with an intercept each, `a/b` for
    b nested in a and `a:b` for both columns together. `group_slopes` names effects that differ between the
    levels of a further grouping. `correlated_slopes` are the covariates whose slopes correlate with the
    participants' intercept; default: all that vary within participants.
    """

    participant: str
    rating: str
    within: tuple[str, ...]
    item: tuple[str, ...] = ()
    between: tuple[str, ...] = ()
    covariates: tuple[str, ...] = ()
    random: tuple[str, ...] = ()
    interactions: tuple[tuple[str, ...], ...] = ()
    effects: tuple[str, ...] | None = None
    slope_effects: tuple[str, ...] | None = None
    group_slopes: tuple[tuple[str, tuple[str, ...]], ...] = ()
    correlated_slopes: tuple[str, ...] | None = None


def split_covariates(
    named: Sequence[str], factors: Sequence[str]
) -> tuple[tuple[str, ...], tuple[tuple[str, ...], ...]]:
    """Covariates, and their interactions: of `Days`, `age:group` the covariates are Days and age.

    Parameters
    ----------
    named : sequence of str
        Columns of numbers, and interactions whose members are separated by colons.
    factors : sequence of str
        Columns of factors; what else an interaction names is a covariate, with a slope in the model.

    Raises
    ------
    InputError
        An interaction of factors alone (which the model always has), or with one member twice.
    """
    covariates: dict[str, None] = dict.fromkeys(name for name in named if ":" not in name)
    interactions: dict[tuple[str, ...], None] = {}
    for name in named:
        if ":" not in name:
            continue
        members = tuple(part.strip() for part in name.split(":"))
        numbers = [member for member in members if member not in factors]
        if not numbers:
            raise InputError(
                f"'{name}' names only factors, whose interactions are always in the model; expected an "
                "interaction with a covariate, such as age:blur"
            )
        if len(set(members)) < len(members) or "" in members:
            raise InputError(f"expected an interaction of different columns, got '{name}'")
        covariates |= dict.fromkeys(numbers)
        interactions[members] = None
    return tuple(covariates), tuple(interactions)


# Columns of a long table as ratings, groupings and covariates of a mixed model.

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


@dataclass(frozen=True)
class Grouping:
    """What trials have in common: `codes` (n,) into the `names` of its levels; `name` joins the `columns`."""

    name: str
    names: tuple[str, ...] = field(repr=False)
    codes: Integers = field(repr=False)
    columns: tuple[str, ...] = ()


def refuse_unknown_columns(rows: pd.DataFrame, terms: ModelTerms) -> None:
    """Refuse a column that the table lacks, and a table without rows."""
    nested = [part for name in terms.random for part in columns_of(name)]
    named = (terms.participant, terms.rating, *terms.within, *terms.between, *terms.item, *terms.covariates)
    for name in (*named, *nested):
        if name not in rows.columns:
            raise InputError(f"no column is called '{name}'{did_you_mean(name, map(str, rows.columns))}")
    for name in (*terms.within, *terms.between):
        if ":" in name:
            raise InputError(
                f"the factor '{name}' has a ':' in its name, which separates the factors of an interaction; "
                "rename the column"
            )
    if rows.empty:
        raise InputError("there are no ratings to analyze; the table has a header but no rows")


def ratings(rows: pd.DataFrame, name: str) -> Floats:
    """The ratings (n,); rejected if they are not numbers, or all the same."""
    values = numbers(rows, name)
    if np.ptp(values) == 0:
        raise InputError(f"every rating is {values[0]:g}; a model needs ratings that vary")
    return values


def numbers(rows: pd.DataFrame, name: str) -> Floats:
    """A column as finite numbers (n,)."""
    values = pd.to_numeric(rows[name], errors="coerce").to_numpy(dtype=np.float64)
    if not np.isfinite(values).all():
        bad = rows[name].iloc[int(np.flatnonzero(~np.isfinite(values))[0])]
        raise InputError(f"expected numbers in '{name}', got {bad!r}; correct or remove the row")
    return values


def groupings(rows: pd.DataFrame, terms: ModelTerms) -> tuple[Grouping, ...]:
    """Participants, items (if any), and the further groupings.

    Several columns of items together name them where one is not unique (exemplars numbered afresh within a
    profile). `a/b` of `random` stands for a and for b within a.
    """
    groups = [_grouping(rows, [terms.participant], terms.participant, "participants")]
    if terms.item:
        # Not "/": to R that is a further grouping by the first column.
        groups.append(_grouping(rows, list(terms.item), ":".join(terms.item), "items"))
    for name in terms.random:
        parts = name.split("/")
        for depth in range(1, len(parts) + 1):
            label = ":".join(parts[:depth])
            if all(group.name != label for group in groups):
                groups.append(_grouping(rows, columns_of(label), label, f"levels of '{label}'"))
    for k, group in enumerate(groups):
        _refuse_same(group, groups[:k])
    return tuple(groups)


def columns_of(grouping: str) -> list[str]:
    """The columns of a grouping that is written a/b or a:b."""
    return re.split("[/:]", grouping)


def _grouping(rows: pd.DataFrame, columns: list[str], name: str, what: str) -> Grouping:
    # Joined by a character that no cell has: 'a/b' with 'c' is another level than 'a' with 'b/c'.
    label = rows[columns[0]].astype(str)
    for extra in columns[1:]:
        label = label + "\x1f" + rows[extra].astype(str)
    codes, names = pd.factorize(label, sort=True)
    if len(names) < 2:
        raise InputError(f"expected at least two {what}, got {len(names)}")
    if len(names) == len(rows):
        raise InputError(
            f"every row has a different value for {what}, which is confounded with the residual; name a "
            "column whose values repeat"
        )
    shown = tuple(str(text).replace("\x1f", "/") for text in names)
    return Grouping(name, shown, codes.astype(np.int64), tuple(columns))


def _refuse_same(group: Grouping, before: list[Grouping]) -> None:
    for other in before:
        # Distinct pairs of codes: as many as either has levels means that each level has one partner.
        pairs = len(np.unique(group.codes * len(other.names) + other.codes))
        if pairs == len(group.names) == len(other.names):
            raise InputError(f"'{group.name}' groups the rows exactly as '{other.name}' does; remove one")


def covariate_columns(
    rows: pd.DataFrame, terms: ModelTerms, people: Integers
) -> tuple[Floats, tuple[str, ...]]:
    """Covariates (n, k) centered, and what was done.

    Those with one value for each participant are centered at the mean over participants, others over rows.
    """
    columns, said = [np.empty((len(rows), 0))], []
    for name in terms.covariates:
        values = numbers(rows, name)
        if np.ptp(values) == 0:
            raise InputError(f"the covariate '{name}' is {values[0]:g} in every row; remove it")
        each = pd.DataFrame({"who": people, "value": values}).groupby("who")["value"]
        of_people = bool((each.nunique() == 1).all())
        mean = float(each.first().mean() if of_people else values.mean())
        columns.append((values - mean)[:, None])
        said.append(
            f"{name} was centered at its mean over {'participants' if of_people else 'rows'}, {mean:.6g}"
        )
    return np.hstack(columns), tuple(said)


# Ratings in standardized units, so that neither a far origin nor a large unit costs a model its digits.


@dataclass(frozen=True)
class Units:
    """A model is fitted to (rating - middle) / scale: sums of squares of times since 1970 have no digit left.

    `middle` is whole in units of `scale`, a power of two: of ordinary ratings nothing is rounded.
    """

    middle: float
    scale: float

    def scaled(self, ratings: Floats) -> Floats:
        """The ratings in these units."""
        return (ratings - self.middle) / self.scale

    def interval(self, ends: tuple[float, float], intercept: bool = False) -> tuple[float, float]:
        """An interval in the ratings' own units."""
        low, high = (end * self.scale + (self.middle if intercept else 0.0) for end in ends)
        return low, high


def units_of(ratings: Floats) -> Units:
    """Units in which ratings that vary lie about zero and spread by about one."""
    scale = float(2.0 ** np.round(np.log2(ratings.std())))
    return Units(float(np.round(ratings.mean() / scale) * scale), scale)
