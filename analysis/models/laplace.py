"""Laplace approximation of the cumulative-logit model with crossed intercepts, with its exact gradient.

P(y <= k) = F(alpha_k - eta), eta = X beta + s_p u_participant + s_c v_item, u, v standard normal, F logistic,
as in R's ordinal::clmm (Christensen 2019). F(a) - F(b) = F(a) F(-b) (1 - exp(b - a)), so that the
log-likelihood of a rating has simple derivatives by eta: F(a) + F(b) - 1, then -(f(a) + f(b)).
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy import special

from experiments.errors import InputError

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

NEWTON_STEPS = 60
SCORE_TOLERANCE = 1e-9


@dataclass(frozen=True)
class OrdinalData:
    """Trials: x (n, f), category codes from 0 (n,), participant and item codes (n,)."""

    x: Floats = field(repr=False)
    category: Integers = field(repr=False)
    participant: Integers = field(repr=False)
    item: Integers = field(repr=False)
    n_categories: int
    n_participants: int
    n_items: int


@dataclass(frozen=True)
class Parameters:
    """Thresholds (categories - 1,), coefficients (f,), log SDs of participants and items."""

    thresholds: Floats
    beta: Floats
    log_sd: Floats


class _Trials:
    """Each trial's likelihood and derivatives at given parameters and random effects."""

    def __init__(self, data: OrdinalData, p: Parameters, u: Floats, v: Floats) -> None:
        sd = np.exp(p.log_sd)
        eta = data.x @ p.beta + sd[0] * u[data.participant] + sd[1] * v[data.item]
        edges = np.concatenate([[-np.inf], p.thresholds, [np.inf]])
        a, b = edges[data.category + 1] - eta, edges[data.category] - eta
        self.upper, self.lower = special.expit(a), special.expit(b)
        self.above = special.expit(-a)
        self.f_upper, self.f_lower = self.upper * self.above, self.lower * special.expit(-b)
        gap = np.exp(-(edges[data.category + 1] - edges[data.category]))
        self.log_likelihood = float((special.log_expit(a) + special.log_expit(-b) + np.log1p(-gap)).sum())
        self.between = gap / (1 - gap)
        self.slope = self.lower - self.above
        self.weight = self.f_upper + self.f_lower

    @property
    def curve_upper(self) -> Floats:
        return np.asarray(self.f_upper * (self.above - self.upper))

    @property
    def curve_lower(self) -> Floats:
        return np.asarray(self.f_lower * (1 - 2 * self.lower))


class _Hessian:
    """H = I + L'U'WUL of the crossed effects: both diagonal blocks are diagonal, the larger is eliminated."""

    def __init__(self, data: OrdinalData, sd: Floats, weight: Floats) -> None:
        n, j = data.n_participants, data.n_items
        pair = np.bincount(data.participant * j + data.item, weights=weight, minlength=n * j).reshape(n, j)
        self.swap = n > j
        b = sd[0] * sd[1] * (pair.T if self.swap else pair)
        d_p, d_i = 1 + sd[0] ** 2 * pair.sum(axis=1), 1 + sd[1] ** 2 * pair.sum(axis=0)
        self.d_small, self.d_large = (d_i, d_p) if self.swap else (d_p, d_i)
        self.scaled = b / self.d_large
        schur = np.diag(self.d_small) - self.scaled @ b.T
        self.inverse = np.linalg.inv(schur)
        self.log_det = float(np.linalg.slogdet(schur)[1] + np.log(self.d_large).sum())

    def solve(self, r_p: Floats, r_i: Floats) -> tuple[Floats, Floats]:
        small, large = (r_i, r_p) if self.swap else (r_p, r_i)
        x = self.inverse @ (small - self.scaled @ large)
        y = large / self.d_large - self.scaled.T @ x
        return (y, x) if self.swap else (x, y)

    def blocks(self) -> tuple[Floats, Floats, Floats]:
        """Inverse's diagonal of participants and of items, and the cross block (participants, items)."""
        cross = -self.inverse @ self.scaled
        small = np.diag(self.inverse)
        large = 1 / self.d_large - np.einsum("sl,sl->l", self.scaled, cross)
        return (large, small, cross.T) if self.swap else (small, large, cross)


@dataclass
class LaplaceLikelihood:
    """Log-likelihood of OrdinalData; keeps the last modes as the start for the next."""

    data: OrdinalData
    u: Floats = field(init=False, repr=False)
    v: Floats = field(init=False, repr=False)

    def __post_init__(self) -> None:
        self.u, self.v = np.zeros(self.data.n_participants), np.zeros(self.data.n_items)

    def _score(self, t: _Trials, sd: Floats, u: Floats, v: Floats) -> tuple[Floats, Floats]:
        d = self.data
        r_p = sd[0] * np.bincount(d.participant, weights=t.slope, minlength=d.n_participants) - u
        return r_p, sd[1] * np.bincount(d.item, weights=t.slope, minlength=d.n_items) - v

    def _modes(self, p: Parameters) -> tuple[_Trials, _Hessian]:
        """Newton with halved steps: the joint density is log-concave, so it always arrives."""
        sd, u, v = np.exp(p.log_sd), self.u, self.v
        t = _Trials(self.data, p, u, v)
        value = t.log_likelihood - (u @ u + v @ v) / 2
        for _ in range(NEWTON_STEPS):
            hessian = _Hessian(self.data, sd, t.weight)
            score = self._score(t, sd, u, v)
            if (
                max(np.abs(score[0]).max(), np.abs(score[1]).max())
                < SCORE_TOLERANCE * (1 + abs(value)) ** 0.5
            ):
                self.u, self.v = u, v
                return t, hessian
            step_p, step_i = hessian.solve(*score)
            length = 1.0
            while True:
                new_u, new_v = u + length * step_p, v + length * step_i
                trial = _Trials(self.data, p, new_u, new_v)
                reached = trial.log_likelihood - (new_u @ new_u + new_v @ new_v) / 2
                if reached >= value - 1e-9 * abs(value) or length < 1e-6:
                    break
                length /= 2
            u, v, t, value = new_u, new_v, trial, reached
        raise InputError("the random effects of the ordinal model do not settle; the ratings may be too few")

    def evaluate(self, p: Parameters) -> tuple[float, Parameters]:
        """Laplace log-likelihood, and its gradient in the form of Parameters."""
        d, sd = self.data, np.exp(p.log_sd)
        t, hessian = self._modes(p)
        u, v = self.u, self.v
        value = t.log_likelihood - (u @ u + v @ v) / 2 - hessian.log_det / 2
        inverse_p, inverse_i, cross = hessian.blocks()
        # spread: each trial's z' H^-1 z; pull: what a moved mode does to log|H|, carried back to eta
        spread = (
            sd[0] ** 2 * inverse_p[d.participant]
            + sd[1] ** 2 * inverse_i[d.item]
            + 2 * sd[0] * sd[1] * cross[d.participant, d.item]
        )
        change = -spread * (t.curve_upper + t.curve_lower)
        v_p, v_i = hessian.solve(
            sd[0] * np.bincount(d.participant, weights=change, minlength=d.n_participants),
            sd[1] * np.bincount(d.item, weights=change, minlength=d.n_items),
        )
        pull = sd[0] * v_p[d.participant] + sd[1] * v_i[d.item]
        beta = d.x.T @ (t.slope - (change - pull * t.weight) / 2)
        upper = t.above + t.between - (spread * t.curve_upper + pull * t.f_upper) / 2
        lower = -t.lower - t.between - (spread * t.curve_lower + pull * t.f_lower) / 2
        edges = np.bincount(d.category + 1, weights=upper, minlength=d.n_categories + 1)
        edges += np.bincount(d.category, weights=lower, minlength=d.n_categories + 1)
        log_sd = np.array([u @ u - (1 - inverse_p).sum() - v_p @ u, v @ v - (1 - inverse_i).sum() - v_i @ v])
        return float(value), Parameters(edges[1:-1].astype(np.float64), beta, log_sd)
