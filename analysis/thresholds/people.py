"""Thresholds of every person and condition, and their mean over people."""

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import optimize, stats
from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]

from analysis.read.number_columns import numbers
from analysis.read.text_table import (
    TextTable,
    name_lines,
    names_in_order,
    read_text_table,
    refuse_shared_roles,
    texts_required,
)
from analysis.thresholds.likelihood import Shape, Trials
from analysis.thresholds.population import Population, fit_population
from analysis.thresholds.psychometric import Threshold, fit_threshold
from experiments.errors import InputError

Array = NDArray[np.float64]
YES = frozenset({"1", "yes", "true", "correct", "seen", "y", "1.0"})
NO = frozenset({"0", "no", "false", "wrong", "incorrect", "unseen", "n", "0.0"})


@dataclass(frozen=True)
class Answers:
    """Rows of a table: stimulus x (n,), answer 0 or 1 (n,), and names of person and condition (n,).

    Attributes
    ----------
    second : float64 array or None
        A second stimulus variable (n,), where there is one.
    order : tuple of str
        Conditions in the order of their codes; empty where they have none, and are sorted.
    """

    x: Array
    response: Array
    participant: NDArray[np.object_] | None
    condition: NDArray[np.object_] | None
    source: str
    synthetic: bool
    decisions: tuple[str, ...]
    second: Array | None = None
    order: tuple[str, ...] = ()

    def conditions(self) -> tuple[str, ...]:
        """Names of the conditions in order; one, `all`, where there are none."""
        if self.condition is None:
            return ("all",)
        return self.order or tuple(sorted({str(label) for label in self.condition}))


@dataclass(frozen=True)
class PersonThreshold:
    """One person's fit in one condition; `fit` is None where `reason` says why not."""

    participant: str
    condition: str
    fit: Threshold | None
    reason: str


@dataclass(frozen=True)
class Average:
    """Mean of estimates with known errors over people; see `average`."""

    people: int
    mean: float
    se: float
    ci_low: float
    ci_high: float
    tau: float


@dataclass(frozen=True)
class MeanThreshold(Average):
    """Mean over people of their thresholds: a random-effects model of estimates with known errors.

    tau is the SD between people (REML); the interval uses t with people - 1 degrees of freedom (Hartung &
    Knapp 2001, Statistics in Medicine 20, 3875).
    """

    condition: str


@dataclass(frozen=True)
class ThresholdsResult:
    """Everything `analysis thresholds` knows of a table."""

    pooled: dict[str, Threshold]
    people: tuple[PersonThreshold, ...]
    means: tuple[MeanThreshold, ...]
    n_trials: int
    decisions: tuple[str, ...]
    population: dict[str, Population] = field(default_factory=dict)


def read_answers(
    path: Path,
    x: str,
    response: str,
    participant: str | None = None,
    by: str | None = None,
    second: str | None = None,
) -> Answers:
    """Read one row a trial: numbers `x` and `second`, and a `response` of 0/1, yes/no or correct/wrong.

    Raises
    ------
    InputError
        As `read_text_table`; a response that is neither, a stimulus that is no number.
    """
    named = [name for name in (participant, by) if name]
    roles = [x, response, *named, *([second] if second else [])]
    refuse_shared_roles(roles)
    table = read_text_table(path, roles, ("synthetic",))
    for name in named:
        texts_required(table, name, factor=name == by)
    values, answers = numbers(table, x), _binary(table, response)
    keep = np.isfinite(values) & np.isfinite(answers)
    across = numbers(table, second) if second else None
    if across is not None:
        keep &= np.isfinite(across)
    if not keep.all():
        lines = name_lines(table, ~keep)
        table.decisions.append(f"{int((~keep).sum())} rows without stimulus or answer left out ({lines})")
    if not keep.any():
        raise InputError(f"{path.name}: no row has both '{x}' and '{response}'")
    names = [
        None if name is None else table.columns[name].astype(object).to_numpy()[keep]
        for name in (participant, by)
    ]
    return Answers(
        values[keep],
        answers[keep],
        names[0],
        names[1],
        path.name,
        table.synthetic,
        tuple(table.decisions),
        None if across is None else across[keep],
        () if by is None else names_in_order(table.columns[by], keep),
    )


def _binary(table: TextTable, response: str) -> Array:
    texts = table.columns[response].astype(str).str.casefold().to_numpy()
    values = np.full(texts.size, np.nan)
    values[np.isin(texts, list(YES))], values[np.isin(texts, list(NO))] = 1.0, 0.0
    unknown = np.isnan(values) & (texts != "") & (texts != "na") & (texts != "nan")
    if unknown.any():
        row = int(np.argmax(unknown))
        raise InputError(
            f"{table.source}: '{response}' is '{table.columns[response].iloc[row]}' in line {table.line(row)}"
            "; expected 1 or 0 (yes or no, correct or wrong), or an empty cell (or NA) where there is none"
        )
    return values


def counted(x: Array, response: Array) -> Trials:
    """Count trials and positive answers at each level of x."""
    levels, index = np.unique(x, return_inverse=True)
    n, k = np.zeros(levels.size), np.zeros(levels.size)
    np.add.at(n, index, 1.0)
    np.add.at(k, index, response)
    return Trials(levels, n, k)


def fit_thresholds(
    answers: Answers, shape: Shape, guess: float, lapse: float | None, falling: bool | None = None
) -> ThresholdsResult:
    """Fit every condition over all trials and, where people are named, every person in it.

    `falling` is as in `fit_threshold`.

    Raises
    ------
    InputError
        Where a condition cannot be fitted at all.
    """
    # sums this short only wait for a second thread
    with threadpool_limits(1, "blas"):
        return _fitted(answers, shape, guess, lapse, falling)


def _fitted(
    answers: Answers, shape: Shape, guess: float, lapse: float | None, falling: bool | None
) -> ThresholdsResult:
    labels = np.full(answers.x.size, "all", dtype=object) if answers.condition is None else answers.condition
    pooled: dict[str, Threshold] = {}
    people: list[PersonThreshold] = []
    for condition in answers.conditions():
        rows = labels == condition
        try:
            pooled[condition] = fit_threshold(
                counted(answers.x[rows], answers.response[rows]), shape, guess, lapse, falling=falling
            )
        except InputError as error:
            where = "" if condition == "all" else f" ({condition})"
            raise InputError(f"{answers.source}{where}: {error}") from error
        if answers.participant is not None:
            people += _people(answers, rows, condition, shape, guess, lapse, falling)
    means = [mean for condition in pooled if (mean := mean_threshold(people, condition)) is not None]
    return ThresholdsResult(pooled, tuple(people), tuple(means), answers.x.size, answers.decisions)


def with_population(
    result: ThresholdsResult, answers: Answers, shape: Shape, guess: float, lapse: float | None
) -> ThresholdsResult:
    """The result with, for each condition, one model over all people: `fit_population`.

    Raises
    ------
    InputError
        No column names the person, a lapse rate to be fitted, or as `fit_population`.
    """
    if answers.participant is None:
        raise InputError("--hierarchical needs --participant, the column that names the person")
    if lapse is None:
        raise InputError("--hierarchical holds the lapse rate; give it as a number, --lapse 0.02")
    populations, names = {}, answers.participant.astype(str)
    for condition, pooled in result.pooled.items():
        own = np.ones(answers.x.size, bool) if answers.condition is None else answers.condition == condition
        rows = [own & (names == name) for name in sorted(set(names[own]))]
        trials = [counted(answers.x[one], answers.response[one]) for one in rows]
        populations[condition] = fit_population(trials, shape, guess, lapse, pooled.falling)
    return replace(result, population=populations)


def _people(
    answers: Answers,
    rows: NDArray[np.bool_],
    condition: str,
    shape: Shape,
    guess: float,
    lapse: float | None,
    falling: bool | None,
) -> list[PersonThreshold]:
    fits = []
    names = answers.participant
    for name in sorted({str(one) for one in names[rows]}) if names is not None else []:
        own = rows & (names == name)
        try:
            trials = counted(answers.x[own], answers.response[own])
            fit = fit_threshold(trials, shape, guess, lapse, falling=falling)
            fits.append(PersonThreshold(name, condition, fit, ""))
        except InputError as error:
            fits.append(PersonThreshold(name, condition, None, str(error)))
    return fits


def mean_threshold(people: list[PersonThreshold], condition: str) -> MeanThreshold | None:
    """Average thresholds over people; None below two people."""
    own = [one.fit for one in people if one.condition == condition and one.fit is not None]
    known = [(fit.threshold, fit.threshold_se) for fit in own if fit.threshold_se]
    made = average(np.array([a for a, _ in known]), np.array([float(b or 0) for _, b in known]))
    return None if made is None else MeanThreshold(**vars(made), condition=condition)


def average(y: Array, errors: Array) -> Average | None:
    r"""Average estimates y (n,) over people, each weighted by 1 / (se^2 + tau^2); None below two people.

    tau^2 maximises the restricted likelihood of

    .. math::

        y_i &\sim N(\mu, s_i^2 + \tau^2), \quad w_i = 1 / (s_i^2 + \tau^2) \tag{1} \\
        -\log L_R &= \tfrac{1}{2} \{\log \textstyle\sum_i w_i - \sum_i \log w_i
            + \sum_i w_i (y_i - \hat\mu)^2\} \tag{2} \\
        \mathrm{se}^2 &= \textstyle\sum_i w_i (y_i - \hat\mu)^2 / \{(k - 1) \sum_i w_i\} \tag{3}

    with y_i a person's estimate, s_i its standard error, mu the weighted mean and k the people; (3), with
    t on k - 1 df, is Hartung and Knapp's (2001).
    """
    if len(y) < 2:
        return None
    s2 = errors**2

    def restricted(log_tau2: float) -> float:
        weights = 1 / (s2 + np.exp(log_tau2))
        mu = np.sum(weights * y) / weights.sum()
        return float(
            0.5 * (np.log(weights.sum()) - np.sum(np.log(weights)) + np.sum(weights * (y - mu) ** 2))
        )

    span = float(np.var(y)) + float(s2.mean())
    optimum = optimize.minimize_scalar(
        restricted, bounds=(np.log(span) - 25, np.log(span) + 3), method="bounded"
    )
    tau2 = float(np.exp(optimum.x)) if optimum.fun < restricted(-np.inf) else 0.0
    weights = 1 / (s2 + tau2)
    mean = float(np.sum(weights * y) / weights.sum())
    count = len(y)
    se = float(np.sqrt(np.sum(weights * (y - mean) ** 2) / ((count - 1) * weights.sum())))
    half = float(stats.t.ppf(0.975, count - 1)) * se
    return Average(count, mean, se, mean - half, mean + half, float(np.sqrt(tau2)))
