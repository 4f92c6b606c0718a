"""Linear mixed models: crossed and nested groupings, by-participant slopes, Satterthwaite tests."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import sparse, special
from scipy.sparse import linalg
from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]

from analysis.models.columns import ModelTerms, RandomSlopes, Slopes, Units, split_covariates, units_of
from analysis.models.design import ModelData, model_data
from analysis.models.fixed_effect_tests import KenwardRoger, Uncertainty, kenward_roger, uncertainty
from analysis.models.means import Estimate, model_means, ratio_tests
from analysis.models.profile import Profile, with_intervals
from analysis.models.random_part import (
    Coefficient,
    Component,
    DfMethod,
    MixedEffect,
    MixedResult,
    components_of_people,
    degenerate_terms,
    fit_theta,
    formula_of,
    indistinct_variances_note,
    refuse_group_slopes,
    slope_groups,
    terms_of,
    theta_names,
    unmodelled_slopes,
)
from analysis.models.reml import CrossProducts, Term, criterion, cross_products
from analysis.models.residuals import mixed_checks
from experiments.errors import InputError

# Ratings that a mixed model repeats to the last digit: without residual variance nothing is tested.

EXACT = 1e-8
"""Residuals below this share of the ratings' spread are rounding."""


@contextmanager
def refused_where_exact(data: ModelData, terms: Sequence[Term]) -> Iterator[None]:
    """Say why a fit in this block divides by zero or a singular matrix.

    Raises
    ------
    InputError
        Where fixed effects and random terms together leave no residual; other errors pass.
    """
    try:
        yield
    except (np.linalg.LinAlgError, ZeroDivisionError) as error:
        # Random terms as if they were fixed: where nothing is left over, they predict every rating.
        # lsqr takes sparse columns and needs no full rank: random terms overlap the fixed ones.
        columns = sparse.hstack([sparse.csr_matrix(data.x), *(term.matrix() for term in terms)], format="csr")
        residual = float(linalg.lsqr(columns, data.rating, atol=1e-12, btol=1e-12)[3])
        # Another cause: the error is passed on as it is.
        if residual > EXACT * float(np.linalg.norm(data.rating - data.rating.mean())):
            raise
        raise InputError(
            "the ratings have no residual variance: factors, people and items predict each one exactly. "
            "Does each person give one rating throughout? Check the rating column"
        ) from error


Floats = NDArray[np.float64]


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
    means: bool = False,
    likelihood_ratio: bool = False,
    residuals: bool = False,
    equivalence: tuple[float, float] | None = None,
    effects: Sequence[str] | None = None,
    slope_effects: Sequence[str] = (),
    group_slopes: Sequence[tuple[str, tuple[str, ...]]] = (),
    correlated_slopes: Sequence[str] | None = None,
    progress: Callable[[str], None] | None = None,
) -> MixedResult:
    """Fit rating ~ full factorial of the factors + covariates with crossed random groupings by REML.

    Independent slopes share one variance over an effect's orthonormal contrasts, hence do not depend on
    coding; with two levels they are lme4's `||` with +1/-1 columns, with more `(1 | participant:A)`.

    Parameters
    ----------
    rows : DataFrame
        One row per trial.
    item : str or sequence of str, optional
        The column (or columns, together) that names what was rated; None for a model of participants alone,
        which generalizes to no other clips.
    slopes : {"none", "main", "all", "correlated"}, optional
        By-participant slopes. `all`: one variance for every effect within participants, so that each test has
        its own error term; `main`: main effects only; `correlated`: intercept and main-effect slopes with all
        correlations (lme4's `(1 + A + B | participant)`); `none`: intercepts only, anti-conservative if
        people differ.
    between : sequence of str, optional
        Factors with one level for each participant, crossed with those within.
    covariates : sequence of str, optional
        Numbers, centered. `age:blur` and `age:trial` are interactions with a factor or another covariate;
        their covariates are in the model too. A covariate that varies within participants has a
        by-participant slope wherever factors have one, correlated with the intercept.
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
    means : bool, optional
        Add marginal means, their pairs, and trends of covariates.
    likelihood_ratio : bool, optional
        Add likelihood-ratio tests (maximum likelihood, without an effect's sum-coded columns).
    residuals : bool, optional
        Add residual checks by ratings simulated from the model.
    equivalence : tuple of float, optional
        Bounds of equivalence for pairs of marginal means.
    effects : sequence of str, optional
        The effects of factors that the model has, such as a and a:b; default: all.
    slope_effects : sequence of str, optional
        The effects with by-participant slopes, correlated if `slopes` says so; default: as `slopes` says.
    group_slopes : sequence of (str, tuple of str), optional
        Further groupings, such as the item, with the effects that differ between their levels, uncorrelated.
    correlated_slopes : sequence of str, optional
        The covariates whose by-participant slopes correlate with the intercept where `slopes` is `all` or
        `main`; default: every covariate with such a slope.
    progress : callable, optional
        Takes a word on every interval before it is computed.

    Raises
    ------
    InputError
        Unknown columns, text for numbers, constant ratings, empty cells, or too few ratings for the model.
    """
    # One column or several together name an item.
    items = (item,) if isinstance(item, str) else tuple(item or ())
    numbers, interactions = split_covariates(covariates, (*within, *between))
    terms = ModelTerms(
        participant,
        rating,
        tuple(within),
        items,
        tuple(between),
        numbers,
        tuple(random),
        interactions,
        None if effects is None else tuple(effects),
        tuple(slope_effects) or None,
        tuple(group_slopes),
        None if correlated_slopes is None else tuple(correlated_slopes),
    )
    data = model_data(rows, terms)
    sloped, notes = slope_groups(data, slopes)
    refuse_group_slopes(data)
    random_terms = data.random_terms(slopes, sloped, random_slopes)
    # Each pattern has one parameter of the random part; the residual variance is one more.
    parameters = sum(len(term.patterns) for term in random_terms)
    x = data.x
    if len(data.rating) <= x.shape[1] + parameters + 1:
        raise InputError(f"expected more than {x.shape[1] + parameters + 1} ratings, got {len(data.rating)}")
    # matrices this small only wait for a second thread
    # The search, and whatever is taken from its end, may divide by a residual of 0.
    with threadpool_limits(1, "blas"), refused_where_exact(data, random_terms):
        # Standardized ratings: the search then has the same tolerance for any unit.
        units = units_of(data.rating)
        c = cross_products(x, units.scaled(data.rating), random_terms)
        theta = fit_theta(c)
        fitted = _RemlFit(data, random_terms, c, theta, units)
        notes += unmodelled_slopes(data, slopes)
        result = _result(
            fitted, sloped, slopes, random_slopes, df_method, (*data.notes, *notes), means, equivalence
        )
        if likelihood_ratio:
            result = replace(result, ratio_tests=ratio_tests(data, Profile(c, theta).chi2_without))
        if residuals:
            factors = [block.factor(theta) for block in c.blocks]
            at = criterion(c, theta)
            checks = mixed_checks(units.scaled(data.rating), x, at.beta, random_terms, factors, at.sigma)
            # Back to the units of the ratings, as the figure shows them.
            moved = tuple(value * units.scale + units.middle for value in checks.fitted)
            result = replace(result, residuals=replace(checks, fitted=moved))
        if not intervals:
            return result
        # Slopes of covariates are fitted in SDs and reported in the covariate's own unit.
        scales = [data.unit(row.term) for row in result.components]
        return with_intervals(result, c, theta, units, progress, scales)


@dataclass(frozen=True)
class _RemlFit:
    """Coded trials, their random terms, cross-products in standardized units, the REML estimate's theta."""

    data: ModelData
    terms: list[Term]
    c: CrossProducts
    theta: Floats
    units: Units


def _result(
    fitted: _RemlFit,
    labels: list[str],
    slopes: Slopes,
    random_slopes: RandomSlopes,
    df_method: DfMethod,
    notes: tuple[str, ...],
    means: bool,
    equivalence: tuple[float, float] | None,
) -> MixedResult:
    data, c, theta, units = fitted.data, fitted.c, fitted.theta, fitted.units
    at = criterion(c, theta)
    sigma = at.sigma * units.scale
    known = uncertainty(c, theta, at)
    notes += indistinct_variances_note(
        known, theta_names(data, labels, slopes, random_slopes, c.blocks[0].theta.stop)
    )
    spread: Uncertainty | KenwardRoger = known
    if df_method == "kenward-roger":
        spread = kenward_roger(fitted.terms, c, theta, at)
    # Differences from the first level, as lmerTest writes contrasts: its df depend on that.
    effects = tuple(
        MixedEffect(effect, *spread.f_test(at.beta, data.differences(effect))) for effect in data.effects
    )

    def estimated(contrast: Floats) -> Estimate:
        df = spread.f_test(at.beta, contrast[None])[2]
        # Only the intercept's column carries the origin that was taken off the ratings.
        value = float(contrast @ at.beta) * units.scale + float(contrast[0]) * units.middle
        return value, float(np.sqrt(contrast @ spread.covariance @ contrast)) * units.scale, df

    factor = c.blocks[0].factor(theta)
    components = (*components_of_people(labels, factor, sigma, slopes, data),)
    # The first block is that of the participants, which may have correlations.
    for group, block in zip(data.groups[1:], c.blocks[1:], strict=True):
        terms = terms_of(data, group, random_slopes)
        sds = sigma * theta[block.theta] / [data.unit(term) for term in terms]
        components += tuple(Component(group.name, *of) for of in zip(terms, map(float, sds), strict=True))
    degenerate = degenerate_terms(components, factor, sigma, data, effects)
    components += (Component("residual", "", sigma),)
    return MixedResult(
        formula=formula_of(data, labels, slopes, random_slopes),
        slopes=slopes,
        effects=effects,
        coefficients=tuple(_coefficients(data, at.beta, spread, units)),
        components=components,
        # A density changes with the unit of the ratings: by log(scale) for each of the nu residual df.
        reml_criterion=at.value + 2 * at.nu * np.log(units.scale),
        sigma=sigma,
        theta=tuple(float(t) for t in theta),
        n_ratings=c.n,
        n_participants=len(data.participants.names),
        n_items=len(data.items.names) if data.items else 0,
        n_groups={group.name: len(group.names) for group in data.groups},
        singular=bool(degenerate),
        notes=(*notes, *degenerate),
        factors=data.factors,
        df_method=df_method,
        means=model_means(data, estimated, equivalence) if means else None,
    )


def _coefficients(
    data: ModelData, fitted: Floats, spread: Uncertainty | KenwardRoger, units: Units
) -> list[Coefficient]:
    # The origin of the ratings goes back into the intercept, so that its test is against 0.
    beta, rows = fitted + units.middle / units.scale * np.eye(len(fitted))[0], []
    for i, name in enumerate(data.column_names):
        contrast = np.eye(len(beta))[[i]]
        f_value, _, df, p = spread.f_test(beta, contrast)
        estimate, se = float(beta[i]) * units.scale, float(np.sqrt(spread.covariance[i, i])) * units.scale
        # F of one contrast is t squared; the sign is that of the estimate.
        t = float(np.sign(beta[i]) * np.sqrt(f_value))
        # The smaller of two equal values: one of both may have lost digits by rounding.
        rows.append(Coefficient(name, estimate, se, df, t, float(min(p, 2 * special.stdtr(df, -abs(t))))))
    return rows
