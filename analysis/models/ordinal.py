"""Cumulative-link mixed model of ratings: logit link, flexible thresholds, crossed random effects."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import optimize, special
from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]

from analysis.models.design import ModelData, ModelTerms, Slopes, model_data, slope_groups
from analysis.models.laplace import LaplaceLikelihood, OrdinalData, Parameters
from analysis.models.quadrature import QuadratureLikelihood
from analysis.models.separation import refuse_separation
from experiments.errors import InputError

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

MAXIMUM_CATEGORIES = 20
LOG_SD_BOUNDS = (-9.0, 4.0)
ZERO_LOG_SD = LOG_SD_BOUNDS[0] / 2
START_LOG_SD = np.log(0.6)
HESSIAN_STEP = 1e-4
MAX_NODES = 100

Likelihood = LaplaceLikelihood | QuadratureLikelihood


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


def fit_ordinal(
    rows: pd.DataFrame,
    participant: str,
    rating: str,
    within: Sequence[str],
    item: str | Sequence[str] | None = None,
    slopes: Slopes = "none",
    between: Sequence[str] = (),
    covariates: Sequence[str] = (),
    quadrature: int = 1,
) -> OrdinalResult:
    """Fit ordered ratings ~ full factorial of the factors + covariates with crossed random effects (Laplace).

    Parameters are those of `analysis.models.mixed.fit_mixed`; slopes of one effect share one variance over
    its orthonormal contrasts and do not correlate. Categories are the distinct ratings met, in order; a
    rating of the scale that nobody gave has no threshold of its own. With `quadrature` nodes (more than 1)
    the integral over each participant's intercept is adaptive Gauss-Hermite quadrature, which needs a model
    without items and slopes.

    Raises
    ------
    InputError
        As there, for quadrature of more than one random term or over 100 nodes, for more than 20 distinct
        ratings, for correlated slopes, and for effects that so few ratings leave undetermined.
    """
    if slopes == "correlated":
        raise InputError("slopes of the ordinal model do not correlate; expected all, main or none")
    items = (item,) if isinstance(item, str) else tuple(item or ())
    _refuse_quadrature(quadrature, items, slopes)
    columns = ModelTerms(participant, rating, tuple(within), items, tuple(between), tuple(covariates))
    data = model_data(rows, columns)
    categories, codes = np.unique(data.rating, return_inverse=True)
    if len(categories) > MAXIMUM_CATEGORIES:
        raise InputError(
            f"expected at most {MAXIMUM_CATEGORIES} distinct ratings, got {len(categories)}; "
            "use the linear mixed model for continuous ratings"
        )
    refuse_separation(data)
    groups, left_out = slope_groups(data, slopes)
    ordinal = _ordinal_data(data, codes.astype(np.int64), len(categories), groups)
    likelihood: Likelihood = LaplaceLikelihood(ordinal)
    # matrices this small only wait for a second thread
    with threadpool_limits(1, "blas"):
        packed, notes = _maximise(likelihood, _start(ordinal), bool(items))
        if quadrature > 1:
            likelihood = QuadratureLikelihood(ordinal, quadrature)
            packed, notes = _maximise(likelihood, packed, False)
        value, _ = likelihood.evaluate(_unpack(packed, ordinal))
        covariance = _covariance(likelihood, packed)
    _refuse_undetermined(data, np.diag(covariance)[len(categories) - 1 : -ordinal.n_sds])
    said = (*data.notes, *left_out, *notes, *_sd_notes(packed, groups, bool(items)))
    terms = _Terms(slopes, tuple(groups))
    result = _result(data, ordinal, packed, value, covariance, categories, said, terms)
    return replace(result, quadrature=quadrature)


def _refuse_quadrature(nodes: int, items: Sequence[str], slopes: Slopes) -> None:
    if not 1 <= nodes <= MAX_NODES:
        raise InputError(f"expected 1 to {MAX_NODES} nodes of quadrature, got {nodes}")
    if nodes > 1 and (items or slopes != "none"):
        further = f"the item {', '.join(items)}" if items else "slopes"
        raise InputError(
            f"quadrature is for participants' intercepts alone, and the model has {further} too; "
            "use Laplace's approximation (1 node), or leave these out"
        )


def _refuse_undetermined(data: ModelData, variances: Floats) -> None:
    # A flat likelihood has no curvature: the estimate is where the search stopped, and its error unknown.
    undetermined = [name for name, v in zip(data.column_names[1:], variances, strict=True) if not v > 0]
    if undetermined:
        raise InputError(
            f"the ordinal model has too few ratings or participants to tell {', '.join(undetermined)} apart "
            "from chance; use the linear mixed model, or collect more"
        )


@dataclass(frozen=True)
class _Terms:
    """The effects that differ between participants."""

    slopes: Slopes
    groups: tuple[str, ...]


def _ordinal_data(data: ModelData, codes: Integers, n_categories: int, groups: Sequence[str]) -> OrdinalData:
    columns = np.concatenate([data.columns(group) for group in groups])
    term = np.concatenate([np.full(len(data.columns(group)), k) for k, group in enumerate(groups)])
    people, items = data.participants, data.items
    return OrdinalData(
        data.x[:, 1:],
        data.spread[:, columns][data.cell],
        term.astype(np.int64),
        codes,
        people.codes,
        np.zeros(len(codes), np.int64) if items is None else items.codes,
        n_categories,
        len(people.names),
        1 if items is None else len(items.names),
    )


def _start(d: OrdinalData) -> Floats:
    """Thresholds from the pooled cumulative shares, no effects, moderate SDs."""
    shares = np.cumsum(np.bincount(d.category, minlength=d.n_categories))[:-1] / len(d.category)
    return _pack(
        Parameters(np.log(shares / (1 - shares)), np.zeros(d.x.shape[1]), np.full(d.n_sds, START_LOG_SD))
    )


def _pack(p: Parameters) -> Floats:
    """First threshold, logs of the gaps between thresholds, coefficients, log SDs."""
    return np.concatenate([p.thresholds[:1], np.log(np.diff(p.thresholds)), p.beta, p.log_sd])


def _unpack(packed: Floats, d: OrdinalData) -> Parameters:
    k = d.n_categories - 1
    thresholds = packed[0] + np.concatenate([[0.0], np.cumsum(np.exp(packed[1:k]))])
    return Parameters(thresholds, packed[k : -d.n_sds], packed[-d.n_sds :])


def _packed_gradient(gradient: Parameters, packed: Floats, d: OrdinalData) -> Floats:
    k = d.n_categories - 1
    later = np.cumsum(gradient.thresholds[::-1])[::-1]
    return np.concatenate([later[:1], later[1:] * np.exp(packed[1:k]), gradient.beta, gradient.log_sd])


def _maximise(likelihood: Likelihood, start: Floats, with_items: bool) -> tuple[Floats, tuple[str, ...]]:
    """Maximise the likelihood; without items their SD is held at its lower bound, which counts as zero."""
    d = likelihood.data
    start = start if with_items else np.append(start[:-1], LOG_SD_BOUNDS[0])

    def objective(packed: Floats) -> tuple[float, Floats]:
        value, gradient = likelihood.evaluate(_unpack(packed, d))
        return -value, -_packed_gradient(gradient, packed, d)

    bounds: list[tuple[float | None, float | None]] = [(None, None)] + [(-12.0, 5.0)] * (d.n_categories - 2)
    bounds += [(None, None)] * d.x.shape[1] + [LOG_SD_BOUNDS] * (d.n_sds - 1)
    bounds.append(LOG_SD_BOUNDS if with_items else (LOG_SD_BOUNDS[0], LOG_SD_BOUNDS[0]))
    optimum = optimize.minimize(
        objective,
        start,
        jac=True,
        method="L-BFGS-B",
        bounds=bounds,
        options={"maxiter": 2000, "maxfun": 4000, "ftol": 1e-13, "gtol": 1e-5, "maxcor": 30},
    )
    notes = () if optimum.success else (f"the optimiser stopped early: {optimum.message}",)
    return np.asarray(optimum.x, dtype=np.float64), notes


def _sd_notes(packed: Floats, groups: Sequence[str], with_items: bool) -> list[str]:
    names = ["participants", *(f"participants' slopes of {group}" for group in groups[1:])]
    names += ["items"] * with_items
    log_sds = packed[-len(groups) - 1 :]
    zero = "the SD of {} is estimated as zero"
    limit = (
        "the SD of {} is at its upper limit of {:.1f}: the ratings hardly bound it, and with it the estimates"
    )
    return [
        zero.format(name) if log_sd < ZERO_LOG_SD else limit.format(name, np.exp(LOG_SD_BOUNDS[1]))
        for name, log_sd in zip(names, log_sds, strict=False)
        if log_sd < ZERO_LOG_SD or log_sd > LOG_SD_BOUNDS[1] - 1e-6
    ]


def _covariance(likelihood: Likelihood, packed: Floats) -> Floats:
    """Inverse of the observed information from central differences of the exact gradient.

    SDs estimated as zero are held fixed.
    """
    d = likelihood.data
    is_sd = np.arange(len(packed)) >= len(packed) - d.n_sds
    free = np.flatnonzero(~(is_sd & (packed < ZERO_LOG_SD)))
    information = np.empty((len(free), len(free)))
    for row, k in enumerate(free):
        sides = []
        for sign in (1, -1):
            moved = packed.copy()
            moved[k] += sign * HESSIAN_STEP
            _, gradient = likelihood.evaluate(_unpack(moved, d))
            sides.append(_packed_gradient(gradient, moved, d)[free])
        information[row] = -(sides[0] - sides[1]) / (2 * HESSIAN_STEP)
    covariance = np.zeros((len(packed), len(packed)))
    covariance[np.ix_(free, free)] = np.linalg.pinv((information + information.T) / 2, hermitian=True)
    return covariance


def _result(
    data: ModelData,
    d: OrdinalData,
    packed: Floats,
    value: float,
    covariance: Floats,
    categories: Floats,
    notes: tuple[str, ...],
    terms: _Terms,
) -> OrdinalResult:
    p, first = _unpack(packed, d), d.n_categories - 1
    block = covariance[first : -d.n_sds, first : -d.n_sds]
    se = np.sqrt(np.maximum(np.diag(block), 0.0))
    coefficients = tuple(
        OrdinalCoefficient(name, float(b), float(s), float(b / s), float(2 * special.ndtr(-abs(b / s))))
        for name, b, s in zip(data.column_names[1:], p.beta, se, strict=True)
    )
    effects = []
    for effect in data.effects:
        columns = data.columns(effect) - 1
        chi2 = float(p.beta[columns] @ np.linalg.solve(block[np.ix_(columns, columns)], p.beta[columns]))
        effects.append(OrdinalEffect(effect, chi2, len(columns), float(special.chdtrc(len(columns), chi2))))
    components = _components(p, terms, data)
    return OrdinalResult(
        formula=_formula(data, terms),
        log_likelihood=value,
        aic=2 * (len(packed) - (data.items is None)) - 2 * value,
        categories=tuple(float(c) for c in categories),
        thresholds=tuple(float(t) for t in p.thresholds),
        coefficients=coefficients,
        effects=tuple(effects),
        sd_participant=components[0].sd,
        sd_item=components[-1].sd if data.items else 0.0,
        slopes=terms.slopes,
        components=components,
        singular=any(component.sd < np.exp(ZERO_LOG_SD) for component in components),
        n_ratings=len(data.rating),
        n_participants=len(data.participants.names),
        n_items=len(data.items.names) if data.items else 0,
        notes=notes,
        factors=data.factors,
    )


def _components(p: Parameters, terms: _Terms, data: ModelData) -> tuple[OrdinalComponent, ...]:
    sds = np.exp(p.log_sd)
    components = [
        OrdinalComponent(data.terms.participant, group, float(sd))
        for group, sd in zip(terms.groups, sds[:-1], strict=True)
    ]
    if data.items is not None:
        components.append(OrdinalComponent(data.items.name, "intercept", float(sds[-1])))
    return tuple(components)


def _formula(data: ModelData, terms: _Terms) -> str:
    participant = data.terms.participant
    slopes = "".join(f" + (0 + {group} | {participant})" for group in terms.groups[1:])
    items = f" + (1 | {data.items.name})" if data.items else ""
    return f"{data.terms.rating} ~ {data.fixed_part} + (1 | {participant}){slopes}{items}, logit"
