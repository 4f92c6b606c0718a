"""Linear mixed models: crossed and nested groupings, by-participant slopes, Satterthwaite tests."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import stats
from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]

from analysis.models.design import ModelData, ModelTerms, Slopes, model_data, slope_groups
from analysis.models.reml import CrossProducts, criterion, cross_products
from analysis.models.satterthwaite import Uncertainty, f_test, uncertainty
from analysis.models.variances import SINGULAR_THETA, fit_theta
from experiments.errors import InputError

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class MixedEffect:
    """Type III test of a fixed effect; `df_error` is Satterthwaite's."""

    effect: str
    f_value: float
    df_effect: int
    df_error: float
    p_value: float


@dataclass(frozen=True)
class Coefficient:
    """A sum-coded fixed coefficient with its Satterthwaite t test."""

    name: str
    estimate: float
    se: float
    df: float
    t: float
    p_value: float


@dataclass(frozen=True)
class Component:
    """Standard deviation of a random term; `correlations` with the group's earlier terms, where estimated."""

    group: str
    term: str
    sd: float
    correlations: tuple[float, ...] = ()


@dataclass(frozen=True)
class MixedResult:
    """A fitted mixed model. `singular`: some variance is estimated as zero."""

    formula: str
    slopes: Slopes
    effects: tuple[MixedEffect, ...]
    coefficients: tuple[Coefficient, ...]
    components: tuple[Component, ...]
    reml_criterion: float
    sigma: float
    theta: tuple[float, ...]
    n_ratings: int
    n_participants: int
    n_items: int
    n_groups: dict[str, int]
    singular: bool
    notes: tuple[str, ...] = ()
    factors: tuple[str, ...] = field(default=())


def fit_mixed(
    rows: pd.DataFrame,
    participant: str,
    rating: str,
    within: Sequence[str],
    item: str | Sequence[str] | None = None,
    slopes: Slopes = "all",
    between: Sequence[str] = (),
    covariates: Sequence[str] = (),
    random: Sequence[str] = (),
) -> MixedResult:
    """Fit rating ~ full factorial of the factors + covariates with crossed random groupings by REML.

    Parameters
    ----------
    rows : one row a trial.
    item : the column (or columns, together) that names what was rated; None for a model of participants
        alone, which generalises to no other clips.
    slopes : by-participant slopes. `all`: one variance for every effect within participants, so that each
        test has its own error term; `main`: main effects only; `correlated`: intercept and main-effect slopes
        with all correlations (lme4's `(1 + A + B | participant)`); `none`: intercepts only, anti-conservative
        if people differ.
    between : factors with one level for each participant, crossed with those within.
    covariates : numbers, centred, without interactions.
    random : further groupings with an intercept each (faces, laboratories); `a/b` is b nested in a.

    Independent slopes share one variance over an effect's orthonormal contrasts, hence do not depend on
    coding; with two levels they are lme4's `||` with +1/-1 columns, with more `(1 | participant:A)`.

    Raises
    ------
    InputError
        Unknown columns, text for numbers, constant ratings, empty cells, or too few ratings for the model.
    """
    items = (item,) if isinstance(item, str) else tuple(item or ())
    terms = ModelTerms(
        participant, rating, tuple(within), items, tuple(between), tuple(covariates), tuple(random)
    )
    data = model_data(rows, terms)
    effects, notes = slope_groups(data, slopes)
    random_terms = data.random_terms(slopes, effects)
    parameters = sum(len(term.patterns) for term in random_terms)
    x = data.x
    if len(data.rating) <= x.shape[1] + parameters + 1:
        raise InputError(f"expected more than {x.shape[1] + parameters + 1} ratings, got {len(data.rating)}")
    # matrices this small only wait for a second thread
    with threadpool_limits(1, "blas"):
        c = cross_products(x, data.rating, random_terms)
        theta = fit_theta(c)
        return _result(data, c, theta, effects, slopes, (*data.notes, *notes))


def _result(
    data: ModelData,
    c: CrossProducts,
    theta: Floats,
    labels: list[str],
    slopes: Slopes,
    notes: tuple[str, ...],
) -> MixedResult:
    at = criterion(c, theta)
    spread = uncertainty(c, theta, at)
    effects = tuple(
        MixedEffect(effect, *f_test(at.beta, spread, data.differences(effect))) for effect in data.effects
    )
    factor = c.blocks[0].factor(theta)
    components = (*_components(labels, factor, at.sigma, slopes, data),)
    for group, block in zip(data.groups[1:], c.blocks[1:], strict=True):
        components += (Component(group.name, "intercept", at.sigma * float(block.factor(theta)[0, 0])),)
    degenerate = _degenerate(components, factor, at.sigma)
    components += (Component("residual", "", at.sigma),)
    return MixedResult(
        formula=_formula(data, labels, slopes),
        slopes=slopes,
        effects=effects,
        coefficients=tuple(_coefficients(data, at.beta, spread)),
        components=components,
        reml_criterion=at.value,
        sigma=at.sigma,
        theta=tuple(float(t) for t in theta),
        n_ratings=c.n,
        n_participants=len(data.participants.names),
        n_items=len(data.items.names) if data.items else 0,
        n_groups={group.name: len(group.names) for group in data.groups},
        singular=bool(degenerate),
        notes=(*notes, *degenerate),
        factors=data.factors,
    )


def _degenerate(components: tuple[Component, ...], factor: Floats, sigma: float) -> tuple[str, ...]:
    """What a singular fit says: which variances are zero, or that random terms depend on one another."""
    zero = [f"{c.group} {c.term}" for c in components if c.sd < SINGULAR_THETA * sigma]
    if zero:
        return (
            f"singular fit: the variance of {', '.join(zero)} is estimated as zero; these terms are kept at "
            "zero, which leaves the tests of other effects as they are",
        )
    if np.linalg.svd(factor, compute_uv=False).min() < SINGULAR_THETA:
        return ("singular fit: the random terms of participants depend on one another (a correlation of 1)",)
    return ()


def _formula(data: ModelData, labels: list[str], slopes: Slopes) -> str:
    terms = ["1" if label == "intercept" else label for label in labels]
    bar = "|" if slopes == "correlated" else "||"
    others = "".join(f" + (1 | {group.name})" for group in data.groups[1:])
    of_people = f"({' + '.join(terms)} {bar} {data.terms.participant})"
    return f"{data.terms.rating} ~ {data.fixed_part} + {of_people}{others}"


def _components(
    labels: list[str], factor: Floats, sigma: float, slopes: Slopes, data: ModelData
) -> list[Component]:
    participant = data.terms.participant
    covariance = sigma**2 * factor @ factor.T
    sds = np.sqrt(np.diag(covariance))
    of_column = [label for label in labels for _ in data.columns(label)]
    if slopes != "correlated":
        first = [of_column.index(label) for label in labels]
        return [Component(participant, label, float(sds[i])) for label, i in zip(labels, first, strict=True)]
    with np.errstate(invalid="ignore", divide="ignore"):
        correlation = covariance / np.outer(sds, sds)
    return [
        Component(participant, name, float(sds[i]), tuple(float(r) for r in correlation[i, :i]))
        for i, name in enumerate(_told_apart(of_column))
    ]


def _told_apart(labels: Sequence[str]) -> list[str]:
    """Labels of a factor's several contrasts numbered from 1; others as they are."""
    seen: dict[str, int] = {}
    names = []
    for label in labels:
        seen[label] = seen.get(label, 0) + 1
        names.append(f"{label} contrast {seen[label]}" if labels.count(label) > 1 else label)
    return names


def _coefficients(data: ModelData, beta: Floats, spread: Uncertainty) -> list[Coefficient]:
    rows = []
    for i, name in enumerate(data.column_names):
        contrast = np.eye(len(beta))[[i]]
        f_value, _, df, p = f_test(beta, spread, contrast)
        se = float(np.sqrt(spread.covariance[i, i]))
        t = float(np.sign(beta[i]) * np.sqrt(f_value))
        rows.append(Coefficient(name, float(beta[i]), se, df, t, float(min(p, 2 * stats.t.sf(abs(t), df)))))
    return rows
