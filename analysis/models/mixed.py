"""Linear mixed models: participants crossed with clips, by-participant slopes, Satterthwaite tests."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import optimize, stats

from analysis.models.design import ModelData, Slopes, model_data, slope_groups
from analysis.models.reml import CrossProducts, criterion, cross_products
from analysis.models.satterthwaite import Uncertainty, f_test, uncertainty
from experiments.errors import InputError

Floats = NDArray[np.float64]

ZERO_THETA = 1e-4
"""A relative SD below this is tried at zero, its bound."""

SINGULAR_THETA = 1e-4
"""A standard deviation below this share of the residual's counts as zero."""

START = 0.4
"""Relative standard deviation to start from."""

LIFTS = (0.003, 0.01, 0.03, 0.1, 0.3)

NEWTON_STEPS = 8

NEWTON_DECREMENT = 1e-8
"""A step that promised less than this of the criterion was the last."""


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
) -> MixedResult:
    """Fit rating ~ full factorial of `within` with crossed random participants and items by REML.

    Parameters
    ----------
    rows : one row a trial.
    item : the column (or columns, together) that names what was rated; None for a model of participants
        alone, which generalises to no other clips.
    slopes : by-participant slopes. `all`: one variance for every effect, so that each test has its own error
        term; `main`: main effects only; `correlated`: intercept and main-effect slopes with all correlations
        (lme4's `(1 + A + B | participant)`); `none`: intercepts only, anti-conservative if people differ.

    Independent slopes share one variance over an effect's orthonormal contrasts, hence do not depend on
    coding; with two levels they are lme4's `||` with +1/-1 columns, with more `(1 | participant:A)`.

    Raises
    ------
    InputError
        Unknown columns, text for numbers, constant ratings, empty cells, or too few ratings for the model.
    """
    data = model_data(rows, participant, item, rating, within)
    groups, notes = slope_groups(data, slopes)
    patterns, labels = _patterns(data, groups, slopes)
    columns = np.concatenate([data.columns(g) for g in groups])
    x, z = data.fixed[data.cell], data.spread[:, columns][data.cell]
    if len(data.rating) <= x.shape[1] + len(patterns) + 2:
        raise InputError(
            f"expected more than {x.shape[1] + len(patterns) + 2} ratings, got {len(data.rating)}"
        )
    c = cross_products(x, z, data.rating, data.participant, data.item, patterns)
    theta = _fit_theta(c, _bounded(patterns, bool(data.items)))
    return _result(data, c, theta, labels, slopes, tuple(notes), participant, item, rating)


def _patterns(data: ModelData, groups: list[str], slopes: Slopes) -> tuple[Floats, list[str]]:
    """Lp = sum theta_k pattern_k: one diagonal pattern an effect, or every entry of a lower triangle."""
    of_column = [g for g in groups for _ in data.columns(g)]
    p = len(of_column)
    if slopes != "correlated":
        return np.stack([np.diag([float(g == name) for name in of_column]) for g in groups]), groups
    rows, columns = np.tril_indices(p)
    patterns = np.zeros((len(rows), p, p))
    patterns[np.arange(len(rows)), rows, columns] = 1.0
    return patterns, of_column


def _bounded(patterns: Floats, with_items: bool) -> list[bool]:
    """Which theta cannot be negative: those on the diagonal, and the items' own.

    Without items their theta starts at zero, where its gradient is zero, and so never leaves it.
    """
    return [bool(np.trace(pattern) > 0) for pattern in patterns] + [with_items]


def _fit_theta(c: CrossProducts, bounded: list[bool]) -> Floats:
    """Minimise; a theta that ended at zero, always stationary, is lifted where zero is no minimum."""
    theta = _descend(c, np.where(bounded, START, 0.0), bounded)
    for _ in range(len(bounded)):
        lifted = _lifted(c, theta, bounded)
        if lifted is None:
            break
        theta = _descend(c, lifted, bounded)
    return _polished(c, _zeroed(c, theta, bounded), bounded)


def _descend(c: CrossProducts, start: Floats, bounded: list[bool]) -> Floats:
    def objective(theta: Floats) -> tuple[float, Floats]:
        at = criterion(c, theta)
        return at.value, at.gradient

    found = optimize.minimize(
        objective,
        start,
        jac=True,
        method="L-BFGS-B",
        bounds=[(0.0, None) if b else (None, None) for b in bounded],
        options={"maxiter": 1000, "maxfun": 3000, "ftol": 1e-14, "gtol": 1e-8, "maxcor": 30},
    )
    return np.asarray(found.x, dtype=np.float64)


def _lifted(c: CrossProducts, theta: Floats, bounded: list[bool]) -> Floats | None:
    """Theta with one entry lifted from zero where that lowers the criterion, else None."""
    at = criterion(c, theta)
    for k in np.flatnonzero((np.abs(theta) < ZERO_THETA) & np.array(bounded) & (at.curve_at_zero < 0)):
        trials = np.repeat(theta[None], len(LIFTS), axis=0)
        trials[:, k] = LIFTS
        values = [criterion(c, trial).value for trial in trials]
        if min(values) < at.value - 1e-9:
            return np.asarray(trials[int(np.argmin(values))], dtype=np.float64)
    return None


def _zeroed(c: CrossProducts, theta: Floats, bounded: list[bool]) -> Floats:
    """Put tiny standard deviations at zero where that is no worse."""
    for k in np.flatnonzero((np.abs(theta) < ZERO_THETA) & np.array(bounded)):
        trial = theta.copy()
        trial[k] = 0.0
        if criterion(c, trial).value <= criterion(c, theta).value + 1e-9:
            theta = trial
    return theta


def _polished(c: CrossProducts, theta: Floats, bounded: list[bool]) -> Floats:
    """Newton steps on the free theta, with the Hessian from differences of the exact gradient."""
    at = criterion(c, theta)
    for _ in range(NEWTON_STEPS):
        free = np.flatnonzero(np.abs(theta) > 0)
        if len(free) == 0 or np.abs(at.gradient[free]).max() < 1e-9:
            break
        hessian = np.stack([_gradient_slope(c, theta, int(k))[free] for k in free])
        values, vectors = np.linalg.eigh((hessian + hessian.T) / 2)
        if values.min() <= 1e-8 * values.max():
            break
        rotated = vectors.T @ at.gradient[free]
        trial = theta.copy()
        trial[free] -= vectors @ (rotated / values)
        if (trial[np.array(bounded)] < 0).any():
            break
        after = criterion(c, trial)
        if not after.value < at.value + 1e-10 * abs(at.value):
            break
        theta, at = trial, after
        if float(rotated @ (rotated / values)) < NEWTON_DECREMENT:
            break
    return theta


def _gradient_slope(c: CrossProducts, theta: Floats, k: int) -> Floats:
    step = 1e-4 * max(abs(float(theta[k])), 0.05)
    up, down = theta.copy(), theta.copy()
    up[k] += step
    down[k] -= step
    return (criterion(c, up).gradient - criterion(c, down).gradient) / (2 * step)


def _result(
    data: ModelData,
    c: CrossProducts,
    theta: Floats,
    labels: list[str],
    slopes: Slopes,
    notes: tuple[str, ...],
    participant: str,
    item: str | Sequence[str] | None,
    rating: str,
) -> MixedResult:
    at, spread = criterion(c, theta), uncertainty(c, theta)
    effects = tuple(
        MixedEffect(effect, *f_test(at.beta, spread, data.differences(effect))) for effect in data.effects
    )
    item_name = item if isinstance(item, str) else "/".join(item or ())
    factor = np.tensordot(theta[:-1], c.patterns, 1)
    components = (*_components(participant, labels, factor, at.sigma, slopes, data),)
    if data.items:
        components += (Component(item_name, "intercept", at.sigma * float(theta[-1])),)
    degenerate = _degenerate(components, factor, at.sigma)
    components += (Component("residual", "", at.sigma),)
    return MixedResult(
        formula=_formula(data, rating, participant, item_name, labels, slopes),
        slopes=slopes,
        effects=effects,
        coefficients=tuple(_coefficients(data, at.beta, spread)),
        components=components,
        reml_criterion=at.value,
        sigma=at.sigma,
        theta=tuple(float(t) for t in theta),
        n_ratings=c.n,
        n_participants=len(data.participants),
        n_items=len(data.items),
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


def _formula(
    data: ModelData, rating: str, participant: str, item: str, labels: list[str], slopes: Slopes
) -> str:
    terms = list(dict.fromkeys("1" if label == "intercept" else label for label in labels))
    bar = "|" if slopes == "correlated" else "||"
    items = f" + (1 | {item})" if data.items else ""
    return f"{rating} ~ {' * '.join(data.factors)} + ({' + '.join(terms)} {bar} {participant}){items}"


def _components(
    participant: str, labels: list[str], factor: Floats, sigma: float, slopes: Slopes, data: ModelData
) -> list[Component]:
    covariance = sigma**2 * factor @ factor.T
    sds = np.sqrt(np.diag(covariance))
    if slopes != "correlated":
        first = np.cumsum([0, *[len(data.columns(label)) for label in labels[:-1]]])
        return [Component(participant, label, float(sds[i])) for label, i in zip(labels, first, strict=True)]
    with np.errstate(invalid="ignore", divide="ignore"):
        correlation = covariance / np.outer(sds, sds)
    return [
        Component(participant, name, float(sds[i]), tuple(float(r) for r in correlation[i, :i]))
        for i, name in enumerate(_told_apart(labels))
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
