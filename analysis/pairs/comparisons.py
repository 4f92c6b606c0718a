"""Paired comparisons as they were made: reading, connectedness and transitivity."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from analysis.read.number_columns import MISSING_MARKS
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

# Read paired comparisons: who won, by side, with every doubt about the table raised as one line.

LEFT, RIGHT, TIE = 0, 1, 2
EXPORTED_SIDES = {"kind", "left_cell", "right_cell"}
"""Columns by which the server's export is known."""
Codes = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Comparisons:
    """Comparisons of items.

    Attributes
    ----------
    items : tuple of str
        Names: sorted as text, or in declared order.
    left, right : (n,) int64
        Index into `items` of what stood on each side (or came first and second).
    outcome : (n,) int64
        `LEFT`, `RIGHT` or `TIE`.
    participant : (n,) int64 or None
        Index into `participants`.
    content : (n,) array of str or None
        What was shown in both items, where a column names it.
    question : (n,) array of str or None
        What raters were asked, where a column names it.
    """

    items: tuple[str, ...]
    left: Codes
    right: Codes
    outcome: Codes
    participant: Codes | None
    participants: tuple[str, ...]
    source: str
    synthetic: bool
    decisions: tuple[str, ...]
    content: NDArray[Any] | None = None
    question: NDArray[Any] | None = None

    def by_question(self) -> dict[str, "Comparisons"]:
        """The comparisons of each question; of all, under an empty name, if there is one question."""
        if self.question is None:
            return {"": self}
        # Each part has its own items: a question may have been about some of them only.
        return {
            name: self._subset(self.question == name, name) for name in map(str, np.unique(self.question))
        }

    def by_content(self, alone: str = "all") -> dict[str, "Comparisons"]:
        """The comparisons of each content, and of all together if contents share their items.

        Without contents the one entry has the name `alone`.
        """
        if self.content is None:
            return {alone: self}
        parts = {name: self._subset(self.content == name, name) for name in map(str, np.unique(self.content))}
        parts = {name: replace(own, content=None) for name, own in parts.items()}
        if "all" in parts:
            raise InputError(f"{self.source}: a content is called all, as all contents together; rename it")
        # Contents that share no item have no common scale, so that all together could not be fitted.
        shared = len(_components(self, strong=False)) == 1
        return {**({"all": self} if shared and len(parts) > 1 else {}), **parts}

    def _subset(self, rows: NDArray[np.bool_], name: str) -> "Comparisons":
        """Some comparisons; items and raters without one are left out."""
        used, sides = np.unique(np.stack([self.left[rows], self.right[rows]]), return_inverse=True)
        # The shape of the inverse has changed between versions of numpy.
        sides = sides.reshape(2, -1)
        people, raters = self.participant, self.participants
        if people is not None:
            there, people = np.unique(people[rows], return_inverse=True)
            raters = tuple(raters[k] for k in there)
        return replace(
            self,
            items=tuple(self.items[k] for k in used),
            left=sides[0].astype(np.int64),
            right=sides[1].astype(np.int64),
            outcome=self.outcome[rows],
            participant=people,
            participants=raters,
            source=f"{self.source}, {name}",
            content=None if self.content is None else self.content[rows],
            question=None,
        )

    @property
    def ties(self) -> int:
        """How many comparisons ended in a tie."""
        return int(np.sum(self.outcome == TIE))


def read_comparisons(
    path: Path,
    left: str,
    right: str,
    winner: str,
    tie: str | None = None,
    participant: str | None = None,
    levels: Sequence[str] = (),
    by: str | None = None,
    question: str | None = None,
    same: bool = False,
) -> Comparisons:
    """Read one row per comparison.

    Of the server's export only main trials count, without failed plays and runs excluded by hand.

    Parameters
    ----------
    path : Path
        CSV; ids are text, leading zeros stay.
    left, right, winner : str
        Columns. A cell of `winner` is `left`, `right`, the name of one of the row's two items, or `tie`.
    tie : str, optional
        The value of `winner` for a tie.
    participant : str, optional
        Column that names the rater.
    levels : sequence of str, optional
        Order of the items, as that of the column `left`.
    by : str, optional
        Column that names the content of both items.
    question : str, optional
        Column that names what raters were asked.
    same : bool
        Whether comparisons of an item with itself are kept.

    Raises
    ------
    InputError
        As `read_text_table`; a pair of an item with itself; a winner that is none of the two; a `tie` that
        is an item or a side.
    """
    more = [name for name in (participant, by, question) if name]
    roles = [left, right, winner, *more]
    refuse_shared_roles(roles)
    table = read_text_table(path, roles, EXPORT_COLUMNS)
    counting = rows_with_names(table, EXPORTED_SIDES)
    for name in (left, right, *more):
        texts_required(table, name, rows=counting)
    # Ids are compared as text: leading zeros are a part of them.
    columns = {name: table.columns[name].astype(str).to_numpy() for name in roles}
    if same:
        _report_same(table, counting & (columns[left] == columns[right]))
    else:
        _refuse_same(table, columns[left], counting & (columns[left] == columns[right]))
    outcome, judged = _outcomes(table, columns[left], columns[right], columns[winner], winner, tie)
    # An export has practice and failed plays as well; other tables have rows that count only.
    judged = answers_that_count(table, judged, "comparisons", roles, EXPORTED_SIDES)
    items = _items(table.columns[left], table.columns[right], judged)
    orders, said = given_orders({left: items}, levels)
    items = orders.get(left, items)
    people: tuple[str, ...] = ()
    codes = None
    if participant is not None:
        # hashed: to sort a million texts takes a second
        codes, names = pd.factorize(columns[participant][judged], sort=True)
        people = tuple(str(name) for name in names)
    return Comparisons(
        items,
        _indices(items, columns[left][judged]),
        _indices(items, columns[right][judged]),
        outcome[judged],
        None if codes is None else codes.astype(np.int64),
        people,
        path.name,
        table.synthetic,
        (*table.decisions, *said),
        columns[by][judged] if by else None,
        columns[question][judged] if question else None,
    )


def _report_same(table: TextTable, same: NDArray[np.bool_]) -> None:
    if same.any():
        number = int(same.sum())
        table.decisions.append(
            f"{counted(number, 'comparison')} of an item with itself "
            f"{'counts' if number == 1 else 'count'} in the prior only ({name_lines(table, same)})"
        )


def _items(left: "pd.Series[Any]", right: "pd.Series[Any]", judged: NDArray[np.bool_]) -> tuple[str, ...]:
    """Items of either side: in the order of their codes where both sides have codes, else sorted."""
    names = (*names_in_order(left, judged), *names_in_order(right, judged))
    coded = left.cat.ordered and right.cat.ordered
    # Text sorts 10 before 2, so codes give the better order where both sides have them.
    return tuple(dict.fromkeys(names)) if coded else tuple(sorted(set(names)))


def _indices(items: tuple[str, ...], names: NDArray[Any]) -> Codes:
    return pd.Index(items, dtype=object).get_indexer(pd.Index(names, dtype=object)).astype(np.int64)


def _refuse_same(table: TextTable, left: NDArray[Any], same: NDArray[np.bool_]) -> None:
    if same.any():
        row = int(np.argmax(same))
        raise InputError(f"{table.source}: line {table.line(row)} compares '{left[row]}' with itself")


def _outcomes(
    table: TextTable,
    left: NDArray[Any],
    right: NDArray[Any],
    said: NDArray[Any],
    winner: str,
    tie: str | None,
) -> tuple[Codes, NDArray[np.bool_]]:
    """Return the outcome of each row, and which rows have one."""
    sides = {"left": LEFT, "right": RIGHT}
    names = {*pd.unique(left), *pd.unique(right)}
    # Then the answer left could mean the side or the item.
    confused = sides.keys() & {name.casefold() for name in names}
    if confused:
        name = min(confused)
        raise InputError(f"{table.source}: an item is called '{name}', like a side; rename the item")
    if tie is not None:
        _refuse_tie(table, tie, names)
    # -1 marks rows whose outcome is not known yet.
    outcome = np.full(left.size, -1, dtype=np.int64)
    # A few different answers, though rows may be a million.
    for answer in pd.unique(said):
        if (side := answer.casefold()) in sides:
            outcome[said == answer] = sides[side]
    if tie is not None:
        outcome[said == tie] = TIE
    # Last: an item whose name is also the word for a tie was refused above.
    outcome[said == left] = LEFT
    outcome[said == right] = RIGHT
    # A mark of a missing value is one only where it is neither an item's name nor the word for a tie.
    missing = np.isin(said, [mark for mark in MISSING_MARKS if mark != tie]) & (outcome < 0)
    _refuse_unknown(table, outcome, missing, said, winner)
    if missing.any():
        lines = name_lines(table, missing)
        table.decisions.append(f"{counted(int(missing.sum()), 'row')} without a winner excluded ({lines})")
    if missing.all():
        raise InputError(f"{table.source}: column '{winner}' names no winner in any row")
    return outcome, ~missing


def _refuse_tie(table: TextTable, tie: str, items: set[str]) -> None:
    """Refuse a word for ties that names a winner as well."""
    other = "an item" if tie in items else "a side" if tie.casefold() in ("left", "right") else ""
    if other:
        raise InputError(
            f"{table.source}: --tie {tie} is also {other}; expected a word that names no winner. Use another "
            "word in the rows that are ties"
        )


def _refuse_unknown(
    table: TextTable, outcome: Codes, missing: NDArray[np.bool_], said: NDArray[Any], winner: str
) -> None:
    unknown = (outcome < 0) & ~missing
    if unknown.any():
        row = int(np.argmax(unknown))
        raise InputError(
            f"{table.source}: '{winner}' is '{said[row]}' in line {table.line(row)}; expected left, right or "
            f"one of the row's two items (if it means a tie: --tie {said[row]})"
        )


# Whether comparisons tie all items together, and whether each has won and lost enough to be placed.

NAMED_MAX = 6


def refuse_disconnected(comparisons: Comparisons) -> None:
    """Refuse items that no chain of comparisons joins: their abilities have no common scale.

    Raises
    ------
    InputError
    """
    groups = _components(comparisons, strong=False)
    if len(groups) > 1:
        told = " | ".join(_named(group) for group in groups[:NAMED_MAX])
        raise InputError(
            f"{comparisons.source}: the items form {len(groups)} groups that were never compared: {told}; "
            "compare some across groups, or analyze each group separately"
        )


def separated_items(comparisons: Comparisons) -> str | None:
    """Say which items won (or lost) every comparison with the rest; None where none did.

    Ford (1957), American Mathematical Monthly 64(8), 28: the maximum exists if and only if, however the
    items are parted in two, each part won at least once against the other; a tie counts for both.
    """
    groups = _components(comparisons, strong=True)
    # Strongly connected: from each item a chain of wins leads to every other.
    if len(groups) == 1:
        return None
    wins = _wins(comparisons)
    position = {item: index for index, item in enumerate(comparisons.items)}
    # The smallest first: one item that always wins is plainer to name than all others that always lose.
    for group in sorted(groups, key=len):
        inside = np.zeros(len(comparisons.items), dtype=bool)
        inside[[position[item] for item in group]] = True
        lost, won = wins[~inside][:, inside].sum(), wins[inside][:, ~inside].sum()
        if won and not lost:
            return f"{_named(group)} won every comparison with the others"
        if lost and not won:
            return f"{_named(group)} lost every comparison with the others"
    # Only without any comparison between groups: otherwise one of them won or lost all.
    return f"{_named(groups[0])} won or lost every comparison with the others"


def _wins(comparisons: Comparisons) -> np.ndarray:
    """(k, k): how often the row's item won against the column's, ties for both."""
    wins = np.zeros((len(comparisons.items),) * 2, dtype=np.int64)
    for_left, for_right = comparisons.outcome != RIGHT, comparisons.outcome != LEFT
    # Not `+=`, which counts a pair that occurs several times only once.
    np.add.at(wins, (comparisons.left[for_left], comparisons.right[for_left]), 1)
    np.add.at(wins, (comparisons.right[for_right], comparisons.left[for_right]), 1)
    return wins


def _components(comparisons: Comparisons, *, strong: bool) -> list[list[str]]:
    graph = coo_array(_wins(comparisons))
    count, labels = connected_components(graph, directed=True, connection="strong" if strong else "weak")
    names = np.array(comparisons.items, dtype=object)
    return [list(names[labels == label]) for label in range(count)]


def _named(items: list[str]) -> str:
    rest = len(items) - NAMED_MAX
    return ", ".join(items[:NAMED_MAX]) + (f" and {rest} more" if rest > 0 else "")


# Whether preferences form an order: triples of items, and circles within a rater.


@dataclass(frozen=True)
class Transitivity:
    """Triples of items a, b, c with P(a over b) >= .5 and P(b over c) >= .5, all three compared.

    Weak transitivity asks P(a over c) >= .5, moderate >= the smaller, strong >= the greater of the two
    (Coombs 1964).

    Attributes
    ----------
    circular_triads : int
        Circles a > b > c > a within raters who judged every pair once without a tie (Kendall & Babington
        Smith 1940, Biometrika 31, 324), with the most that could be.
    """

    triples: int
    weak_violations: int
    moderate_violations: int
    strong_violations: int
    raters_with_all_pairs: int
    circular_triads: int
    circular_triads_max: int


def transitivity(comparisons: Comparisons) -> Transitivity:
    """Count violations; ties are half a win for each."""
    shares, compared = _shares(comparisons, np.ones(comparisons.outcome.size, dtype=bool))
    violations = np.zeros(3, dtype=np.int64)
    triples = 0
    for triple in combinations(range(len(comparisons.items)), 3):
        # A triple with a pair that nobody compared cannot be judged.
        if all(compared[one, other] for one, other in combinations(triple, 2)):
            triples += 1
            violations += _violations(shares, triple)
    raters, circles, greatest = _circles(comparisons)
    weak, moderate, strong = violations.tolist()
    return Transitivity(triples, weak, moderate, strong, raters, circles, greatest)


def _violations(shares: NDArray[np.float64], triple: tuple[int, ...]) -> NDArray[np.int64]:
    """Whether a triple breaks weak, moderate and strong transitivity, by its most favourable order."""
    best = np.ones(3, dtype=np.int64)
    first, second, third = triple
    for a, b, c in (
        (first, second, third),
        (first, third, second),
        (second, first, third),
        (second, third, first),
        (third, first, second),
        (third, second, first),
    ):
        ab, bc, ac = shares[a, b], shares[b, c], shares[a, c]
        if ab >= 0.5 and bc >= 0.5:
            # With ties several orders qualify; a triple counts as broken only if every order is.
            best = np.minimum(best, np.array([ac < 0.5, ac < min(ab, bc), ac < max(ab, bc)], dtype=np.int64))
    return best


def _shares(
    comparisons: Comparisons, rows: NDArray[np.bool_]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(k, k) share of wins of the row's item over the column's, and how often they were compared."""
    size = len(comparisons.items)
    wins, compared = np.zeros((size, size)), np.zeros((size, size))
    left, right, outcome = comparisons.left[rows], comparisons.right[rows], comparisons.outcome[rows]
    # A tie is half a win for each, so that shares of a pair sum to 1.
    for_left = np.where(outcome == LEFT, 1.0, np.where(outcome == TIE, 0.5, 0.0))
    np.add.at(wins, (left, right), for_left)
    np.add.at(wins, (right, left), 1.0 - for_left)
    np.add.at(compared, (left, right), 1.0)
    np.add.at(compared, (right, left), 1.0)
    return np.divide(wins, compared, out=np.full_like(wins, np.nan), where=compared > 0), compared


def _circles(comparisons: Comparisons) -> tuple[int, int, int]:
    r"""Raters with all pairs once, their circular triads, and the greatest number possible.

    .. math::

        d &= \binom{n}{3} - \sum_i \binom{w_i}{2} \tag{1} \\
        d_{\max} &= (n^3 - n) / 24 \text{ for odd } n, \; (n^3 - 4 n) / 24 \text{ for even} \tag{2}

    w_i is how often item i of n won: a triad that is not a circle has one item that won both its pairs
    (Kendall and Babington Smith 1940).
    """
    size = len(comparisons.items)
    raters = circles = 0
    most_each = (size**3 - size) // 24 if size % 2 else (size**3 - 4 * size) // 24
    if comparisons.participant is None:
        return 0, 0, 0
    answers = np.bincount(comparisons.participant)
    # nobody else can have judged every pair once
    for rater in np.flatnonzero(answers == size * (size - 1) // 2):
        shares, compared = _shares(comparisons, comparisons.participant == rater)
        once = compared[np.triu_indices(size, 1)]
        # Skips raters with the right number of answers who judged a pair twice, or gave a tie.
        if np.all(once == 1.0) and not np.any(shares == 0.5):
            wins = np.nansum(np.where(np.eye(size, dtype=bool), 0.0, shares), axis=1)
            raters += 1
            # Rounded: halves and thirds in floating point, but a whole number by definition.
            circles += round(size * (size - 1) * (size - 2) / 6 - float(np.sum(wins * (wins - 1) / 2)))
    return raters, circles, raters * most_each
