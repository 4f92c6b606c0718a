"""Means and covariance of the cells that give the wanted figures, and participants drawn from them."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from analysis.synthetic.published import Published
from analysis.synthetic.space import DesignSpace
from analysis.synthetic.targets import Targets, TestTarget

Floats = NDArray[np.float64]

NEVER_ABOVE = 0.5
"""Share of the F bound at which an effect of unknown size that must not be significant starts."""


@dataclass(frozen=True)
class Population:
    """Cell means (cells,) and covariance (cells, cells) of participants' cell means."""

    means: Floats = field(repr=False)
    covariance: Floats = field(repr=False)


def make_population(
    published: Published, space: DesignSpace, targets: Targets, rng: np.random.Generator
) -> Population:
    """Choose means by least change from a flat table, then error variances that give the wanted F's.

    An effect without any known mean gets small random contrasts (none where F = 0 is wanted), one without a
    known F the usual variance.
    """
    means = _cell_means(published, space, targets)
    variances: dict[str, Floats] = {}
    tests = {t.name.removeprefix("F "): t for t in targets.tests}
    for effect, contrasts in space.effects.items():
        q = contrasts.shape[1]
        z = contrasts.T @ means
        target = tests.get(effect)
        is_zero = target is not None and target.start is not None and target.start < 0.01
        if is_zero:
            means, z = means - contrasts @ z, np.zeros(q)
        elif z @ z < 1e-6:
            z = rng.normal(size=q) * published.contrast_sd / np.sqrt(targets.n)
            if published.assumed and target is not None and target.start is not None:
                z *= (
                    np.sqrt(target.start * q / (targets.n - q) * (targets.n - 1) / (z @ z))
                    * published.contrast_sd
                )
                z /= np.sqrt(targets.n)
            means = means + contrasts @ z
        share = published.slope_shares.get(effect, 0.0)
        variances[effect] = _error_variance(z, target, targets.n, published.contrast_sd, share)
    return Population(means, _covariance(published, space, targets, variances))


def _cell_means(published: Published, space: DesignSpace, targets: Targets) -> Floats:
    means = np.full(space.n_cells, published.grand_mean)
    if published.invented_means:
        rows = np.stack([space.weights(m.at) for m in published.invented_means])
        means = means + np.linalg.pinv(rows) @ (
            np.array([m.mean for m in published.invented_means]) - rows @ means
        )
    if targets.means:
        rows = np.stack([t.weights for t in targets.means])
        middle = np.array([(t.low + t.high) / 2 for t in targets.means])
        means = means + np.linalg.pinv(rows) @ (middle - rows @ means)
    return np.asarray(means, dtype=np.float64)


def _error_variance(z: Floats, target: TestTarget | None, n: int, sd: float, share: float) -> Floats:
    r"""Covariance (q, q) of an effect's contrasts; `share` of the error is along the effect itself.

    Exact for F with Hotelling's lambda:

    .. math::

        \lambda &= F q / (n - q) = \frac{n}{n - 1} z' V^{-1} z \tag{1} \\
        V &= \rho \{(1 - a) \, z'z \, I + a \, z z'\}, \quad \rho = \frac{n}{n - 1} / \lambda \tag{2}

    z are the contrasts' means (q,), V their covariance, n people, a the share. (2) solves (1) for every a,
    since V z = rho z'z z.
    """
    q = len(z)
    usual = sd**2 * np.eye(q)
    if target is None:
        return usual
    f = target.start
    if f is None:
        present = n / (n - 1) * float(z @ z) / sd**2 * (n - q) / q
        if not target.low <= present <= target.high:
            f = target.high * NEVER_ABOVE if present > target.high else max(target.low * 1.5, 1e-6)
    if f is None or f <= 0.01:
        return usual
    ratio = n / (n - 1) / (f * q / (n - q))
    if q == 1:
        return np.array([[ratio * float(z @ z)]])
    return (1 - share) * ratio * float(z @ z) * np.eye(q) + share * ratio * np.outer(z, z)


def _covariance(
    published: Published, space: DesignSpace, targets: Targets, variances: dict[str, Floats]
) -> Floats:
    """Put grand mean and effects together; wanted SDs of margins fix how effects go with the grand mean."""
    k = space.n_cells
    flat = np.full((k, 1), 1 / np.sqrt(k))
    effects = sum((c @ variances[e] @ c.T for e, c in space.effects.items()), np.zeros((k, k)))
    variances_needed = [
        ((s.low + s.high) / 2) ** 2 - float(s.weights @ effects @ s.weights) for s in targets.spreads
    ]
    grand = float(np.mean(variances_needed)) if variances_needed else published.grand_sd**2
    together = np.zeros(k)
    if variances_needed:
        # var(margin) = grand + 2 w.c + w'Ew with c the covariance of the cells' effects with the grand mean
        rows = np.stack([s.weights for s in targets.spreads])
        rows = rows - rows.mean(axis=1, keepdims=True)
        together = np.linalg.pinv(rows) @ ((np.array(variances_needed) - grand) / 2)
        together -= together.mean()
    ones = np.sqrt(k) * flat[:, 0]
    full = grand * np.outer(ones, ones) + np.outer(ones, together) + np.outer(together, ones) + effects
    values, vectors = np.linalg.eigh(full)
    return np.asarray((vectors * np.maximum(values, 1e-6)) @ vectors.T, dtype=np.float64)


def draw(population: Population, n: int, rng: np.random.Generator, exact: bool) -> Floats:
    """Draw cell means (n, cells); `exact` makes sample mean and covariance those of the population.

    Exactness needs more participants than cells; with fewer the draw is a plain random one.
    """
    k = len(population.means)
    noise = rng.normal(size=(n, k))
    if exact and n > k:
        noise -= noise.mean(axis=0)
        noise = np.linalg.qr(noise)[0] * np.sqrt(n - 1)
    values, vectors = np.linalg.eigh(population.covariance)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    return np.asarray(population.means + noise @ root.T, dtype=np.float64)
