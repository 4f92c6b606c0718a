"""Votes and what the standards of ITU make of them: hidden references, z-scores, unlike raters."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, TypedDict

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.read.number_columns import numbers, unusual_numbers
from analysis.read.reading import EXPORT_COLUMNS, answers_that_count, rows_with_names
from analysis.read.text_table import (
    TextTable,
    name_lines,
    names_in_order,
    read_text_table,
    refuse_shared_roles,
    texts_required,
)
from analysis.within.level_codes import given_orders
from experiments.errors import InputError
from table_files import counted

Array = NDArray[np.float64]
Codes = NDArray[np.int64]
Flags = NDArray[np.bool_]
NAMED_MAX = 6
ScoreMethod = Literal["acr", "acr-hr", "ccr", "dscqs"]
P913_BELOW = 0.75
"""P.913: a lower correlation with the mean votes excludes."""
P913_CONDITIONS_BELOW = 0.8
"""P.913 with conditions: the correlation of a person's means of conditions is lower than this as well."""
RATERS_MIN = 3
"""Fewer raters cannot be distinguished by their likeness to the mean."""
CONDITIONS_MIN = 3
FAR_SHARE, LEAN_MAX = 0.05, 0.3
"""BT.500: more than this share of votes is far, and the sides differ by less than this share of them."""


@dataclass(frozen=True)
class Standard:
    """How votes become scores.

    Attributes
    ----------
    method : {"acr", "acr-hr", "ccr", "dscqs"}
        Absolute votes; against a hidden reference; comparisons with a reference; votes on test and reference.
    reference : str or None
        acr-hr: column that names the item's hidden reference. dscqs: column of the vote on the reference.
    first : str or None
        ccr: column that names what was shown first.
    highest : float or None
        acr-hr: highest point of the scale.
    crush : bool
        acr-hr: whether scores above the highest point are pulled toward it.
    z_scores : bool
        Whether each person's votes are standardized, in each session if `session` names its column.
    condition : str or None
        Column that names what was done to the item, such as its codec; for screening by P.913.
    """

    method: ScoreMethod = "acr"
    reference: str | None = None
    first: str | None = None
    highest: float | None = None
    crush: bool = False
    z_scores: bool = False
    session: str | None = None
    condition: str | None = None

    def check(self) -> None:
        """Refuse options that do not belong together; InputError says what to add or remove."""
        # Two methods need the reference's column, each for another purpose.
        needs = {"acr-hr": ("--reference", self.reference), "dscqs": ("--reference", self.reference)}
        needs["ccr"] = ("--first", self.first)
        name, given = needs.get(self.method, ("", "none"))
        if given is None:
            raise InputError(f"--method {self.method} needs {name} COLUMN")
        if self.first is not None and self.method != "ccr":
            raise InputError("--first is for --method ccr; remove it, or add --method ccr")
        if self.reference is not None and self.method not in ("acr-hr", "dscqs"):
            raise InputError("--reference is for --method acr-hr or dscqs; add one of them")
        if self.method == "acr-hr" and self.highest is None:
            raise InputError("--method acr-hr needs the ends of the scale: add, for example, --scale 1:5")
        if self.crush and (self.method != "acr-hr" or self.highest != 5):
            raise InputError("--crush is for --method acr-hr on a scale that ends at 5")
        if self.session is not None and not self.z_scores:
            raise InputError("--session is for --z-scores; add it, or remove --session")
        if self.z_scores and self.method != "acr":
            raise InputError(f"--z-scores is for --method acr, got {self.method}; remove one of them")


def differential_scores(scores: Array, references: Codes, highest: float, crush: bool) -> Array:
    r"""Scores (people, items) against each person's vote on the hidden reference, as in ITU-T P.910 ACR-HR.

    .. math::

        DV = V(\text{item}) - V(\text{reference}) + h \tag{1}

        DV' = 7 \, DV / (2 + DV) \text{ if } DV > 5 \tag{2}

    h is the highest point of the scale; (2) is the standard's crushing of scores above it, for h = 5.

    Parameters
    ----------
    scores : (people, items) array
        NaN where there is no vote.
    references : (items,) int64
        Index of each item's reference; -1 for references themselves, whose scores are NaN.
    """
    # Against a person's own vote on the reference, not the mean: people use scales differently.
    of_reference = np.where(references >= 0, scores[:, np.maximum(references, 0)], np.nan)
    differences = scores - of_reference + highest
    if crush:
        differences = np.where(differences > highest, 7 * differences / (2 + differences), differences)
    return np.asarray(differences, dtype=np.float64)


def standardized_votes(values: Array, group: Codes) -> Array:
    """Votes (n,) minus the mean of their group, over its SD (n - 1); NaN where a group does not vary."""
    n = np.bincount(group)
    mean = np.bincount(group, values) / n
    spread = np.bincount(group, (values - mean[group]) ** 2) / np.maximum(n - 1, 1)
    # The same decimal throughout leaves a spread of rounding alone: its scores would be noise of size 1.
    largest = np.zeros(n.size)
    np.maximum.at(largest, group, np.abs(values))
    sd = np.where(np.sqrt(spread) > 1e-12 * largest, np.sqrt(spread), np.nan)
    return np.asarray((values - mean[group]) / sd[group], dtype=np.float64)


# Raters whose votes are unlike the others'.


class Screening(TypedDict):
    """A rule, and for P.913 the correlation below which a rater goes."""

    rule: Literal["bt500", "p913"]
    below: float


def screen_raters(scores: Array, screening: Screening, conditions: Codes | None = None) -> dict[int, str]:
    """Return the raters (by row of `scores`, people by items, NaN for no vote) to leave out, with the reason.

    BT.500 is applied once, as it demands. P.913 leaves out the rater of the lowest correlation, computes the
    means again, and goes on until no correlation is too low. With the `conditions` (items,) it spares raters
    whose means of conditions correlate with everybody's by .8 or more.
    """
    if len(scores) < RATERS_MIN:
        return {}
    if screening["rule"] == "bt500":
        above, below, rejected = bt500_counts(scores)
        n = np.isfinite(scores).sum(axis=1)
        return {
            int(k): f"{above[k]} of {n[k]} ratings far above and {below[k]} far below the means"
            for k in np.flatnonzero(rejected)
        }
    return _by_correlation(scores, screening["below"], conditions)


def _by_correlation(scores: Array, limit: float, conditions: Codes | None) -> dict[int, str]:
    reasons: dict[int, str] = {}
    kept = np.ones(len(scores), dtype=bool)
    while kept.sum() >= RATERS_MIN:
        # People who have gone must never be the lowest again.
        r = np.full(len(scores), np.inf)
        r[kept] = mean_correlations(scores[kept])
        by_condition = np.full(len(scores), -np.inf)
        if conditions is not None:
            by_condition[kept] = mean_correlations(_condition_means(scores[kept], conditions))
            # Infinite where somebody rated too few conditions: then the clips alone decide.
            r[np.isfinite(by_condition) & (by_condition >= P913_CONDITIONS_BELOW)] = np.inf
        lowest = int(np.argmin(r))
        if not r[lowest] < limit:
            break
        reasons[lowest] = f"correlation {r[lowest]:.2f} with the mean ratings, below {limit:g}"
        if np.isfinite(by_condition[lowest]):
            reasons[lowest] += (
                f", and {by_condition[lowest]:.2f} by condition, below {P913_CONDITIONS_BELOW:g}"
            )
        kept[lowest] = False
    return reasons


def _condition_means(scores: Array, conditions: Codes) -> Array:
    """Each person's mean vote on each condition (people, conditions); NaN where the person has no vote."""
    member = np.eye(int(conditions.max()) + 1)[conditions]
    n = np.isfinite(scores) @ member
    return np.asarray(np.divide(np.nan_to_num(scores) @ member, n, out=np.full(n.shape, np.nan), where=n > 0))


def mean_correlations(scores: Array) -> Array:
    """Correlation of each person's votes (people, items) with the mean of everybody's, on the items rated.

    A person whose votes do not vary has 0, as they say nothing; of fewer than three items it is infinite,
    since such a person cannot be judged.
    """
    seen = np.isfinite(scores)
    # not every item needs a vote of those who remain
    means = np.divide(
        np.nansum(scores, axis=0), seen.sum(axis=0), out=np.zeros(scores.shape[1]), where=seen.any(axis=0)
    )
    correlations = np.full(len(scores), np.inf)
    for k, (own, there) in enumerate(zip(scores, seen, strict=True)):
        if there.sum() > 2 and np.ptp(means[there]) > 0:
            varied = np.ptp(own[there]) > 0
            correlations[k] = np.corrcoef(own[there], means[there])[0, 1] if varied else 0.0
    return correlations


def bt500_counts(scores: Array) -> tuple[Codes, Codes, NDArray[np.bool_]]:
    """Votes of each person far above and far below, and whether ITU-R BT.500 rejects the person (people,).

    A vote is far beyond 2 SD of the item's votes where their kurtosis is between 2 and 4, beyond sqrt(20) SD
    elsewhere; a person goes where more than 5% of the votes are far and the sides differ by less than 30%.
    Items of one vote, or of which all votes are alike, have no vote that is far.
    """
    seen = np.isfinite(scores)
    n = seen.sum(axis=0)
    means = np.divide(np.nansum(scores, axis=0), n, out=np.zeros(scores.shape[1]), where=n > 0)
    # From here on missing votes are NaN, and leave every sum as it is.
    centred = scores - means
    squares = np.nansum(centred**2, axis=0)
    varied = squares > 0
    sd = np.sqrt(squares / np.maximum(n - 1, 1))
    fourth = np.nansum(centred**4, axis=0)
    # m4 / m2^2 with moments over n, unlike the SD above, which is over n - 1.
    kurtosis = np.divide(fourth * n, squares**2, out=np.zeros_like(squares), where=varied)
    limit = np.where((kurtosis >= 2) & (kurtosis <= 4), 2.0, np.sqrt(20.0)) * sd
    # Where nothing varies the limit is 0, which every vote reaches.
    above = np.sum((centred >= limit) & varied, axis=1)
    below = np.sum((centred <= -limit) & varied, axis=1)
    # A vote is counted against the person's own number of votes: few may be far by chance.
    share = (above + below) / np.maximum(seen.sum(axis=1), 1)
    # Somebody whose far votes are all on one side is strict or mild, and not unreliable.
    lean = np.abs(above - below) / np.maximum(above + below, 1)
    return above, below, np.asarray((share > FAR_SHARE) & (lean < LEAN_MAX))


# One row per vote, read as a table of people and items.


def names_where(names: Sequence[str], which: NDArray[np.bool_]) -> str:
    """Return the names that a mask (n,) chooses, at most six and how many more there are."""
    chosen = [name for name, one in zip(names, which, strict=True) if one]
    rest = len(chosen) - NAMED_MAX
    return ", ".join(chosen[:NAMED_MAX]) + (f" and {rest} more" if rest > 0 else "")


@dataclass(frozen=True, eq=False)
class Votes:
    """Votes by person and item: means (people, items), NaN where none, and how many votes each rests on.

    `squares` (people, items) are the sums of squared distances of votes from these means.
    """

    scores: Array
    counts: Array
    squares: Array
    people: tuple[str, ...]
    items: tuple[str, ...]
    all_votes: tuple[Array, ...]
    source: str
    synthetic: bool
    decisions: tuple[str, ...]


def read_votes(
    path: Path,
    item: str,
    participant: str,
    rating: str,
    levels: Sequence[str] = (),
    standard: Standard = Standard(),
    screening: Screening | None = None,
) -> Votes:
    """Read one row per vote; `levels` may give the order of the items (`given_orders`).

    Raters are screened before scores are computed against hidden references.

    Raises
    ------
    InputError
        As `read_text_table`; a rating that is not a number, no rating at all; options of `standard` that do
        not belong together; a hidden reference that nobody rated; nobody left after screening.
    """
    return read_votes_by(path, (item, participant, rating), None, levels, standard, screening)[""]


def read_votes_by(
    path: Path,
    columns: tuple[str, str, str],
    by: str | None = None,
    levels: Sequence[str] = (),
    standard: Standard = Standard(),
    screening: Screening | None = None,
) -> dict[str, Votes]:
    """The votes at each level of the column `by`, such as the scale; all under an empty name without one.

    `columns` are those of the item, the person and the vote; see `read_votes`.
    """
    standard.check()
    of_standard = (standard.reference, standard.first, standard.session, standard.condition)
    more = [name for name in (*of_standard, by) if name]
    roles = [*columns, *more]
    refuse_shared_roles(roles)
    table = read_text_table(path, roles, EXPORT_COLUMNS)
    named = rows_with_names(table)
    texts_required(table, columns[0], rows=named)
    texts_required(table, columns[1])
    values = _scored_rows(table, columns, standard)
    keep = np.isfinite(values)
    if not keep.all():
        lines = name_lines(table, ~keep)
        table.decisions.append(f"{counted(int((~keep).sum()), 'row')} without a rating excluded ({lines})")
    if not keep.any():
        raise InputError(f"{path.name}: column '{columns[2]}' has no rating in any row")
    keep = answers_that_count(table, keep, "ratings", roles)
    if standard.z_scores:
        values, keep = _z_scored(table, columns[1], standard.session, values, keep)
    parts = {"": keep}
    if by is not None:
        texts_required(table, by, rows=named)
        of_row = table.columns[by].astype(str).to_numpy()
        parts = {str(name): keep & (of_row == name) for name in np.unique(of_row[keep])}
    return {
        name: _votes(table, columns, values, rows, levels, standard, screening)
        for name, rows in parts.items()
    }


def _scored_rows(table: TextTable, columns: tuple[str, str, str], standard: Standard) -> Array:
    """The vote of each row, as the method counts it."""
    values = numbers(table, columns[2])
    unusual_numbers(table, columns[2], values, "correct them or leave them empty")
    if standard.method == "dscqs" and standard.reference:
        reference = numbers(table, standard.reference)
        unusual_numbers(table, standard.reference, reference, "correct them or leave them empty")
        return reference - values
    if standard.first:
        texts_required(table, standard.first, rows=rows_with_names(table))
        # the vote compares the second with the first: it counts for the item, so that it is turned if first
        is_first = table.columns[standard.first].astype(str) == table.columns[columns[0]].astype(str)
        if is_first.all() or not is_first.any():
            table.decisions.append(
                f"every item was shown {'first' if is_first.all() else 'second'}, so the order is confounded "
                "with the item"
            )
        return np.where(is_first.to_numpy(), -values, values)
    return values


def _z_scored(
    table: TextTable, participant: str, session: str | None, values: Array, keep: Flags
) -> tuple[Array, Flags]:
    """Standardized votes, and the rows that have one."""
    units = table.columns[participant].astype(str)
    if session is not None:
        texts_required(table, session, rows=keep)
        units = units + ", " + table.columns[session].astype(str)
    names, codes = np.unique(units.to_numpy()[keep].astype(str), return_inverse=True)
    z = np.full(values.size, np.nan)
    z[keep] = standardized_votes(values[keep], codes.astype(np.int64))
    flat = np.bincount(codes, np.isnan(z[keep])) > 0
    if flat.any():
        table.decisions.append(f"excluded, since their votes do not vary: {names_where(list(names), flat)}")
    if flat.all():
        raise InputError(f"{table.source}: nobody's votes vary, so there are no z-scores; remove --z-scores")
    return z, keep & np.isfinite(z)


def _votes(
    table: TextTable,
    columns: tuple[str, str, str],
    values: Array,
    keep: Flags,
    levels: Sequence[str],
    standard: Standard,
    screening: Screening | None,
) -> Votes:
    item, participant, _ = columns
    people, person = np.unique(table.columns[participant].astype(str).to_numpy()[keep], return_inverse=True)
    items = names_in_order(table.columns[item], keep)
    orders, said = given_orders({item: items}, levels)
    items = orders.get(item, items)
    which = pd.Categorical(table.columns[item].astype(str)[keep], items).codes.astype(np.int64)
    totals, counts = np.zeros((people.size, len(items))), np.zeros((people.size, len(items)))
    np.add.at(totals, (person, which), values[keep])
    np.add.at(counts, (person, which), 1.0)
    scores = np.divide(totals, counts, out=np.full_like(totals, np.nan), where=counts > 0)
    squares = np.zeros_like(totals)
    np.add.at(squares, (person, which), (values[keep] - scores[person, which]) ** 2)
    decisions = [*table.decisions, *said]
    stays = np.ones(people.size, dtype=bool)
    if screening is not None:
        reasons = screen_raters(scores, screening, _conditions(table, standard.condition, which, items, keep))
        stays[list(reasons)] = False
        rule = {"bt500": "BT.500", "p913": "P.913"}[screening["rule"]]
        decisions += [f"{rule} excluded {people[k]}: {why}" for k, why in reasons.items()]
        if not reasons:
            decisions.append(f"{rule} excluded nobody")
        elif 2 * len(reasons) > people.size:
            decisions.append(f"{rule} excluded more than half of the raters, who hardly agree at all")
    votes = Votes(
        scores[stays],
        counts[stays],
        squares[stays],
        tuple(str(one) for one in people[stays]),
        items,
        tuple(values[keep][(which == index) & stays[person]] for index in range(len(items))),
        table.source,
        table.synthetic,
        tuple(decisions),
    )
    if standard.method != "acr-hr":
        return votes
    named = table.columns[standard.reference].astype(str).to_numpy()[keep]
    return _against_references(votes, which, named, standard)


def _conditions(
    table: TextTable, column: str | None, which: Codes, items: Sequence[str], keep: Flags
) -> Codes | None:
    """The condition of each item."""
    if column is None:
        return None
    texts_required(table, column, rows=keep)
    names, codes = np.unique(table.columns[column].astype(str).to_numpy()[keep], return_inverse=True)
    if len(names) < CONDITIONS_MIN:
        raise InputError(
            f"expected {CONDITIONS_MIN} conditions or more in '{column}', got {len(names)}; omit --condition"
        )
    of_item = np.zeros(len(items), dtype=np.int64)
    # The last row of an item wins, and the next line finds rows that say otherwise.
    of_item[which] = codes
    if (different := of_item[which] != codes).any():
        item = items[int(which[different][0])]
        raise InputError(
            f"item '{item}' has several values of '{column}'; expected one condition for each item"
        )
    return of_item


def _against_references(votes: Votes, which: Codes, named: NDArray[Any], standard: Standard) -> Votes:
    """Each person's votes against that person's vote on the hidden reference of the item."""
    references = np.full(len(votes.items), -1, dtype=np.int64)
    for index, name in enumerate(votes.items):
        # An empty cell, or the item's own name, marks a reference.
        given = {text for text in np.unique(named[which == index]) if text not in ("", name)}
        if len(given) > 1:
            told = ", ".join(sorted(given)[:NAMED_MAX])
            raise InputError(f"{votes.source}: item '{name}' has several references: {told}; expected one")
        for text in given:
            if text not in votes.items:
                raise InputError(f"{votes.source}: nobody rated '{text}', the reference of '{name}'")
            references[index] = votes.items.index(text)
    if (references < 0).all():
        raise InputError(
            f"{votes.source}: column '{standard.reference}' names no reference; expected the hidden "
            "reference's item in the rows of the other items"
        )
    scores = differential_scores(votes.scores, references, standard.highest or 0.0, standard.crush)
    # A person who did not rate the reference has no score on its items: the vote says nothing alone.
    lost = np.isfinite(votes.scores) & ~np.isfinite(scores) & (references >= 0)
    decisions = list(votes.decisions)
    if lost.any():
        told = names_where(votes.people, np.any(lost, axis=1))
        decisions.append(
            f"{counted(int(lost.sum()), 'vote')} excluded, without a vote on the reference by {told}"
        )
    # References themselves do not appear in the result.
    kept = (references >= 0) & np.isfinite(scores).any(axis=0)
    people = np.any(np.isfinite(scores[:, kept]), axis=1)
    scores = scores[np.ix_(people, kept)]
    # Each difference counts once, whatever number of votes it was the mean of.
    there = np.isfinite(scores)
    return Votes(
        scores,
        there.astype(np.float64),
        np.zeros_like(scores),
        tuple(name for name, stays in zip(votes.people, people.tolist(), strict=True) if stays),
        tuple(name for name, stays in zip(votes.items, kept.tolist(), strict=True) if stays),
        tuple(column[np.isfinite(column)] for column in scores.T),
        votes.source,
        votes.synthetic,
        tuple(decisions),
    )
