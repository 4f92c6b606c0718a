"""Mean opinion scores with intervals, and a model of who gave them."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import stats

from analysis.opinion.doubts import doubts
from analysis.opinion.people import PersonScore, person_scores
from analysis.opinion.projection import Projection, alternating_projection
from analysis.read.number_columns import numbers, unusual_numbers
from analysis.read.text_table import (
    name_lines,
    names_in_order,
    read_text_table,
    refuse_shared_roles,
    texts_required,
)
from experiments.errors import InputError

Array = NDArray[np.float64]
Repeats = Literal["mean", "votes"]


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


@dataclass(frozen=True)
class ItemScore:
    """One item. mos, sd (n - 1), se and the 95% interval (t with n - 1); `recovered` from the model.

    What does not exist (an SD of one vote, a recovered score where only people of one vote rated) is NaN.
    `group` numbers the items that raters tie together from 1; None where nothing was recovered.
    """

    name: str
    mos: float
    sd: float
    n: int
    se: float
    ci_low: float
    ci_high: float
    recovered: float
    recovered_se: float
    recovered_ci_low: float
    recovered_ci_high: float
    group: int | None


@dataclass(frozen=True)
class OpinionResult:
    """Everything `analysis opinion` knows of a table."""

    items: tuple[ItemScore, ...]
    participants: tuple[PersonScore, ...]
    n_votes: int
    repeats: Repeats
    iterations: int
    n_groups: int
    decisions: tuple[str, ...]


def read_votes(path: Path, item: str, participant: str, rating: str) -> Votes:
    """Read one row a vote.

    Raises
    ------
    InputError
        As `read_text_table`; a rating that is no number, no rating at all.
    """
    roles = [item, participant, rating]
    refuse_shared_roles(roles)
    table = read_text_table(path, roles, ("synthetic",))
    for name in roles[:2]:
        texts_required(table, name)
    values = numbers(table, rating)
    unusual_numbers(table, rating, values, "correct them or leave them empty")
    keep = np.isfinite(values)
    if not keep.all():
        lines = name_lines(table, ~keep)
        table.decisions.append(f"{int((~keep).sum())} rows without a rating left out ({lines})")
    if not keep.any():
        raise InputError(f"{path.name}: '{rating}' holds no rating in any row")
    people, person = np.unique(table.columns[participant].astype(str).to_numpy()[keep], return_inverse=True)
    items = names_in_order(table.columns[item], keep)
    which = pd.Categorical(table.columns[item].astype(str)[keep], items).codes.astype(np.int64)
    totals, counts = np.zeros((people.size, len(items))), np.zeros((people.size, len(items)))
    np.add.at(totals, (person, which), values[keep])
    np.add.at(counts, (person, which), 1.0)
    scores = np.divide(totals, counts, out=np.full_like(totals, np.nan), where=counts > 0)
    squares = np.zeros_like(totals)
    np.add.at(squares, (person, which), (values[keep] - scores[person, which]) ** 2)
    return Votes(
        scores,
        counts,
        squares,
        tuple(str(one) for one in people),
        items,
        tuple(values[keep][which == index] for index in range(len(items))),
        path.name,
        table.synthetic,
        tuple(table.decisions),
    )


def fit_opinion(votes: Votes, repeats: Repeats = "mean") -> OpinionResult:
    """Compute opinion scores.

    Parameters
    ----------
    votes : Votes
    repeats : {"mean", "votes"}
        A person's repeated votes on an item count as their mean (n is people) or each by itself (n is votes),
        in the opinion scores and in the recovered ones.

    Raises
    ------
    InputError
        Fewer than two people or items.
    """
    if len(votes.people) < 2 or len(votes.items) < 2:
        raise InputError(
            f"{votes.source}: expected two people and two items or more, got {len(votes.people)} and "
            f"{len(votes.items)}"
        )
    each = (votes.counts, votes.squares) if repeats == "votes" else ()
    model = alternating_projection(votes.scores, *each)
    decisions = list(votes.decisions)
    if np.any(votes.counts > 1):
        word = "a person's mean counts once" if repeats == "mean" else "every vote counts"
        decisions.append(f"some people rated an item more than once: {word}")
    decisions += doubts(model, votes.people, votes.items)
    return OpinionResult(
        tuple(_item(votes, model, index, repeats) for index in range(len(votes.items))),
        person_scores(votes.people, votes.scores, votes.counts, model),
        int(votes.counts.sum()),
        repeats,
        model.iterations,
        int(model.groups.max()) + 1,
        tuple(decisions),
    )


def _item(votes: Votes, model: Projection, index: int, repeats: Repeats) -> ItemScore:
    column = votes.scores[:, index]
    values = votes.all_votes[index] if repeats == "votes" else column[np.isfinite(column)]
    n, mos = values.size, float(values.mean())
    sd = float(values.std(ddof=1)) if n > 1 else float("nan")
    se = sd / float(np.sqrt(n))
    half = float(stats.t.ppf(0.975, n - 1)) * se if n > 1 else float("nan")
    recovered, error = float(model.quality[index]), float(model.quality_se[index])
    wide = float(stats.norm.ppf(0.975)) * error
    return ItemScore(
        votes.items[index],
        mos,
        sd,
        n,
        se,
        mos - half,
        mos + half,
        recovered,
        error,
        recovered - wide,
        recovered + wide,
        int(model.groups[index]) + 1 if model.groups[index] >= 0 else None,
    )
