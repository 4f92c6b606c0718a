"""Cumulative-link mixed model of ratings: logit link, flexible thresholds, crossed random effects."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import optimize, special
from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]

from analysis.models.columns import ModelTerms, Slopes, split_covariates
from analysis.models.design import ModelData, model_data
from analysis.models.formula import formula_name
from analysis.models.laplace import LaplaceLikelihood, OrdinalData, Parameters
from analysis.models.means import Estimate, ModelMeans, RatioTest, model_means, ratio_tests
from analysis.models.ordinal_maximum import (
    OFF_COEFFICIENT,
    OFF_SD,
    SD_MAX,
    Maximum,
    QuadratureLikelihood,
    laplace_step,
    maximise,
    newton_step,
    pooled_start,
)
from analysis.models.random_part import (
    group_in_formula,
    random_bracket,
    refuse_group_slopes,
    slope_groups,
    unmodelled_slopes,
)
from analysis.models.residuals import ResidualChecks, ordinal_checks
from experiments.errors import InputError

# What a fitted cumulative-link mixed model says: coefficients, tests, SDs.

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class OrdinalEffect:
    """Joint Wald test that all coefficients of an effect are zero."""

    effect: str
    chi2: float
    df: int
    p_value: float


@dataclass(frozen=True)
class OrdinalCoefficient:
    """A sum-coded coefficient on the logit scale with its Wald test."""

    name: str
    estimate: float
    se: float
    z: float
    p_value: float


@dataclass(frozen=True)
class OrdinalComponent:
    """Standard deviation, on the logit scale, of a random term; a slope's is over unit-variance contrasts."""

    group: str
    term: str
    sd: float


@dataclass(frozen=True)
class OrdinalResult:
    """A fitted cumulative-link mixed model; `thresholds[k]` lies between categories k and k + 1.

    Attributes
    ----------
    singular : bool
        The SD of a random term is estimated as zero.
    quadrature : int
        Nodes of each participant's integral; 1 is Laplace's approximation.
    """

    formula: str
    log_likelihood: float
    aic: float
    categories: tuple[float, ...]
    thresholds: tuple[float, ...]
    coefficients: tuple[OrdinalCoefficient, ...]
    effects: tuple[OrdinalEffect, ...]
    sd_participant: float
    sd_item: float
    slopes: Slopes
    components: tuple[OrdinalComponent, ...]
    singular: bool
    n_ratings: int
    n_participants: int
    n_items: int
    notes: tuple[str, ...] = ()
    factors: tuple[str, ...] = ()
    quadrature: int = 1
    means: ModelMeans | None = None
    ratio_tests: tuple[RatioTest, ...] = ()
    residuals: ResidualChecks | None = None


@dataclass(frozen=True)
class RandomTerms:
    """The effects that differ between participants, and those that differ between items."""

    slopes: Slopes
    groups: tuple[str, ...]
    of_items: tuple[str, ...]


def ordinal_result(
    data: ModelData,
    categories: Floats,
    maximum: Maximum,
    terms: RandomTerms,
    left_out: Sequence[str],
    quadrature: int,
) -> OrdinalResult:
    """Coefficients, joint tests and SDs at the maximum; notes of what was left out precede its own."""
    p = maximum.parameters
    first = len(p.thresholds)
    # `Maximum.covariance` is of thresholds, then coefficients, then SDs.
    block = maximum.covariance[first : -len(p.sd), first : -len(p.sd)]
    components = _components(p, terms, data)
    of_items = [component.sd for component in components[len(terms.groups) :]]
    parameters = first + len(p.beta) + len(components)
    return OrdinalResult(
        formula=_formula(data, terms),
        log_likelihood=maximum.value,
        aic=2 * parameters - 2 * maximum.value,
        categories=tuple(float(c) for c in categories),
        thresholds=tuple(float(t) for t in p.thresholds),
        coefficients=_coefficients(data, p.beta, block),
        effects=_effects(data, p.beta, block),
        sd_participant=components[0].sd,
        sd_item=of_items[0] if of_items else 0.0,
        slopes=terms.slopes,
        components=components,
        singular=any(component.sd == 0 for component in components),
        n_ratings=len(data.rating),
        n_participants=len(data.participants.names),
        n_items=len(data.items.names) if data.items else 0,
        notes=(*data.notes, *left_out, *_search_notes(maximum), *_sd_notes(p, terms, data)),
        factors=data.factors,
        quadrature=quadrature,
    )


def _coefficients(data: ModelData, beta: Floats, covariance: Floats) -> tuple[OrdinalCoefficient, ...]:
    se = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    # Without the intercept, whose part the thresholds play.
    return tuple(
        OrdinalCoefficient(name, float(b), float(s), float(b / s), float(2 * special.ndtr(-abs(b / s))))
        for name, b, s in zip(data.column_names[1:], beta, se, strict=True)
    )


def _effects(data: ModelData, beta: Floats, covariance: Floats) -> tuple[OrdinalEffect, ...]:
    effects = []
    for effect in data.effects:
        # Columns of the ordinal model are numbered without the intercept.
        columns = data.columns(effect) - 1
        chi2 = float(beta[columns] @ np.linalg.solve(covariance[np.ix_(columns, columns)], beta[columns]))
        effects.append(OrdinalEffect(effect, chi2, len(columns), float(special.chdtrc(len(columns), chi2))))
    return tuple(effects)


def _search_notes(maximum: Maximum) -> tuple[str, ...]:
    if maximum.settled:
        return ()
    return (
        "the likelihood was still rising when the search ended: it may have no finite maximum (separation)",
    )


def _sd_notes(p: Parameters, terms: RandomTerms, data: ModelData) -> list[str]:
    names = ["participants", *(f"participants' slopes of {group}" for group in terms.groups[1:])]
    names += ["items", *(f"items' slopes of {group}" for group in terms.of_items[1:])]
    zero = "the SD of {} is estimated as zero"
    limit = "the SD of {} is at its upper limit of {:.1f}: the ratings hardly determine it or the estimates"
    return [
        zero.format(name) if sd == 0 else limit.format(name, SD_MAX)
        for name, sd in zip(names, p.sd if data.items else p.sd[:-1], strict=data.items is not None)
        if sd == 0 or sd > SD_MAX - 1e-6
    ]


def _components(p: Parameters, terms: RandomTerms, data: ModelData) -> tuple[OrdinalComponent, ...]:
    names = _component_names(data, terms.groups, terms.of_items)
    return tuple(
        OrdinalComponent(group, effect, float(sd) / data.unit(effect))
        for (group, effect), sd in zip(names, p.sd, strict=False)
    )


def _component_names(
    data: ModelData, groups: Sequence[str], of_items: Sequence[str]
) -> list[tuple[str, str]]:
    """Grouping and effect of each SD, in their order; without items their SD has no name."""
    people = [(data.terms.participant, effect) for effect in groups]
    return people + ([(data.items.name, effect) for effect in of_items] if data.items else [])


def _formula(data: ModelData, terms: RandomTerms) -> str:
    of_people = random_bracket(data, terms.groups, "||", formula_name(data.terms.participant))
    parts = [formula_name(data.terms.rating) + f" ~ {data.fixed_part}", of_people]
    if data.items:
        parts.append(random_bracket(data, terms.of_items, "||", group_in_formula(data.items)))
    return " + ".join(parts)


# Ratings that a factor separates: no finite coefficient has the highest likelihood.


def refuse_separation(data: ModelData) -> None:
    """Refuse a factor some of whose levels have no rating above the lowest of all its others.

    The likelihood of an ordinal model then grows without end as the levels are drawn apart.
    """
    shape = [len(names) for names in data.levels]
    codes = np.unravel_index(data.cell, shape) if shape else ()
    for name, levels, code in zip(data.factors, data.levels, codes, strict=True):
        ratings = [data.rating[code == k] for k in range(len(levels))]
        order = np.argsort([values.mean() for values in ratings])
        for cut in range(1, len(order)):
            top = max(ratings[k].max() for k in order[:cut])
            if top <= min(ratings[k].min() for k in order[cut:]):
                low = ", ".join(levels[k] for k in sorted(order[:cut]))
                raise InputError(
                    f"no rating at {name}={low} is above any other rating of {name}: they are separated, and "
                    "an ordinal model has no finite estimate. Use analysis mixed, or remove the factor"
                )


def separated_columns(data: ModelData) -> list[str]:
    """Coefficients along which the likelihood of an ordinal model never falls: without a finite estimate.

    Along a direction of thresholds a and coefficients b the likelihood of no rating falls where
    a[k] >= x'b for each rating of category k, and a[k - 1] <= x'b. A linear program looks for one that raises
    some likelihood. Random effects change nothing: it holds for each of their values.
    """
    categories, codes = np.unique(data.rating, return_inverse=True)
    k, x = len(categories) - 1, data.x[:, 1:]
    # Equal trials add no constraint; columns of size 1 keep the solver's tolerance meaningful.
    distinct = np.unique(np.column_stack([codes, x / np.abs(x).max(axis=0)]), axis=0)
    code, rows = distinct[:, 0].astype(np.int64), distinct[:, 1:]
    of_threshold = np.eye(k)
    below, above = code < k, code > 0
    slack = np.vstack(
        [
            np.hstack([of_threshold[code[below]], -rows[below]]),
            np.hstack([-of_threshold[code[above] - 1], rows[above]]),
            np.hstack([np.diff(of_threshold, axis=0), np.zeros((k - 1, rows.shape[1]))]),
        ]
    )
    # thresholds alone cannot raise a likelihood: every category was given
    # Bounded: every multiple of such a direction is one too, and the program would have no end.
    solution = optimize.linprog(-slack.sum(axis=0), A_ub=-slack, b_ub=np.zeros(len(slack)), bounds=(-1, 1))
    if solution.x is None or solution.fun is None or solution.fun > -1e-6:
        return []
    names = data.column_names[1:]
    return [name for name, b in zip(names, solution.x[k:], strict=True) if abs(b) > 1e-6]


Integers = NDArray[np.int64]

MAXIMUM_CATEGORIES = 20
MAX_NODES = 100

NODE_LADDER = (15, 31, 63)
"""Nodes of quadrature that are tried in turn."""

SETTLED = 1e-3
"""Standard errors by which more nodes may move an estimate that counts as converged."""

ENDLESS = 20.0
"""A standard error, in logits a standard deviation of its column, of an estimate without a finite maximum.

Of separated cells it was 900 and more, of other data below 6.
"""


def fit_ordinal(
    rows: pd.DataFrame,
    participant: str,
    rating: str,
    within: Sequence[str],
    item: str | Sequence[str] | None = None,
    slopes: Slopes = "none",
    between: Sequence[str] = (),
    covariates: Sequence[str] = (),
    quadrature: int | None = None,
    means: bool = False,
    likelihood_ratio: bool = False,
    residuals: bool = False,
    equivalence: tuple[float, float] | None = None,
    effects: Sequence[str] | None = None,
    slope_effects: Sequence[str] = (),
    item_slopes: Sequence[str] = (),
) -> OrdinalResult:
    """Fit ordered ratings ~ full factorial of the factors + covariates with crossed random effects.

    Parameters are those of `analysis.models.mixed.fit_mixed`; slopes of one effect share one variance over
    its orthonormal contrasts and do not correlate; so do those of `item_slopes`, the effects that differ
    between items. Categories are the distinct ratings met, in order; a
    rating of the scale that nobody gave has no separate threshold. A model without items and slopes is
    fitted by adaptive Gauss-Hermite quadrature of each participant's integral, with as many nodes as more
    would change nothing; others by Laplace's approximation, with a note where it is not accurate. With
    `quadrature` there are as many nodes; 1 is Laplace's approximation, without a check. `means` are on the
    logit scale.

    Raises
    ------
    InputError
        As there, for quadrature of more than one random term or over 100 nodes, for more than 20 distinct
        ratings, for correlated slopes, and for effects that so few ratings leave undetermined.
    """
    if slopes == "correlated":
        raise InputError("slopes of the ordinal model cannot correlate; expected all, main or none")
    items = (item,) if isinstance(item, str) else tuple(item or ())
    _refuse_quadrature(quadrature or 1, items, slopes)
    numbers, interactions = split_covariates(covariates, (*within, *between))
    columns = ModelTerms(
        participant,
        rating,
        tuple(within),
        items,
        tuple(between),
        numbers,
        interactions=interactions,
        effects=None if effects is None else tuple(effects),
        slope_effects=tuple(slope_effects) or None,
        group_slopes=((":".join(items), tuple(item_slopes)),) if items and item_slopes else (),
    )
    data = model_data(rows, columns)
    refuse_group_slopes(data)
    of_items = ["intercept"] if data.items is None else data.group_effects(data.items, "none")
    categories, codes = np.unique(data.rating, return_inverse=True)
    if len(categories) > MAXIMUM_CATEGORIES:
        raise InputError(
            f"expected at most {MAXIMUM_CATEGORIES} distinct ratings, got {len(categories)}; "
            "use the linear mixed model for continuous ratings"
        )
    refuse_separation(data)
    groups, left_out = slope_groups(data, slopes)
    left_out += unmodelled_slopes(data, slopes)
    ordinal = _ordinal_data(data, codes.astype(np.int64), len(categories), groups, of_items)
    # matrices this small only wait for a second thread
    with threadpool_limits(1, "blas"):
        maximum = maximise(LaplaceLikelihood(ordinal), pooled_start(ordinal, bool(items)), bool(items))
        nodes = quadrature or 1
        one_integral = not items and groups == ["intercept"]
        if quadrature is None and one_integral:
            maximum, nodes, said = _by_enough_nodes(ordinal, maximum)
            left_out += said
        elif nodes > 1:
            maximum = maximise(QuadratureLikelihood(ordinal, nodes), maximum.parameters, False)
        first = len(categories) - 1
        _refuse_undetermined(data, np.diag(maximum.covariance)[first : -ordinal.n_sds])
        if quadrature is None and not one_integral:
            left_out += _laplace_notes(data, ordinal, maximum, _component_names(data, groups, of_items))
    terms = RandomTerms(slopes, tuple(groups), tuple(of_items))
    result = ordinal_result(data, categories, maximum, terms, left_out, nodes)
    if means:
        result = replace(result, means=_latent_means(data, maximum, equivalence))
    if likelihood_ratio:
        with threadpool_limits(1, "blas"):
            without = partial(_chi2_without, ordinal, maximum, nodes, bool(items))
            result = replace(result, ratio_tests=ratio_tests(data, without))
    if residuals:
        result = replace(result, residuals=ordinal_checks(ordinal, maximum.parameters))
    return result


def _latent_means(data: ModelData, maximum: Maximum, equivalence: tuple[float, float] | None) -> ModelMeans:
    """Means on the logit scale, from the mean of the thresholds (as emmeans' mode `latent`)."""
    p = maximum.parameters
    count, gaps = len(p.thresholds), np.diff(p.thresholds)
    # covariance is of the first threshold and the logs of the gaps; gap j moves all thresholds after it
    of_mean = np.concatenate([[1.0], gaps * np.arange(count - 1, 0, -1) / count])
    covariance = maximum.covariance[: -len(p.sd), : -len(p.sd)]

    def estimated(contrast: Floats) -> Estimate:
        value = float(contrast[1:] @ p.beta - contrast[0] * p.thresholds.mean())
        row = np.concatenate([-contrast[0] * of_mean, contrast[1:]])
        return value, float(np.sqrt(row @ covariance @ row)), float("inf")

    return model_means(data, estimated, equivalence)


def _chi2_without(
    ordinal: OrdinalData, maximum: Maximum, nodes: int, with_items: bool, columns: Integers
) -> float:
    smaller = replace(ordinal, x=np.delete(ordinal.x, columns - 1, axis=1))
    p = maximum.parameters
    start = replace(p, beta=np.delete(p.beta, columns - 1))
    likelihood = LaplaceLikelihood(smaller) if nodes == 1 else QuadratureLikelihood(smaller, nodes)
    return 2 * (maximum.value - maximise(likelihood, start, with_items).value)


def _by_enough_nodes(ordinal: OrdinalData, start: Maximum) -> tuple[Maximum, int, list[str]]:
    """The maximum with the fewest nodes of a ladder from which the next step would not move it."""
    maximum = start
    for nodes, more in zip(NODE_LADDER, (*NODE_LADDER[1:], MAX_NODES), strict=True):
        maximum = maximise(QuadratureLikelihood(ordinal, nodes), maximum.parameters, False)
        # One Newton step of the finer likelihood shows the distance, without a second maximization.
        moved = np.abs(newton_step(QuadratureLikelihood(ordinal, more), maximum))
        errors = np.sqrt(np.maximum(np.diag(maximum.covariance), 0.0))
        if (moved <= SETTLED * errors).all():
            return maximum, nodes, []
    share = float((moved[errors > 0] / errors[errors > 0]).max())
    return (
        maximum,
        nodes,
        [
            f"quadrature did not converge: with {MAX_NODES} nodes an estimate would change by about "
            f"{share:.2g} of its standard error"
        ],
    )


def _laplace_notes(
    data: ModelData, ordinal: OrdinalData, maximum: Maximum, components: Sequence[tuple[str, str]]
) -> list[str]:
    """What exact integrals would move too far, of a model that only Laplace's approximation fits."""
    step = laplace_step(ordinal, maximum, data.items is not None)
    first = ordinal.n_categories - 1
    errors = np.sqrt(np.maximum(np.diag(maximum.covariance), 0.0))
    moved = []
    for name, by, error in zip(data.column_names[1:], step[first:], errors[first:], strict=False):
        if error > 0 and abs(by) > OFF_COEFFICIENT * error:
            size = f"{by:+.2g} ({abs(by) / error:.2g} of its standard error)"
            moved.append(
                f"{name} by {'about ' + size if abs(by) < error else 'more than its standard error'}"
            )
    names = [
        group if effect == "intercept" and group != data.terms.participant else f"{group} {effect}"
        for group, effect in components
    ]
    for name, by, sd in zip(names, step[-ordinal.n_sds :], maximum.parameters.sd, strict=False):
        if sd > 0 and abs(by) > OFF_SD * sd:
            size = f"about {100 * by / sd:+.0f}%" if abs(by) < sd / 2 else "more than half"
            moved.append(f"the SD of {name} by {size}")
    if not moved:
        return []
    return [
        "Laplace's approximation is not accurate for these ratings: exact integrals would change "
        f"{', '.join(moved)}; a model with participants' intercepts only is fitted by quadrature"
    ]


def _refuse_quadrature(nodes: int, items: Sequence[str], slopes: Slopes) -> None:
    if not 1 <= nodes <= MAX_NODES:
        raise InputError(f"expected 1 to {MAX_NODES} nodes of quadrature, got {nodes}")
    if nodes > 1 and (items or slopes != "none"):
        further = f"the item {', '.join(items)}" if items else "slopes"
        raise InputError(
            f"quadrature is for participants' intercepts only, but the model also has {further}; use "
            "Laplace's approximation (1 node), or remove these"
        )


def _refuse_undetermined(data: ModelData, variances: Floats) -> None:
    # A flat likelihood has no curvature: the estimate is where the search stopped, and its error unknown.
    names = data.column_names[1:]
    # Written so that NaN counts as undetermined too.
    undetermined = [name for name, v in zip(names, variances, strict=True) if not v > 0]
    if undetermined and (separated := separated_columns(data)):
        raise InputError(_separated(separated))
    if undetermined:
        raise InputError(
            f"the ordinal model has too few ratings or participants to estimate {', '.join(undetermined)}; "
            "use the linear mixed model, or collect more"
        )
    errors = np.sqrt(variances) * data.x[:, 1:].std(axis=0)
    endless = [name for name, error in zip(names, errors, strict=True) if error > ENDLESS]
    if endless:
        raise InputError(_separated(endless))


def _separated(names: Sequence[str]) -> str:
    return (
        f"ratings are separated: the likelihood rises without limit as {', '.join(names)} grow, so an "
        "ordinal model has no finite estimate, however many ratings there are; use analysis mixed, or "
        "remove a factor"
    )


def _ordinal_data(
    data: ModelData, codes: Integers, n_categories: int, groups: Sequence[str], of_items: Sequence[str]
) -> OrdinalData:
    people, items = data.participants, data.items
    return OrdinalData(
        data.x[:, 1:],
        data.slope_columns(groups),
        _term_of_column(data, groups),
        codes,
        people.codes,
        # Without items all trials share one, whose SD is held at zero.
        np.zeros(len(codes), np.int64) if items is None else items.codes,
        n_categories,
        len(people.names),
        1 if items is None else len(items.names),
        data.slope_columns(of_items),
        _term_of_column(data, of_items),
    )


def _term_of_column(data: ModelData, effects: Sequence[str]) -> Integers:
    return np.repeat(np.arange(len(effects)), [len(data.columns(effect)) for effect in effects])
