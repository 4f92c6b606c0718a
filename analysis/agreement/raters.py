"""Agreement of people who rated the same items: intraclass correlations and Krippendorff's alpha."""

import warnings
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.opinion.scores import Votes
from experiments.errors import InputError

Floats = NDArray[np.float64]
Level = Literal["nominal", "ordinal", "interval", "ratio"]
LEVELS: tuple[Level, ...] = get_args(Level)

RESAMPLES = 1000
SEED = 1


@dataclass(frozen=True)
class IntraclassCorrelation:
    """One form of the coefficient (Shrout & Fleiss 1979) with its F test and 95% interval."""

    form: str
    meaning: str
    icc: float
    ci_low: float
    ci_high: float
    f_value: float
    df_effect: float
    df_error: float
    p_value: float


@dataclass(frozen=True)
class Agreement:
    """How far people say the same of the same items.

    Attributes
    ----------
    krippendorff_alpha : float
        Over all ratings, missing ones allowed; `ci_low`, `ci_high` by resampling items.
    icc : tuple of IntraclassCorrelation
        All forms, over the items that everybody rated; empty with `icc_reason` where there are too few.
    n_complete_items : int
        Items that everybody rated.
    """

    level: Level
    krippendorff_alpha: float
    ci_low: float
    ci_high: float
    icc: tuple[IntraclassCorrelation, ...]
    icc_reason: str
    n_people: int
    n_items: int
    n_complete_items: int
    n_ratings: int
    decisions: tuple[str, ...]


_MEANINGS = {
    "ICC(1,1)": "one rating, people differ from item to item",
    "ICC(A,1)": "one rating, absolute agreement",
    "ICC(C,1)": "one rating, consistency",
    "ICC(1,k)": "mean of all ratings, people differ from item to item",
    "ICC(A,k)": "mean of all ratings, absolute agreement",
    "ICC(C,k)": "mean of all ratings, consistency",
}


def agreement(votes: Votes, level: Level = "interval") -> Agreement:
    """How far people agree.

    Parameters
    ----------
    votes : Votes
        Several ratings that a person gave to an item count as their mean.
    level : {"nominal", "ordinal", "interval", "ratio"}
        What differences between ratings mean; the distance of Krippendorff's alpha.

    Raises
    ------
    InputError
        Fewer than two people or items, no item with two ratings, ratings that do not vary, or ratio data
        below zero.

    References
    ----------
    Krippendorff, K. (2011). Computing Krippendorff's alpha-reliability. Shrout, P. E. & Fleiss, J. L.
    (1979), Psychological Bulletin 86, 420-428; names of forms by McGraw, K. O. & Wong, S. P. (1996),
    Psychological Methods 1, 30-46.
    """
    scores = _usable(votes, level)
    low, high = _interval(scores, level)
    complete = np.isfinite(scores).all(axis=0)
    icc, reason = _intraclass(scores[:, complete])
    return Agreement(
        level,
        _krippendorff(scores, level),
        low,
        high,
        icc,
        reason,
        scores.shape[0],
        scores.shape[1],
        int(complete.sum()),
        int(np.isfinite(scores).sum()),
        _decisions(votes),
    )


def _usable(votes: Votes, level: Level) -> Floats:
    """Ratings (people, items) of the items that two people or more rated."""
    scores = votes.scores[:, np.isfinite(votes.scores).sum(axis=0) >= 2]
    # Who rated only items that nobody else did tells nothing either.
    scores = scores[np.isfinite(scores).any(axis=1)]
    if len(scores) < 2 or scores.shape[1] < 2:
        raise InputError(
            f"{votes.source}: expected two people or more on each of two items or more, got "
            f"{len(votes.people)} people and {scores.shape[1]} items that two of them rated"
        )
    given = scores[np.isfinite(scores)]
    if np.ptp(given) == 0:
        raise InputError(f"{votes.source}: every rating is {given[0]:g}; agreement needs ratings that vary")
    if level == "ratio" and given.min() < 0:
        raise InputError(f"{votes.source}: ratio data cannot be below zero, got {given.min():g}")
    return np.asarray(scores, dtype=np.float64)


def _decisions(votes: Votes) -> tuple[str, ...]:
    repeated = int((votes.counts > 1).sum())
    alone = int((np.isfinite(votes.scores).sum(axis=0) < 2).sum())
    said = list(votes.decisions)
    if repeated:
        said.append(f"{repeated} times a person rated an item more than once; the mean counts")
    if alone:
        said.append(f"{alone} items rated by one person tell nothing of agreement and are left out")
    return tuple(said)


def _krippendorff(scores: Floats, level: Level) -> float:
    import krippendorff

    return float(krippendorff.alpha(reliability_data=scores, level_of_measurement=level))


def _interval(scores: Floats, level: Level) -> tuple[float, float]:
    """Percentile interval over items drawn with replacement; draws in which nothing varies do not count."""
    random = np.random.default_rng(SEED)
    items = scores.shape[1]
    values = []
    for _ in range(RESAMPLES):
        drawn = scores[:, random.integers(items, size=items)]
        if np.ptp(drawn[np.isfinite(drawn)]) > 0:
            values.append(_krippendorff(drawn, level))
    low, high = np.quantile(values, [0.025, 0.975])
    return float(low), float(high)


def _intraclass(complete: Floats) -> tuple[tuple[IntraclassCorrelation, ...], str]:
    import pingouin

    people, items = complete.shape
    if items < 3:
        return (), f"{items} items were rated by everybody; intraclass correlations need three or more"
    if np.ptp(complete) == 0:
        return (), "the items that everybody rated do not vary"
    person, item = np.meshgrid(np.arange(people), np.arange(items), indexing="ij")
    long = pd.DataFrame({"person": person.ravel(), "item": item.ravel(), "rating": complete.ravel()})
    # pingouin rounds intervals to two decimals unless told otherwise
    rounding = pingouin.options.copy()
    pingouin.options["round.column.CI95"] = None
    try:
        with warnings.catch_warnings():  # pingouin's own, about pandas
            warnings.simplefilter("ignore")
            table = pingouin.intraclass_corr(data=long, targets="item", raters="person", ratings="rating")
    finally:
        pingouin.options.update(rounding)
    return tuple(_form(row) for row in table.to_dict("records")), ""


def _form(row: dict[str, object]) -> IntraclassCorrelation:
    low, high = np.asarray(row["CI95"], dtype=np.float64)
    number = {key: float(str(row[key])) for key in ("ICC", "F", "df1", "df2", "pval")}
    form = str(row["Type"])
    return IntraclassCorrelation(
        form,
        _MEANINGS[form],
        number["ICC"],
        float(low),
        float(high),
        number["F"],
        number["df1"],
        number["df2"],
        number["pval"],
    )
