"""Linear mixed models: crossed and nested groupings, by-participant slopes, Satterthwaite tests."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import special
from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]

from analysis.models.columns import Grouping
from analysis.models.design import ModelData, ModelTerms, RandomSlopes, Slopes, model_data, slope_groups
from analysis.models.exact import refused_where_exact
from analysis.models.kenward_roger import KenwardRoger, kenward_roger
from analysis.models.profile import Profile
from analysis.models.reml import CrossProducts, criterion, cross_products
from analysis.models.satterthwaite import Uncertainty, uncertainty
from analysis.models.terms import Term
from analysis.models.variances import SINGULAR_THETA, fit_theta
from experiments.errors import InputError

Floats = NDArray[np.float64]
DfMethod = Literal["satterthwaite", "kenward-roger"]


@dataclass(frozen=True)
class MixedEffect:
    """Type III test of a fixed effect; `df_error` is Satterthwaite's, or Kenward and Roger's."""

    effect: str
    f_value: float
    df_effect: int
    df_error: float
    p_value: float


@dataclass(frozen=True)
class Coefficient:
    """A sum-coded fixed coefficient with its t test; Kenward and Roger adjust `se` too.

    `ci` is its profile likelihood interval, where asked for.
    """

    name: str
    estimate: float
    se: float
    df: float
    t: float
    p_value: float
    ci: tuple[float, float] | None = None


@dataclass(frozen=True)
class Component:
    """Standard deviation of a random term; `correlations` with the group's earlier terms, where estimated.

    `ci` is its profile likelihood interval, where asked for and where it is a parameter of its own.
    """

    group: str
    term: str
    sd: float
    correlations: tuple[float, ...] = ()
    ci: tuple[float, float] | None = None


@dataclass(frozen=True)
class MixedResult:
    """A fitted mixed model.

    Attributes
    ----------
    singular : bool
        Some variance is estimated as zero.
    """

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
    df_method: DfMethod = "satterthwaite"


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
    random_slopes: RandomSlopes = "none",
    df_method: DfMethod = "satterthwaite",
    intervals: bool = False,
) -> MixedResult:
    """Fit rating ~ full factorial of the factors + covariates with crossed random groupings by REML.

    Independent slopes share one variance over an effect's orthonormal contrasts, hence do not depend on
    coding; with two levels they are lme4's `||` with +1/-1 columns, with more `(1 | participant:A)`.

    Parameters
    ----------
    rows : DataFrame
        One row a trial.
    item : str or sequence of str, optional
        The column (or columns, together) that names what was rated; None for a model of participants alone,
        which generalises to no other clips.
    slopes : {"none", "main", "all", "correlated"}, optional
        By-participant slopes. `all`: one variance for every effect within participants, so that each test has
        its own error term; `main`: main effects only; `correlated`: intercept and main-effect slopes with all
        correlations (lme4's `(1 + A + B | participant)`); `none`: intercepts only, anti-conservative if
        people differ.
    between : sequence of str, optional
        Factors with one level for each participant, crossed with those within.
    covariates : sequence of str, optional
        Numbers, centred, without interactions.
    random : sequence of str, optional
        Further groupings with an intercept each (faces, laboratories); `a/b` is b nested in a.
    random_slopes : {"none", "main", "all"}, optional
        Slopes of these (of a in `a/b`) for the effects of all factors, those between participants too: `all`,
        `main` or `none`. A test of an effect holds for other levels only if it has such a slope.
    df_method : {"satterthwaite", "kenward-roger"}, optional
        Kenward and Roger's also widens standard errors, for few participants; for up to 4,000 random
        coefficients.
    intervals : bool, optional
        Add 95% profile likelihood intervals of coefficients and standard deviations.

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
    random_terms = data.random_terms(slopes, effects, random_slopes)
    parameters = sum(len(term.patterns) for term in random_terms)
    x = data.x
    if len(data.rating) <= x.shape[1] + parameters + 1:
        raise InputError(f"expected more than {x.shape[1] + parameters + 1} ratings, got {len(data.rating)}")
    # matrices this small only wait for a second thread
    with threadpool_limits(1, "blas"):
        c = cross_products(x, data.rating, random_terms)
        with refused_where_exact(data, random_terms):
            theta = fit_theta(c)
        fitted = _Fitted(data, random_terms, c, theta)
        result = _result(fitted, effects, slopes, random_slopes, df_method, (*data.notes, *notes))
        return _with_intervals(result, c, theta) if intervals else result


@dataclass(frozen=True)
class _Fitted:
    """Coded trials, their random terms and cross-products, and the relative SDs of the REML estimate."""

    data: ModelData
    terms: list[Term]
    c: CrossProducts
    theta: Floats


def _result(
    fitted: _Fitted,
    labels: list[str],
    slopes: Slopes,
    random_slopes: RandomSlopes,
    df_method: DfMethod,
    notes: tuple[str, ...],
) -> MixedResult:
    data, c, theta = fitted.data, fitted.c, fitted.theta
    at = criterion(c, theta)
    spread: Uncertainty | KenwardRoger = uncertainty(c, theta, at)
    if df_method == "kenward-roger":
        spread = kenward_roger(fitted.terms, c, theta, at, slopes == "correlated")
    effects = tuple(
        MixedEffect(effect, *spread.f_test(at.beta, data.differences(effect))) for effect in data.effects
    )
    factor = c.blocks[0].factor(theta)
    components = (*_components(labels, factor, at.sigma, slopes, data),)
    for group, block in zip(data.groups[1:], c.blocks[1:], strict=True):
        terms = _terms_of(data, group, random_slopes)
        sds = at.sigma * theta[block.theta]
        components += tuple(Component(group.name, *of) for of in zip(terms, map(float, sds), strict=True))
    degenerate = _degenerate(components, factor, at.sigma)
    components += (Component("residual", "", at.sigma),)
    return MixedResult(
        formula=_formula(data, labels, slopes, random_slopes),
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
        df_method=df_method,
    )


def _with_intervals(result: MixedResult, c: CrossProducts, theta: Floats) -> MixedResult:
    """Add profile intervals; standard deviations of correlated slopes are no parameters and have none."""
    profile = Profile(c, theta)
    without = len(c.blocks[0].patterns[0]) if result.slopes == "correlated" else 0
    first = c.blocks[0].theta.stop if result.slopes == "correlated" else 0
    ends: list[tuple[float, float] | None] = [None] * without
    ends += [profile.sd(k) for k in range(first, len(theta))]
    ends.append(profile.sigma())
    coefficients = tuple(
        replace(row, ci=profile.coefficient(column)) for column, row in enumerate(result.coefficients)
    )
    components = tuple(replace(row, ci=ci) for row, ci in zip(result.components, ends, strict=True))
    named = [(row.name, row.ci) for row in coefficients]
    named += [(f"{row.group} {row.term}".strip(), row.ci) for row in components]
    open_ended = [name for name, ci in named if ci and not np.isfinite(ci).all()]
    notes = result.notes
    if open_ended:
        notes += (
            f"the likelihood bounds no profile interval of {', '.join(open_ended)} on at least one side",
        )
    return replace(result, coefficients=coefficients, components=components, notes=notes)


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


def _terms_of(data: ModelData, group: Grouping, slopes: RandomSlopes) -> list[str]:
    sloped = slopes != "none" and data.has_slopes(group)
    return data.random_effects(slopes) if sloped else ["intercept"]


def _formula(data: ModelData, labels: list[str], slopes: Slopes, random_slopes: RandomSlopes) -> str:
    bar = "|" if slopes == "correlated" else "||"
    of_people = f"({_in_formula(labels)} {bar} {data.terms.participant})"
    others = ""
    for group in data.groups[1:]:
        terms = _terms_of(data, group, random_slopes)
        others += f" + ({_in_formula(terms)} {'||' if len(terms) > 1 else '|'} {group.name})"
    return f"{data.terms.rating} ~ {data.fixed_part} + {of_people}{others}"


def _in_formula(labels: Sequence[str]) -> str:
    return " + ".join("1" if label == "intercept" else label for label in labels)


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


def _coefficients(data: ModelData, beta: Floats, spread: Uncertainty | KenwardRoger) -> list[Coefficient]:
    rows = []
    for i, name in enumerate(data.column_names):
        contrast = np.eye(len(beta))[[i]]
        f_value, _, df, p = spread.f_test(beta, contrast)
        se = float(np.sqrt(spread.covariance[i, i]))
        t = float(np.sign(beta[i]) * np.sqrt(f_value))
        rows.append(
            Coefficient(name, float(beta[i]), se, df, t, float(min(p, 2 * special.stdtr(df, -abs(t)))))
        )
    return rows
