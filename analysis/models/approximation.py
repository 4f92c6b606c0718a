"""How far Laplace's approximation moves the estimates of an ordinal model: integrals by many points."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy import special

from analysis.models.laplace import LaplaceLikelihood
from analysis.models.ordinal_data import OrdinalData, Parameters
from analysis.models.ordinal_maximum import Maximum, packed_gradient

Floats = NDArray[np.float64]

NODES = 21
"""Gauss-Hermite nodes of one dimension; their squares of two."""

LATTICE = 1024
"""Points of three dimensions and more."""

WIDER = 1.5
"""Variance of the lattice's points over the posterior's: the tails of a posterior are those of its prior."""

OFF_COEFFICIENT = 0.1
"""Standard errors by which a coefficient may be off without a warning."""

OFF_SD = 0.05
"""Share of its size by which a standard deviation may be off without a warning."""


def laplace_step(data: OrdinalData, maximum: Maximum, with_items: bool) -> Floats:
    r"""About how far exact integrals would move the estimates, in the form of `Maximum.covariance`.

    Notes
    -----
    One Newton step at Laplace's maximum: its covariance times the gradient of what the approximation lacks.
    The integral over participants is computed with items at their modes, and the other way round:

    .. math:: \delta = C \sum_g \nabla (\ell_g^{points} - \ell_g^{Laplace})
    """
    p = maximum.parameters
    laplace = LaplaceLikelihood(data)
    laplace.evaluate(p)
    u, v = laplace.u, laplace.v
    of_people = np.einsum("tc,tc->t", data.z * p.sd[data.term], u[data.participant])
    people = _lacking(
        replace(
            data,
            x=np.column_stack([data.x, p.sd[-1] * v[data.item]]),
            item=np.zeros_like(data.item),
            n_items=1,
        ),
        Parameters(p.thresholds, np.append(p.beta, 1.0), np.append(p.sd[:-1], 0.0)),
    )
    sd = people.sd.copy()
    thresholds, beta = people.thresholds, people.beta[:-1]
    if with_items and p.sd[-1] > 0:
        items = _lacking(
            OrdinalData(
                np.column_stack([data.x, of_people]),
                np.ones((len(data.category), 1)),
                np.zeros(1, np.int64),
                data.category,
                data.item,
                np.zeros_like(data.item),
                data.n_categories,
                data.n_items,
                1,
            ),
            Parameters(p.thresholds, np.append(p.beta, 1.0), np.array([p.sd[-1], 0.0])),
        )
        thresholds, beta = thresholds + items.thresholds, beta + items.beta[:-1]
        sd[-1] = items.sd[0]
    gradient = packed_gradient(Parameters(thresholds, beta, sd), np.log(np.diff(p.thresholds)))
    return np.asarray(maximum.covariance @ gradient, dtype=np.float64)


def _lacking(d: OrdinalData, p: Parameters) -> Parameters:
    """Gradient of the integral over one grouping less that of Laplace's approximation."""
    laplace = LaplaceLikelihood(d)
    _, approximate = laplace.evaluate(p)
    exact = _by_points(d, p, laplace)
    return Parameters(
        exact.thresholds - approximate.thresholds, exact.beta - approximate.beta, exact.sd - approximate.sd
    )


def _points(dimensions: int) -> tuple[Floats, Floats]:
    """Standard normal points (k, dimensions) and the logarithms of their weights."""
    if dimensions <= 2:
        x, w = np.polynomial.hermite_e.hermegauss(NODES)
        grids = np.meshgrid(*[x] * dimensions, indexing="ij")
        weights = np.meshgrid(*[np.log(w)] * dimensions, indexing="ij")
        points = np.stack([grid.ravel() for grid in grids], axis=1)
        normaliser = dimensions / 2 * np.log(2 * np.pi)
        return np.asarray(points, np.float64), np.asarray(
            sum(weight.ravel() for weight in weights) - normaliser
        )
    # Roberts' sequence: multiples of powers of the root of x^(d+1) = x + 1, which fill the cube evenly
    root = 2.0
    for _ in range(60):
        root = (1 + root) ** (1 / (dimensions + 1))
    steps = root ** -np.arange(1.0, dimensions + 1)
    uniform = (0.5 + np.arange(1, LATTICE + 1)[:, None] * steps) % 1.0
    half = special.ndtri(np.clip(uniform, 1e-12, 1 - 1e-12)) * np.sqrt(WIDER)
    # mirrored and whitened: exact for a normal posterior, where Laplace's approximation is exact too
    points = np.concatenate([half, -half])
    log_weight = -(points**2).sum(axis=1) / 2 * (1 - 1 / WIDER)
    log_weight -= special.logsumexp(log_weight)
    spread = np.linalg.cholesky((points * np.exp(log_weight)[:, None]).T @ points)
    return np.asarray(np.linalg.solve(spread, points.T).T, np.float64), np.asarray(log_weight, np.float64)


def _by_points(d: OrdinalData, p: Parameters, laplace: LaplaceLikelihood) -> Parameters:
    """Gradient of the log-likelihood, each level's integral by points laid on its mode and spread."""
    spreads = laplace.spreads(p)
    e, log_weight = _points(d.z.shape[1])
    log_weight = log_weight + (e**2).sum(axis=1) / 2
    edges = np.concatenate([[-np.inf], p.thresholds, [np.inf]])
    by_edge, beta, by_column = np.zeros(d.n_categories + 1), np.zeros(d.x.shape[1]), np.zeros(d.z.shape[1])
    order = np.argsort(d.participant, kind="stable")
    bounds = np.searchsorted(d.participant[order], np.arange(d.n_participants + 1))
    sds = p.sd[d.term]
    for level in range(d.n_participants):
        rows = order[bounds[level] : bounds[level + 1]]
        u = laplace.u[level] + e @ np.linalg.cholesky(spreads[level]).T
        category, z = d.category[rows], d.z[rows]
        eta = (d.x[rows] @ p.beta)[:, None] + (z * sds) @ u.T
        a, b = edges[category + 1][:, None] - eta, edges[category][:, None] - eta
        gap = np.exp(edges[category] - edges[category + 1])[:, None]
        each = special.log_expit(a) + special.log_expit(-b) + np.log1p(-gap)
        joint = each.sum(axis=0) - (u**2).sum(axis=1) / 2 + log_weight
        share = np.exp(joint - special.logsumexp(joint))
        between = gap / (1 - gap)
        upper, lower = special.expit(-a) + between, -special.expit(b) - between
        slope = -(upper + lower) * share
        by_edge += np.bincount(category + 1, upper @ share, d.n_categories + 1)
        by_edge += np.bincount(category, lower @ share, d.n_categories + 1)
        beta += d.x[rows].T @ slope.sum(axis=1)
        by_column += np.einsum("tk,tc,kc->c", slope, z, u, optimize=True)
    by_sd = np.append(np.bincount(d.term, by_column, d.n_sds - 1), 0.0)
    return Parameters(by_edge[1:-1], beta, by_sd)
