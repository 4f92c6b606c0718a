"""Thresholds of every person and condition, and their mean over people."""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]

from analysis.thresholds.answers import Answers, counted
from analysis.thresholds.averages import Average, average
from analysis.thresholds.likelihood import Shape
from analysis.thresholds.population import Population, fit_population
from analysis.thresholds.psychometric import Threshold, fit_threshold
from experiments.errors import InputError


@dataclass(frozen=True)
class PersonThreshold:
    """One person's fit in one condition; `fit` is None where `reason` says why not."""

    participant: str
    condition: str
    fit: Threshold | None
    reason: str


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
