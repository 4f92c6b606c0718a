"""Thresholds over two stimulus variables: of every condition and person, and their means over people."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from analysis.thresholds.answers import Answers
from analysis.thresholds.averages import Average, average
from analysis.thresholds.plane import Plane, fit_plane
from analysis.thresholds.plane_likelihood import PlaneShape, Points, counted_points
from analysis.thresholds.plane_population import PEOPLE_MIN, PopulationPlane, fit_plane_population
from experiments.errors import InputError


@dataclass(frozen=True)
class PersonPlane:
    """One person's fit in one condition; `fit` is None where `reason` says why not."""

    participant: str
    condition: str
    fit: Plane | None
    reason: str


@dataclass(frozen=True)
class PlaneMeans:
    """Means over people of the threshold at the middle and of the tilt; None below two people."""

    threshold: Average | None
    tilt: Average | None


@dataclass(frozen=True)
class PlanesResult:
    """Everything that is known of answers over two variables, by condition.

    Attributes
    ----------
    pooled : dict of str to Plane
        Over all trials, as if one person had given them: too sure where people differ.
    reasons : dict of str to str
        Why a condition has no fit.
    people : tuple of PersonPlane
        Everybody's own fit.
    means : dict of str to PlaneMeans
        Over those who have a fit of their own.
    population : dict of str to PopulationPlane
        Over everybody, where they are three or more.
    """

    pooled: dict[str, Plane]
    reasons: dict[str, str]
    people: tuple[PersonPlane, ...]
    means: dict[str, PlaneMeans]
    n_trials: int
    decisions: tuple[str, ...]
    population: dict[str, PopulationPlane] = field(default_factory=dict)


@dataclass(frozen=True)
class SeriesPlane:
    """One series: its trials by stimulus, and its fits; `result` is None where `reason` says why not."""

    name: str
    label: str
    points: Points
    result: PlanesResult | None
    reason: str | None


def fit_planes(
    answers: Answers,
    shape: PlaneShape,
    guess: float,
    lapse: float,
    *,
    falling: bool | None = None,
    middle: float | None = None,
) -> PlanesResult:
    """Fit every condition over all trials and, where people are named, every person in it and all together.

    Where it is not said whether the function is `falling`, the answers tell, without a guess rate alone.

    Parameters
    ----------
    middle : float, optional
        The second variable's number at which thresholds are given. Fits that are compared must share it;
        halfway between the ends of these answers where it is not given.

    Raises
    ------
    InputError
        Where no condition can be fitted.
    """
    if answers.second is None:
        raise InputError(f"{answers.source}: expected a second stimulus variable, got none")
    size = answers.x.size
    labels = np.full(size, "all", dtype=object) if answers.condition is None else answers.condition
    names = np.full(size, "", dtype=object) if answers.participant is None else answers.participant
    if middle is None:
        middle = float(answers.second.min() + answers.second.max()) / 2
    pooled: dict[str, Plane] = {}
    reasons: dict[str, str] = {}
    people: list[PersonPlane] = []
    population: dict[str, PopulationPlane] = {}
    for condition in answers.conditions():
        rows = labels == condition
        down = _falls(answers, rows, guess) if falling is None else falling
        fit, reason = fitted(points_of(answers, rows), shape, guess, lapse, down, middle)
        if fit is None:
            reasons[condition] = reason
        else:
            pooled[condition] = fit
        every = {name: points_of(answers, rows & (names == name)) for name in sorted({*names[rows]} - {""})}
        for name, mine in every.items():
            fitted_own = fitted(mine, shape, guess, lapse, down, middle, along=False)
            people.append(PersonPlane(str(name), condition, *fitted_own))
        if fit is not None and len(every) >= PEOPLE_MIN:
            population[condition] = fit_plane_population(list(every.values()), fit)
    if not pooled:
        raise InputError(f"{answers.source}: {next(iter(reasons.values()))}")
    means = {
        condition: means_of([one for one in people if one.condition == condition]) for condition in pooled
    }
    return PlanesResult(pooled, reasons, tuple(people), means, size, answers.decisions, population)


def _falls(answers: Answers, rows: NDArray[np.bool_], guess: float) -> bool:
    x, y = answers.x[rows], answers.response[rows]
    return guess == 0.0 and float(np.sum((x - x.mean()) * y)) < 0


def points_of(answers: Answers, rows: NDArray[np.bool_] | slice = slice(None)) -> Points:
    """The answers of some rows counted by stimulus; of those over one variable the second is the first."""
    second = answers.x if answers.second is None else answers.second
    return counted_points(answers.x[rows], second[rows], answers.response[rows])


def fitted(
    points: Points,
    shape: PlaneShape,
    guess: float,
    lapse: float,
    falling: bool,
    middle: float,
    *,
    along: bool = True,
) -> tuple[Plane | None, str]:
    """The fit, or None and why there is none."""
    try:
        return fit_plane(points, shape, guess, lapse, falling=falling, middle=middle, along=along), ""
    except InputError as error:
        return None, str(error)


def means_of(people: Sequence[PersonPlane]) -> PlaneMeans:
    """Means over the people who have a fit."""
    fits = [one.fit for one in people if one.fit is not None]
    each: Mapping[str, Average | None] = {
        name: average(
            np.array([getattr(fit, name) for fit in fits]),
            np.array([getattr(fit, f"{name}_se") for fit in fits]),
        )
        for name in ("threshold", "tilt")
    }
    return PlaneMeans(each["threshold"], each["tilt"])
