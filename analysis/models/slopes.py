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
        effects = ["intercept", *data.terms.within]
        if slopes == "correlated":
            _refuse_too_few(data, effects)
        return effects, []
    inside = data.slope_effects
    cells, people = len(data.fixed), data.participants
    counts = np.bincount(people.codes * cells + data.cell, minlength=len(people.names) * cells)
    if counts.max() > 1 or not inside:
        return ["intercept", *inside], []
    kept = ["intercept", *inside[:-1]]
    return kept, [f"no slope of {inside[-1]}: with one rating a cell it is the residual"]


def _refuse_too_few(data: ModelData, effects: Sequence[str]) -> None:
    """As many correlated random coefficients as ratings leave no residual."""
    own = sum(len(data.columns(effect)) for effect in effects)
    people, ratings = len(data.participants.names), len(data.rating)
    if own * people >= ratings:
        raise InputError(
            f"expected more than {own * people} ratings for {own} correlated coefficients of each of "
            f"{people} participants, got {ratings}; with one rating a cell use --slopes none or all"
        )
