"""Whether items measure one thing (reliability), and whether people agree (agreement)."""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.read.number_columns import numbers, unusual_numbers
from analysis.read.text_table import (
    TextTable,
    name_lines,
    read_text_table,
    refuse_shared_roles,
    texts_required,
)
from analysis.votes import Votes
from experiments.errors import InputError
from table_files import counted

# Reliability of a scale made of several items: Cronbach's alpha, McDonald's omega, items, scale scores.

Floats = NDArray[np.float64]

MIN_CASES = 3
MIN_OMEGA_ITEMS = 3
"""One factor of two items is not identified."""
STARTS = 10
"""Starts of the fit of one factor: from a single one it ends, at times, at a lesser maximum, or at none."""
FLAT = 1e-3
"""Slope of the deviance a case, in units of log variance, below which a fit of one factor has ended."""


@dataclass(frozen=True)
class ItemAnswers:
    """Answers to the items of a scale, reverse-keyed ones turned: (cases, items), complete cases alone."""

    answers: Floats = field(repr=False)
    items: tuple[str, ...]
    reverse: tuple[str, ...]
    cases: tuple[str, ...]
    source: str
    synthetic: bool
    decisions: tuple[str, ...]


@dataclass(frozen=True)
class ItemStatistics:
    """An item compared with the others.

    Attributes
    ----------
    item_rest_correlation : float
        Pearson's r with the sum of the other items.
    alpha_without : float or None
        Cronbach's alpha of the others; None for two items, or others whose sum does not vary.
    loading : float or None
        On the one factor, standardized; None where omega is not defined.
    """

    name: str
    mean: float
    sd: float
    item_rest_correlation: float
    alpha_without: float | None
    loading: float | None


@dataclass(frozen=True)
class Reliability:
    """Alpha with Feldt's 95% interval, omega with the reason where it is not defined, items, scale scores."""

    alpha: float
    alpha_low: float
    alpha_high: float
    omega: float | None
    omega_reason: str
    items: tuple[ItemStatistics, ...]
    scores: tuple[tuple[str, float], ...] = field(repr=False)
    n_cases: int
    decisions: tuple[str, ...]


def read_items(
    path: Path,
    items: Sequence[str],
    reverse: Sequence[str] = (),
    scale: tuple[float, float] | None = None,
    case: str | None = None,
) -> ItemAnswers:
    """Read one row per case (a person, or a person's rating of a clip) and one column per item.

    Raises
    ------
    InputError
        Fewer than two items, a reverse-keyed one that is none of them or without the scale's ends, answers
        outside the scale, fewer than three complete cases, an item that does not vary.
    """
    _refuse_items(items, reverse, scale)
    names = [*items, *([case] if case else [])]
    refuse_shared_roles(names)
    table = read_text_table(path, names, ("synthetic",))
    if case:
        texts_required(table, case)
    answers = np.column_stack([numbers(table, name) for name in items])
    for name, column in zip(items, answers.T, strict=True):
        unusual_numbers(table, name, column)
    if scale is not None:
        _refuse_outside(table, items, answers, scale)
        turned = [name in reverse for name in items]
        # Low plus high less the answer turns it about, wherever the scale begins.
        answers[:, turned] = sum(scale) - answers[:, turned]
    keep: NDArray[np.bool_] = np.asarray(np.isfinite(answers).all(axis=1))
    if not keep.all():
        left_out = int((~keep).sum())
        said = f"{left_out} case{'s' * (left_out > 1)} without an answer to every item excluded"
        table.decisions.append(f"{said} ({name_lines(table, ~keep)})")
    if keep.sum() < MIN_CASES:
        raise InputError(f"{path.name}: expected {MIN_CASES} complete cases or more, got {int(keep.sum())}")
    for name, column in zip(items, answers[keep].T, strict=True):
        if np.ptp(column) == 0:
            raise InputError(f"{path.name}: every answer to '{name}' is {column[0]:g}; remove the item")
    if np.ptp(answers[keep].sum(axis=1)) == 0:
        raise InputError(
            f"{path.name}: the sum of the items is the same in every case; name reverse-keyed items with "
            "--reverse"
        )
    cases = (
        list(table.columns[case].astype(str)) if case else [f"line {table.line(i)}" for i in range(len(keep))]
    )
    return ItemAnswers(
        answers[keep],
        tuple(items),
        tuple(reverse),
        tuple(name for name, kept in zip(cases, keep, strict=True) if kept),
        table.source,
        table.synthetic,
        tuple(table.decisions),
    )


def _refuse_items(items: Sequence[str], reverse: Sequence[str], scale: tuple[float, float] | None) -> None:
    if len(items) < 2:
        raise InputError(f"expected two items or more, e.g. --items calm,tense,glad; got {len(items)}")
    for name in reverse:
        if name not in items:
            raise InputError(f"--reverse names '{name}', which is not one of the items {', '.join(items)}")
    if reverse and scale is None:
        raise InputError("--reverse needs the ends of the scale: add, for example, --scale 1:7")


def _refuse_outside(
    table: TextTable, items: Sequence[str], answers: Floats, scale: tuple[float, float]
) -> None:
    outside = np.argwhere((answers < scale[0]) | (answers > scale[1]))
    if len(outside):
        row, column = outside[0]
        raise InputError(
            f"{table.source}: '{items[column]}' is {answers[row, column]:g} in line {table.line(int(row))}, "
            f"outside the scale {scale[0]:g} to {scale[1]:g}"
        )


def reliability(data: ItemAnswers) -> Reliability:
    """Reliability of the items as one scale.

    Alpha and its interval are pingouin's (Feldt, Woodruff & Salih 1987). Omega is McDonald's for one factor,

        omega = (sum lambda_i)^2 / ((sum lambda_i)^2 + sum theta_i),                                   (1)

    where lambda_i is the loading of item i in its own unit and theta_i its variance that the factor does not
    explain, by maximum likelihood (McDonald 1999, Test Theory, eq. 6.20a).
    """
    loadings, reason = _one_factor(data.answers)
    low, high, alpha = _alpha(data.answers)
    spread = data.answers.std(axis=0, ddof=1)
    omega = None
    if loadings is not None:
        common = float((loadings * spread).sum()) ** 2
        # In the items' own units, as scale scores are sums of raw answers and not of standardized ones.
        omega = common / (common + float(((1 - loadings**2) * spread**2).sum()))
    own = [None] * len(data.items) if loadings is None else list(map(float, loadings))
    items = tuple(_item(data, i, loading) for i, loading in enumerate(own))
    scores = tuple(zip(data.cases, map(float, data.answers.mean(axis=1)), strict=True))
    return Reliability(alpha, low, high, omega, reason, items, scores, len(data.answers), data.decisions)


def _alpha(answers: Floats) -> tuple[float, float, float]:
    from pingouin import cronbach_alpha

    alpha, (low, high) = cronbach_alpha(data=pd.DataFrame(answers))
    return float(low), float(high), float(alpha)


def _item(data: ItemAnswers, position: int, loading: float | None) -> ItemStatistics:
    mine, others = data.answers[:, position], np.delete(data.answers, position, axis=1)
    rest = others.sum(axis=1)
    correlation = float(np.corrcoef(mine, rest)[0, 1]) if np.ptp(rest) > 0 else float("nan")
    without = _alpha(others)[2] if others.shape[1] > 1 and np.ptp(rest) > 0 else None
    return ItemStatistics(
        data.items[position], float(mine.mean()), float(mine.std(ddof=1)), correlation, without, loading
    )


def _one_factor(answers: Floats) -> tuple[Floats | None, str]:
    """Standardized loadings on one factor, the sum positive; None with the reason where there are none."""
    n, items = answers.shape
    if items < MIN_OMEGA_ITEMS:
        return None, f"omega needs {MIN_OMEGA_ITEMS} items or more"
    # With no more cases than items the correlations are singular.
    if n <= items:
        return None, f"omega needs more cases than items, got {n} and {items}"
    # Maximum likelihood does not depend on the items' scales, so that correlations are enough.
    correlations: Floats = np.atleast_2d(np.corrcoef(answers, rowvar=False))
    if np.linalg.cond(correlations) > 1e8:
        return None, "an item is determined by the others, so omega is not defined"
    loadings = _likeliest(correlations, n)
    if not np.isfinite(loadings).all() or (np.abs(loadings) > 1 - 1e-6).any():
        return None, "one factor explains an item completely (a Heywood case), so omega is not defined"
    if not _is_maximum(correlations, loadings):
        return None, "the one-factor fit did not converge, so omega is not defined"
    # The sign of a factor is arbitrary.
    return loadings * (np.sign(loadings.sum()) or 1.0), ""


def _likeliest(correlations: Floats, n: int) -> Floats:
    """The likeliest loadings that fits from `STARTS` starts end at, the same starts in every run."""
    from statsmodels.multivariate.factor import Factor
    from statsmodels.tools.sm_exceptions import ConvergenceWarning, EstimationWarning

    model: Any = Factor(corr=correlations, n_factor=1, method="ml", nobs=n)
    with warnings.catch_warnings():
        # the errors of `_one_factor` say more about where it ended: not converged, nothing left of an item
        for sort in (ConvergenceWarning, EstimationWarning):
            warnings.simplefilter("ignore", sort)
        fits = [fit for start in range(STARTS) if (fit := _fit(model, start)) is not None]
        likelihoods = [model.loglike((fit.loadings, fit.uniqueness)) for fit in fits]
    if not fits:
        return np.full(len(correlations), np.nan)
    # A fit that ended in no number must never win.
    best = fits[int(np.argmax(np.nan_to_num(likelihoods, nan=-np.inf)))]
    return np.asarray(best.loadings, dtype=np.float64)[:, 0]


def _fit(model: Any, start: int) -> Any:
    """One fit from a start's random numbers; None where it ended in no numbers."""
    try:
        return model.fit(rng=start)
    except np.linalg.LinAlgError:
        return None


def _is_maximum(correlations: Floats, loadings: Floats) -> bool:
    """Whether the likelihood of one factor is flat at these loadings, in each item's own variance."""
    # Standardized items have a variance of 1, which the factor and the item's own part share.
    implied = np.outer(loadings, loadings)
    np.fill_diagonal(implied, 1.0)
    inverse = np.linalg.inv(implied)
    # Times the item's own variance: a slope by its logarithm, which does not depend on how small it is.
    slopes = np.diag(inverse @ (implied - correlations) @ inverse) * (1 - loadings**2)
    return bool(np.abs(slopes).max() < FLAT)


# Agreement of people who rated the same items: intraclass correlations and Krippendorff's alpha.

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
    "ICC(1,1)": "single rating, different people for each item",
    "ICC(A,1)": "single rating, absolute agreement",
    "ICC(C,1)": "single rating, consistency",
    "ICC(1,k)": "mean of all ratings, different people for each item",
    "ICC(A,k)": "mean of all ratings, absolute agreement",
    "ICC(C,k)": "mean of all ratings, consistency",
}


def agreement(votes: Votes, level: Level = "interval", dimension: str = "") -> Agreement:
    """How far people agree.

    Parameters
    ----------
    votes : Votes
        Several ratings that a person gave to an item count as their mean.
    level : {"nominal", "ordinal", "interval", "ratio"}
        What differences between ratings mean; the distance of Krippendorff's alpha.
    dimension : str
        What was rated, as errors name it where there are several.

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
    if dimension:
        votes = replace(votes, source=f"{votes.source}, {dimension}")
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
    # People who rated only items that nobody else rated say nothing about agreement either.
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
        said.append(f"{repeated} times a person rated an item more than once; their mean was used")
    if alone:
        were = "was" if alone == 1 else "were"
        said.append(f"{counted(alone, 'item')} {were} rated by only one person and {were} excluded")
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
        return (), f"{items} items were rated by everybody; intraclass correlations need at least three"
    if np.ptp(complete) == 0:
        return (), "the items that everybody rated do not vary"
    person, item = np.meshgrid(np.arange(people), np.arange(items), indexing="ij")
    long = pd.DataFrame({"person": person.ravel(), "item": item.ravel(), "rating": complete.ravel()})
    # pingouin rounds intervals to two decimals by default
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
