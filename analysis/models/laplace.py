"""Laplace approximation of the cumulative-logit model with crossed random effects, with its exact gradient.

P(y <= k) = F(alpha_k - eta), eta = X beta + sum_c s_c z_c u_participant,c + s_i v_item, u, v standard
normal, F logistic, as in R's ordinal::clmm (Christensen 2019); the first column z is ones, the intercept, the
others are contrasts, whose slopes differ between participants. F(a) - F(b) = F(a) F(-b) (1 - exp(b - a)), so
that the log-likelihood of a rating has simple derivatives by eta: F(a) + F(b) - 1, then -(f(a) + f(b)).
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy import special

from analysis.models.ordinal_data import OrdinalData, Parameters, by_sd
from analysis.models.ordinal_hessian import CrossedHessian
from experiments.errors import InputError

Floats = NDArray[np.float64]

NEWTON_STEPS = 60
SCORE_TOLERANCE = 1e-9


class Trials:
    """Each trial's likelihood and derivatives; u (people, c) and v (items,) are the random effects."""

    def __init__(self, data: OrdinalData, p: Parameters, u: Floats, v: Floats) -> None:
        of_people = np.einsum("tc,tc->t", data.z * p.sd[data.term], u[data.participant])
        eta = data.x @ p.beta + of_people + p.sd[-1] * v[data.item]
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
        """Derivative of `f_upper` by the edge above, (n,)."""
        return np.asarray(self.f_upper * (self.above - self.upper))

    @property
    def curve_lower(self) -> Floats:
        """Derivative of `f_lower` by the edge below, (n,)."""
        return np.asarray(self.f_lower * (1 - 2 * self.lower))


@dataclass
class LaplaceLikelihood:
    """Log-likelihood of OrdinalData; keeps the last modes as the start for the next."""

    data: OrdinalData
    u: Floats = field(init=False, repr=False)
    v: Floats = field(init=False, repr=False)

    def __post_init__(self) -> None:
        self.u = np.zeros((self.data.n_participants, self.data.z.shape[1]))
        self.v = np.zeros(self.data.n_items)

    def _carried(self, scaled: Floats, sd_item: float, values: Floats) -> tuple[Floats, Floats]:
        """L' of values of trials (n,): to participants (people, c) and items (items,)."""
        d = self.data
        columns = [np.bincount(d.participant, values * z, d.n_participants) for z in scaled.T]
        of_items = np.asarray(sd_item * np.bincount(d.item, values, d.n_items), np.float64)
        return np.stack(columns, axis=1), of_items

    def _modes(self, p: Parameters, scaled: Floats, sd_item: float) -> tuple[Trials, CrossedHessian]:
        """Newton with halved steps: the joint density is log-concave, so it always arrives."""
        u, v = self.u, self.v
        t = Trials(self.data, p, u, v)
        value = t.log_likelihood - ((u**2).sum() + v @ v) / 2
        for _ in range(NEWTON_STEPS):
            hessian = CrossedHessian(self.data, scaled, sd_item, t.weight)
            of_people, of_items = self._carried(scaled, sd_item, t.slope)
            score = of_people - u, of_items - v
            if (
                max(np.abs(score[0]).max(), np.abs(score[1]).max())
                < SCORE_TOLERANCE * (1 + abs(value)) ** 0.5
            ):
                self.u, self.v = u, v
                return t, hessian
            u, v, t, value = self._step(p, (u, v), hessian.solve(*score), value)
        raise InputError(
            "the random effects of the ordinal model do not settle; ratings may be separated or few"
        )

    def _step(
        self, p: Parameters, at: tuple[Floats, Floats], step: tuple[Floats, Floats], value: float
    ) -> tuple[Floats, Floats, Trials, float]:
        """A Newton step, halved until the joint density does not fall."""
        length = 1.0
        while True:
            u, v = at[0] + length * step[0], at[1] + length * step[1]
            trial = Trials(self.data, p, u, v)
            reached = trial.log_likelihood - ((u**2).sum() + v @ v) / 2
            if reached >= value - 1e-9 * abs(value) or length < 1e-6:
                return u, v, trial, reached
            length /= 2

    def intercepts(self, p: Parameters) -> tuple[Floats, Floats, Trials]:
        """Modes of participants' first coefficient (people,), roots of its entries in H^-1, trials there."""
        trials, hessian = self._modes(p, self.data.z * p.sd[self.data.term], float(p.sd[-1]))
        return self.u[:, 0], np.sqrt(hessian.blocks()[0][:, 0, 0]), trials

    def spreads(self, p: Parameters) -> Floats:
        """Participants' blocks (people, c, c) of H^-1 at the modes, which are kept."""
        _, hessian = self._modes(p, self.data.z * p.sd[self.data.term], float(p.sd[-1]))
        return hessian.blocks()[0]

    def evaluate(self, p: Parameters) -> tuple[float, Parameters]:
        r"""Laplace log-likelihood, and its gradient in the form of Parameters.

        Notes
        -----
        l is the ratings' log-likelihood at the modes b = (u, v), Z their columns times the SDs, W minus the
        second derivatives of l by eta, and H = Z'WZ + I:

        .. math::

            \mathcal L &= l(\eta) - b'b / 2 - \log|H| / 2 \tag{1} \\
            q_t &= z_t' H^{-1} z_t, \quad
            c_t = \partial \log|H| / \partial \eta_t = q_t \, dW_t / d\eta_t \tag{2} \\
            \partial \mathcal L / \partial \beta &= X' \{l'(\eta) - (c - W Z H^{-1} Z' c) / 2\} \tag{3}

        In (3) the modes move with eta, by -H^-1 Z'W; q is `spread`, c `change`, ZH^-1 Z'c `pull`. Thresholds
        and SDs follow by the same chain.
        """
        d = self.data
        scaled, sd_item = d.z * p.sd[d.term], float(p.sd[-1])
        t, hessian = self._modes(p, scaled, sd_item)
        u, v = self.u, self.v
        value = t.log_likelihood - ((u**2).sum() + v @ v) / 2 - hessian.log_det / 2
        of_people, of_items, cross = hessian.blocks()
        # spread: each trial's z' H^-1 z; pull: what a moved mode does to log|H|, carried back to eta
        spread = (
            np.einsum("tc,tcd,td->t", scaled, of_people[d.participant], scaled)
            + sd_item**2 * of_items[d.item]
            + 2 * sd_item * np.einsum("tc,tc->t", scaled, cross[d.participant, :, d.item])
        )
        change = -spread * (t.curve_upper + t.curve_lower)
        v_p, v_i = hessian.solve(*self._carried(scaled, sd_item, change))
        pull = np.einsum("tc,tc->t", scaled, v_p[d.participant]) + sd_item * v_i[d.item]
        beta = d.x.T @ (t.slope - (change - pull * t.weight) / 2)
        upper = t.above + t.between - (spread * t.curve_upper + pull * t.f_upper) / 2
        lower = -t.lower - t.between - (spread * t.curve_lower + pull * t.f_lower) / 2
        edges = np.bincount(d.category + 1, weights=upper, minlength=d.n_categories + 1)
        edges += np.bincount(d.category, weights=lower, minlength=d.n_categories + 1)
        of_columns = (u**2 - (1 - np.einsum("ncc->nc", of_people)) - v_p * u).sum(axis=0)
        of_terms = np.bincount(d.term, weights=of_columns, minlength=d.n_sds - 1)
        by_log_sd = np.append(of_terms, v @ v - (1 - of_items).sum() - v_i @ v)
        return float(value), Parameters(edges[1:-1].astype(np.float64), beta, by_sd(by_log_sd, p.sd))
