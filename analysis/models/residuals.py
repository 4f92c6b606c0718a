"""Residual checks of mixed and ordinal models, by ratings simulated from the fitted model."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy import sparse, special, stats
from scipy.sparse import linalg

from analysis.models.laplace import LaplaceLikelihood, OrdinalData, Parameters
from analysis.models.reml import Term

Floats = NDArray[np.float64]
SEED = 53
SIMULATIONS, SIMULATIONS_ORDINAL, SIMULATIONS_MIN = 499, 199, 99
CELLS_MAX = 20_000_000
"""Simulated ratings that are held at once; longer tables have fewer simulations."""


@dataclass(frozen=True)
class ResidualTest:
    """A statistic of the ratings, and the share of simulated data sets where it is as large or larger."""

    name: str
    statistic: float
    p_value: float


@dataclass(frozen=True)
class ResidualChecks:
    """Tests, and what is drawn of each rating.

    Attributes
    ----------
    fitted, residuals : tuple of float
        Predictions with random effects (ordinal: on the logit scale), and standardized residuals; an ordinal
        rating's is drawn within its category (Dunn and Smyth 1996).
    scaled : tuple of float
        Rank of each residual among its simulations, from 0 to 1: uniform if the model holds.
    """

    n_simulations: int
    tests: tuple[ResidualTest, ...]
    fitted: tuple[float, ...] = field(repr=False)
    residuals: tuple[float, ...] = field(repr=False)
    scaled: tuple[float, ...] = field(repr=False)


def mixed_checks(
    rating: Floats, x: Floats, beta: Floats, terms: Sequence[Term], factors: Sequence[Floats], sigma: float
) -> ResidualChecks:
    """Checks of a linear mixed model.

    Parameters
    ----------
    rating, x, beta : (n,), (n, f) and (f,) arrays
    terms : sequence of Term
    factors : sequence of (p, p) arrays
        Of each term, the factor of its covariance over sigma squared.
    sigma : float
    """
    z = sparse.csr_matrix(
        sparse.hstack(
            [
                term.matrix() @ sparse.kron(sparse.eye(term.levels), of)
                for term, of in zip(terms, factors, strict=True)
            ]
        )
    )
    fixed, number = x @ beta, _simulations(len(rating), SIMULATIONS)
    random = np.random.default_rng(SEED)
    effects, noise = (random.normal(size=(size, number)) for size in (z.shape[1], len(rating)))
    sets = np.column_stack([rating, fixed[:, None] + sigma * (z @ effects + noise)])
    # Henderson's equations give coefficients and modes of every data set, its variances as estimated
    whole = sparse.csr_matrix(sparse.hstack([sparse.csr_matrix(x), z]))
    penalty = sparse.diags(np.repeat([0.0, 1.0], [x.shape[1], z.shape[1]]))
    solved = linalg.splu(sparse.csc_matrix(whole.T @ whole + penalty)).solve(whole.T @ sets)
    predicted = whole @ solved
    residuals = ((sets - predicted) / sigma).T
    return _checks(fixed, predicted[:, 0], residuals / residuals.std(axis=1, keepdims=True), residuals[0])


def ordinal_checks(data: OrdinalData, p: Parameters) -> ResidualChecks:
    """Checks of a cumulative-link mixed model at its estimates; each data set has its own modes."""
    random, likelihood = np.random.default_rng(SEED), LaplaceLikelihood(data)
    fixed = data.x @ p.beta
    edges = np.concatenate([[-np.inf], p.thresholds, [np.inf]])

    def drawn(of: LaplaceLikelihood) -> tuple[Floats, Floats]:
        of.evaluate(p)
        fitted = of.predictor(p, of.u, of.v)
        low, high = (special.expit(edges[of.data.category + step] - fitted) for step in (0, 1))
        inside = low + random.random(len(fitted)) * (high - low)
        # The quantiles of 0 and 1 are infinite.
        return fitted, np.asarray(special.ndtri(np.clip(inside, 1e-15, 1 - 1e-15)), dtype=np.float64)

    fitted, observed = drawn(likelihood)
    sets = [observed]
    for _ in range(_simulations(len(fixed), SIMULATIONS_ORDINAL)):
        effects = (random.normal(size=own.shape) for own in (likelihood.u, likelihood.v))
        eta = likelihood.predictor(p, *effects)
        # The category is the number of thresholds below the latent value.
        category = np.searchsorted(p.thresholds, eta + random.logistic(size=len(eta)))
        sets.append(drawn(LaplaceLikelihood(replace(data, category=category)))[1])
    return _checks(fixed, fitted, np.stack(sets), observed)


def _simulations(n: int, most: int) -> int:
    return max(SIMULATIONS_MIN, min(most, CELLS_MAX // n))


def _checks(fixed: Floats, fitted: Floats, sets: Floats, residuals: Floats) -> ResidualChecks:
    r"""Compare residuals with those of simulations (S + 1, n), after DHARMa (Hartig 2022).

    The first data set is the observed one. Random effects are drawn again for each simulation and predicted
    from it as from the ratings, so that residuals of one person are not taken as independent. Each residual
    is ranked trial by trial within all data sets. Then

    .. math::

        p = \#\{s: T_s \geq T_{\text{observed}}\} / (S + 1) \tag{1}

    T are the distance of the ranks from a uniform distribution (Kolmogorov and Smirnov), the largest
    residual, and the correlation (Spearman's, its size) of residuals' sizes with the fixed effects.
    """
    number, n = len(sets) - 1, len(fixed)
    # In the middle of their steps: no rank is 0 or 1.
    scaled = (np.argsort(np.argsort(sets, axis=0), axis=0) + 0.5) / (number + 1)
    steps = np.arange(n) / n
    ordered = np.sort(scaled, axis=1)
    distance = np.maximum(ordered - steps, steps + 1 / n - ordered).max(axis=1)
    statistics = [("uniformity (KS distance)", distance), ("largest residual", np.abs(sets).max(axis=1))]
    if np.ptp(fixed) > 0:
        position = stats.rankdata(fixed)
        spread = stats.rankdata(np.abs(sets), axis=1)
        centred = position - position.mean()
        away = spread - spread.mean(axis=1, keepdims=True)
        correlation = away @ centred / np.sqrt((away**2).sum(axis=1) * (centred**2).sum())
        statistics.append(("spread along fixed effects (|r|)", np.abs(correlation)))
    # The observed data set counts as well, so that p is never 0.
    tests = tuple(
        ResidualTest(name, float(values[0]), float(np.mean(values >= values[0] - 1e-12)))
        for name, values in statistics
    )
    return ResidualChecks(
        number, tests, tuple(fitted.tolist()), tuple(residuals.tolist()), tuple(scaled[0].tolist())
    )
