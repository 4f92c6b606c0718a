"""Who gave the opinions: bias, inconsistency, agreement with the others, and BT.500's ruling."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.opinion.projection import Projection

Array = NDArray[np.float64]


@dataclass(frozen=True)
class PersonScore:
    """One person: bias against the others, inconsistency, correlation with the MOS, and BT.500's ruling.

    `bias`, `inconsistency` and `group` (the number of the items' group) are None for people of one vote.
    Whose inconsistency fell to nothing has `common_weight`: the one that all people have in common.
    """

    name: str
    n: int
    bias: float | None
    inconsistency: float | None
    common_weight: bool
    group: int | None
    correlation: float | None
    rejected_bt500: bool


def person_scores(
    names: Sequence[str], scores: Array, counts: Array, model: Projection
) -> tuple[PersonScore, ...]:
    """Scores of each person from votes (people, items), NaN where none, and their numbers."""
    rejected = bt500_rejects(scores)
    mos = np.nanmean(scores, axis=0)
    people = []
    for index, name in enumerate(names):
        row = scores[index]
        seen = np.isfinite(row)
        varied = seen.sum() > 2 and np.ptp(row[seen]) > 0 and np.ptp(mos[seen]) > 0
        told = model.person_groups[index] >= 0
        people.append(
            PersonScore(
                name,
                int(counts[index].sum()),
                float(model.bias[index]) if told else None,
                float(model.inconsistency[index]) if told else None,
                bool(model.held[index]),
                int(model.person_groups[index]) + 1 if told else None,
                float(np.corrcoef(row[seen], mos[seen])[0, 1]) if varied else None,
                bool(rejected[index]),
            )
        )
    return tuple(people)


def bt500_rejects(scores: Array) -> NDArray[np.bool_]:
    """Screen people by ITU-R BT.500: too many votes far from an item's mean, on both sides alike (people,).

    A vote is far beyond 2 SD of the item's votes where their kurtosis is between 2 and 4, beyond sqrt(20) SD
    elsewhere; a person goes where more than 5% of the votes are far and the sides differ by less than 30%.
    Items of one vote, or of which all votes are alike, have no vote that is far.
    """
    n = np.isfinite(scores).sum(axis=0)
    centred = scores - np.nanmean(scores, axis=0)
    squares = np.nansum(centred**2, axis=0)
    varied = squares > 0
    sd = np.sqrt(squares / np.maximum(n - 1, 1))
    fourth = np.nansum(centred**4, axis=0)
    kurtosis = np.divide(fourth * n, squares**2, out=np.zeros_like(squares), where=varied)
    limit = np.where((kurtosis >= 2) & (kurtosis <= 4), 2.0, np.sqrt(20.0)) * sd
    above = np.sum((centred >= limit) & varied, axis=1)
    below = np.sum((centred <= -limit) & varied, axis=1)
    share = (above + below) / np.sum(np.isfinite(scores), axis=1)
    lean = np.abs(above - below) / np.maximum(above + below, 1)
    return np.asarray((share > 0.05) & (lean < 0.3))
