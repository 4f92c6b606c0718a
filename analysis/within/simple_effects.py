"""Simple effects: one factor of an interaction tested at each level of the others."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from analysis.within.adjustments import holm
from analysis.within.anova import AnovaResult, Effect, effects_of
from analysis.within.multivariate_tests import MultivariateTest
from analysis.within.strata import Hypothesis, above_noise, error_stratum, orthonormal_basis
from experiments.errors import InputError

Floats = NDArray[np.float64]

SIGNIFICANCE = 0.05
MAXIMUM_PLACES = 60
"""An interaction with more combinations of the other factors' levels is not taken apart."""


@dataclass(frozen=True)
class SimpleEffect:
    """The test of factor `of` where the others have the levels `at`, with its own error term.

    `p_value` is that of the multivariate test where there is one, else Greenhouse-Geisser's; `p_holm` is
    adjusted for the places of this interaction at which `of` is tested.
    """

    interaction: str
    of: str
    at: dict[str, str]
    test: Effect
    p_value: float
    p_holm: float


def simple_effect(result: AnovaResult, of: str, at: Mapping[str, str]) -> Effect:
    r"""Test one factor at given levels of others; factors named in neither are averaged over.

    Notes
    -----
    The general hypothesis of `linear_anova` with M the contrasts of `of` at the within levels, and U the
    directions of the group rows C (one group, or differences of groups where `of` is between):
    :math:`U \propto C (X'X)^{-1} X'`. With q contrasts within, F is Hotelling's exact one on
    :math:`q, \nu - q + 1`; emmeans' `joint_tests` prints :math:`T^2 / q` on :math:`q, \nu`: too large.
    """
    design, x = result.between, result.between.matrix
    groups = {name: design.levels[k].index(at[name]) for k, name in enumerate(design.factors) if name in at}
    z, members = _within_scores(result, of, at)
    # Between participants: differences of groups, each against the first.
    if of in design.factors:
        size = len(design.levels[design.factors.index(of)])
        rows = np.array([design.row({**groups, of: level}) for level in range(size)])
        rows = rows[1:] - rows[0]
    else:
        rows = design.row(groups)[None]
    # Orthonormal, so that sums of squares do not depend on which group is the first.
    directions = np.linalg.qr(_toward(x, rows))[0].T
    basis = design.basis
    # What rounding of the ratings alone can leave in a sum of squares.
    floor = z.size * (8 * np.finfo(float).eps * float(np.abs(result.y).max())) ** 2
    # Of these contrasts only, but over all groups: more df than the groups by themselves would give.
    residual, directed = z - basis @ (basis.T @ z), directions @ z
    # Twice: the first projection leaves rounding errors.
    residual -= basis @ (basis.T @ residual)
    ss_error, ss = above_noise(np.array([np.vdot(residual, residual), np.vdot(directed, directed)]), floor)
    error = error_stratum(residual, members, result.df_error, float(ss_error))
    tested = Hypothesis((of,) if of in design.factors else (), error, float(ss), directed)
    return effects_of([tested], result.factors, error.ss, result.confidence)[0]


def _toward(x: Floats, rows: Floats) -> Floats:
    """Participants' weights (N, r) in the estimates of `rows` (r, p)."""
    return np.asarray(x @ np.linalg.solve(x.T @ x, rows.T), dtype=np.float64)


def _within_scores(result: AnovaResult, of: str, at: Mapping[str, str]) -> tuple[Floats, tuple[int, ...]]:
    """Scores (N, q): contrasts of `of` (or the mean) at the levels `at`, over the mean of other factors."""
    values: Floats = result.y
    members: tuple[int, ...] = ()
    # From the last axis on, as each step removes or moves an axis behind the others.
    for axis in reversed(range(len(result.factors))):
        name = result.factors[axis]
        if name == of:
            values = np.moveaxis(values, axis + 1, -1)
            members = (axis,)
        elif name in at:
            values = np.take(values, result.levels[axis].index(at[name]), axis=axis + 1)
        else:
            values = values.mean(axis=axis + 1)
    # A factor between participants: one score each, their mean at these levels.
    if not members:
        return values.reshape(len(values), 1), ()
    flat = values.reshape(len(values), -1)
    # The constant first column is left out; centering first keeps small contrasts exact.
    return (flat - flat.mean(axis=1, keepdims=True)) @ orthonormal_basis(flat.shape[1])[:, 1:], members


def simple_effects(
    result: AnovaResult, interactions: tuple[str, ...] | None = None, planned: bool = True
) -> tuple[SimpleEffect, ...]:
    """Simple effects of the named interactions; of every significant one where none is named.

    Which F counts is that of `reports_multivariate`, for all of them; `planned` is as there.

    Raises
    ------
    InputError
        A name that is not an effect, or an effect of one factor or with a covariate.
    """
    multivariate = reports_multivariate(result, planned)
    # Not all of them: simple effects explain an interaction that was found.
    if interactions is None:
        of_interactions = [effect for effect in result.effects if _is_interaction(result, effect)]
        chosen = [effect for effect in of_interactions if first_p(effect, multivariate) < SIGNIFICANCE]
    else:
        chosen = [result.effect(name) for name in interactions]
        for effect in chosen:
            if not _is_interaction(result, effect):
                raise InputError(
                    f"'{effect.effect}' is not an interaction of factors; it has no simple effects"
                )
    return tuple(simple for effect in chosen for simple in _of_interaction(result, effect, multivariate))


def _is_interaction(result: AnovaResult, effect: Effect) -> bool:
    return len(effect.factors) > 1 and set(effect.factors) <= set(result.all_factors)


def reports_multivariate(result: AnovaResult, planned: bool = True) -> bool:
    """Whether the F reported first, everywhere, is the multivariate one: the one rule of all reports.

    It is where a study does not plan the univariate one (`planned`), and each effect has an exact
    multivariate test; else every F is the univariate one with Greenhouse and Geisser's df.
    """
    tests = [effect.multivariate for effect in result.effects]
    # One rule for all, so that a reader never compares p of different tests.
    return planned and all(test is not None and test.exact for test in tests)


def first_test(effect: Effect, multivariate: bool) -> MultivariateTest | None:
    """The multivariate test where it is the one reported first; None where the univariate one is."""
    test = effect.multivariate
    return test if multivariate and test is not None and test.exact else None


def first_p(effect: Effect, multivariate: bool) -> float:
    """p of the test reported first."""
    test = first_test(effect, multivariate)
    return effect.univariate.p_gg if test is None else test.p_value


def _of_interaction(result: AnovaResult, effect: Effect, multivariate: bool) -> list[SimpleEffect]:
    levels = dict(zip(result.all_factors, result.all_levels, strict=True))
    effects: list[SimpleEffect] = []
    for of in effect.factors:
        others = [name for name in effect.factors if name != of]
        places = [dict(zip(others, at, strict=True)) for at in product(*(levels[o] for o in others))]
        # So many tests explain nothing, and Holm would leave none.
        if len(places) > MAXIMUM_PLACES:
            continue
        tests = [simple_effect(result, of, at) for at in places]
        p = np.array([first_p(test, multivariate) for test in tests])
        effects += [
            SimpleEffect(effect.effect, of, at, test, float(one), float(adjusted))
            # Holm over the places of this interaction, for this factor.
            for at, test, one, adjusted in zip(places, tests, p, holm(p), strict=True)
        ]
    return effects
