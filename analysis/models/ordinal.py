"""Cumulative-link mixed model of ratings: logit link, flexible thresholds, crossed random intercepts."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import optimize, stats

from analysis.models.design import ModelData, model_data
from analysis.models.laplace import LaplaceLikelihood, OrdinalData, Parameters
from experiments.errors import InputError

Floats = NDArray[np.float64]

MAXIMUM_CATEGORIES = 20
LOG_SD_BOUNDS = (-9.0, 4.0)
START_LOG_SD = np.log(0.6)
HESSIAN_STEP = 1e-4


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
class OrdinalResult:
    """A fitted cumulative-link mixed model; `thresholds[k]` lies between categories k and k + 1."""

    formula: str
    log_likelihood: float
    aic: float
    categories: tuple[float, ...]
    thresholds: tuple[float, ...]
    coefficients: tuple[OrdinalCoefficient, ...]
    effects: tuple[OrdinalEffect, ...]
    sd_participant: float
    sd_item: float
    n_ratings: int
    n_participants: int
    n_items: int
    notes: tuple[str, ...] = ()
    factors: tuple[str, ...] = ()


def fit_ordinal(
    rows: pd.DataFrame,
    participant: str,
    rating: str,
    within: Sequence[str],
    item: str | Sequence[str] | None = None,
) -> OrdinalResult:
    """Fit ordered ratings ~ full factorial of `within` with crossed random intercepts (Laplace).

    Parameters are those of `analysis.models.mixed.fit_mixed`. Categories are the distinct ratings met, in
    order; a rating of the scale that nobody gave has no threshold of its own. Raises InputError as there,
    and for more than 20 distinct ratings.
    """
    data = model_data(rows, participant, item, rating, within)
    categories, codes = np.unique(data.rating, return_inverse=True)
    if len(categories) > MAXIMUM_CATEGORIES:
        raise InputError(
            f"expected at most {MAXIMUM_CATEGORIES} distinct ratings, got {len(categories)}; "
            "use the linear mixed model for continuous ratings"
        )
    x = data.fixed[data.cell][:, 1:]
    ordinal = OrdinalData(
        x,
        codes.astype(np.int64),
        data.participant,
        data.item,
        len(categories),
        len(data.participants),
        max(1, len(data.items)),
    )
    likelihood = LaplaceLikelihood(ordinal)
    packed, notes = _maximise(likelihood, _start(ordinal), bool(data.items))
    value, _ = likelihood.evaluate(_unpack(packed, ordinal))
    covariance = _covariance(likelihood, packed)
    return _result(data, ordinal, packed, value, covariance, categories, notes, (participant, item, rating))


def _start(d: OrdinalData) -> Floats:
    """Thresholds from the pooled cumulative shares, no effects, moderate SDs."""
    shares = np.cumsum(np.bincount(d.category, minlength=d.n_categories))[:-1] / len(d.category)
    return _pack(Parameters(np.log(shares / (1 - shares)), np.zeros(d.x.shape[1]), np.full(2, START_LOG_SD)))


def _pack(p: Parameters) -> Floats:
    """First threshold, logs of the gaps between thresholds, coefficients, log SDs."""
    return np.concatenate([p.thresholds[:1], np.log(np.diff(p.thresholds)), p.beta, p.log_sd])


def _unpack(packed: Floats, d: OrdinalData) -> Parameters:
    k = d.n_categories - 1
    thresholds = packed[0] + np.concatenate([[0.0], np.cumsum(np.exp(packed[1:k]))])
    return Parameters(thresholds, packed[k:-2], packed[-2:])


def _packed_gradient(gradient: Parameters, packed: Floats, d: OrdinalData) -> Floats:
    k = d.n_categories - 1
    later = np.cumsum(gradient.thresholds[::-1])[::-1]
    return np.concatenate([later[:1], later[1:] * np.exp(packed[1:k]), gradient.beta, gradient.log_sd])


def _maximise(
    likelihood: LaplaceLikelihood, start: Floats, with_items: bool
) -> tuple[Floats, tuple[str, ...]]:
    """Maximise the likelihood; without items their SD is held at its lower bound, which counts as zero."""
    d = likelihood.data
    start = start if with_items else np.append(start[:-1], LOG_SD_BOUNDS[0])

    def objective(packed: Floats) -> tuple[float, Floats]:
        value, gradient = likelihood.evaluate(_unpack(packed, d))
        return -value, -_packed_gradient(gradient, packed, d)

    bounds: list[tuple[float | None, float | None]] = [(None, None)] + [(-12.0, 5.0)] * (d.n_categories - 2)
    bounds += [(None, None)] * d.x.shape[1] + [LOG_SD_BOUNDS]
    bounds.append(LOG_SD_BOUNDS if with_items else (LOG_SD_BOUNDS[0], LOG_SD_BOUNDS[0]))
    found = optimize.minimize(
        objective,
        start,
        jac=True,
        method="L-BFGS-B",
        bounds=bounds,
        options={"maxiter": 2000, "maxfun": 4000, "ftol": 1e-13, "gtol": 1e-5, "maxcor": 30},
    )
    notes = [] if found.success else [f"the optimiser stopped early: {found.message}"]
    for name, value in zip(("participants", "items")[: 1 + with_items], found.x[-2:], strict=False):
        if value < LOG_SD_BOUNDS[0] / 2:
            notes.append(f"the SD of {name} is estimated as zero")
    return np.asarray(found.x, dtype=np.float64), tuple(notes)


def _covariance(likelihood: LaplaceLikelihood, packed: Floats) -> Floats:
    """Inverse of the observed information from central differences of the exact gradient.

    SDs estimated as zero are held fixed.
    """
    d = likelihood.data
    free = np.flatnonzero(~((np.arange(len(packed)) >= len(packed) - 2) & (packed < LOG_SD_BOUNDS[0] / 2)))
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
    names: tuple[str, str | Sequence[str] | None, str],
) -> OrdinalResult:
    p, first = _unpack(packed, d), d.n_categories - 1
    block = covariance[first:-2, first:-2]
    se = np.sqrt(np.maximum(np.diag(block), 0.0))
    coefficients = tuple(
        OrdinalCoefficient(name, float(b), float(s), float(b / s), float(2 * stats.norm.sf(abs(b / s))))
        for name, b, s in zip(data.column_names[1:], p.beta, se, strict=True)
    )
    effects = []
    for effect in data.effects:
        columns = data.columns(effect) - 1
        chi2 = float(p.beta[columns] @ np.linalg.solve(block[np.ix_(columns, columns)], p.beta[columns]))
        effects.append(OrdinalEffect(effect, chi2, len(columns), float(stats.chi2.sf(chi2, len(columns)))))
    participant, item, rating = names
    items = f" + (1 | {item if isinstance(item, str) else '/'.join(item or ())})" if data.items else ""
    return OrdinalResult(
        formula=f"{rating} ~ {' * '.join(data.factors)} + (1 | {participant}){items}, logit",
        log_likelihood=value,
        aic=2 * (len(packed) - (not data.items)) - 2 * value,
        categories=tuple(float(c) for c in categories),
        thresholds=tuple(float(t) for t in p.thresholds),
        coefficients=coefficients,
        effects=tuple(effects),
        sd_participant=float(np.exp(p.log_sd[0])),
        sd_item=float(np.exp(p.log_sd[1])) if data.items else 0.0,
        n_ratings=len(data.rating),
        n_participants=len(data.participants),
        n_items=len(data.items),
        notes=notes,
        factors=data.factors,
    )
