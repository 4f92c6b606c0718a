"""Which effects participants may differ in."""

from collections.abc import Sequence

import numpy as np

from analysis.models.design import ModelData
from analysis.models.roles import Slopes
from experiments.errors import InputError


def slope_groups(data: ModelData, slopes: Slopes) -> tuple[list[str], list[str]]:
    """Effects with a by-participant slope (`intercept` first), and what had to be left out."""
    if slopes == "none":
        return ["intercept"], []
    if slopes != "all":
        effects = ["intercept", *data.covariate_slopes, *data.terms.within]
        if slopes == "correlated":
            _refuse_too_few(data, effects)
            return effects, []
        return _without_residual_slopes(data, effects)
    inside = data.slope_effects
    kept, said = _without_residual_slopes(data, ["intercept", *_without_last(data, inside)])
    last = [effect for effect in inside if effect not in _without_last(data, inside)]
    return kept, [*(f"no slope of {name}: with one rating a cell it is the residual" for name in last), *said]


def _without_last(data: ModelData, inside: list[str]) -> list[str]:
    """Effects without the highest interaction of factors where each cell has one rating of a participant."""
    cells, people = len(data.fixed), data.participants
    counts = np.bincount(people.codes * cells + data.cell, minlength=len(people.names) * cells)
    of_factors = [effect for effect in inside if effect in data.factorial_effects]
    if counts.max() > 1 or not of_factors:
        return inside
    return [effect for effect in inside if effect != of_factors[-1]]


def _without_residual_slopes(data: ModelData, effects: list[str]) -> tuple[list[str], list[str]]:
    """Effects without slopes of covariates that would leave participants' ratings no residual."""
    people, ratings = len(data.participants.names), len(data.rating)
    numbers = {effect.name for effect in data.number_effects}
    kept, said = list(effects), []
    for name in reversed([effect for effect in effects if effect in numbers]):
        own = sum(len(data.columns(effect)) for effect in kept)
        if own * people < ratings:
            break
        kept.remove(name)
        said.append(f"no slope of {name}: with so few ratings of each participant it is the residual")
    return kept, said


def _refuse_too_few(data: ModelData, effects: Sequence[str]) -> None:
    """As many correlated random coefficients as ratings leave no residual."""
    own = sum(len(data.columns(effect)) for effect in effects)
    people, ratings = len(data.participants.names), len(data.rating)
    if own * people >= ratings:
        raise InputError(
            f"expected more than {own * people} ratings for {own} correlated coefficients of each of "
            f"{people} participants, got {ratings}; with one rating a cell use --slopes none or all"
        )


def unmodelled_slopes(data: ModelData, slopes: Slopes) -> list[str]:
    """What is said of covariates that vary within participants, in a model of intercepts alone."""
    if slopes != "none" or not data.covariate_slopes:
        return []
    named = ", ".join(data.covariate_slopes)
    return [
        f"{named} varies within participants and has no by-participant slope: where people differ in it its "
        "p is too small; --slopes all gives it one"
    ]
