"""Adaptive Gauss-Hermite quadrature of the cumulative-logit model with one random intercept a participant."""

import numpy as np
from numpy.typing import NDArray
from scipy import special

from analysis.models.laplace import LaplaceLikelihood, Trials
from analysis.models.ordinal_data import OrdinalData, Parameters, by_sd

Floats = NDArray[np.float64]


class QuadratureLikelihood:
    r"""Log-likelihood of ratings whose participants differ in their intercept alone.

    Parameters
    ----------
    data : OrdinalData
        One column z, one item.
    nodes : int
        K, nodes of each participant's integral.

    Notes
    -----
    With :math:`g_i(u) = \sum_t \log P(y_{it} | u) - u^2 / 2`, its mode :math:`\hat u_i` and
    :math:`\tau_i^2 = -1 / g_i''(\hat u_i)`, and the nodes and weights :math:`x_k, w_k` of Gauss and Hermite:

    1. :math:`u_{ik} = \hat u_i + \sqrt 2 \tau_i x_k`;
    2. :math:`\ell = \sum_i \log \Big( \tau_i \pi^{-1/2} \sum_k w_k \exp(x_k^2 + g_i(u_{ik})) \Big)`.

    One node is Laplace's approximation. Modes and spreads follow the parameters, so that beside the gradient
    of 2 with nodes held, at each node that of the ratings weighted by its share of the integral
    :math:`\pi_{ik}`, stands what moved nodes do:

    3. :math:`\partial \ell / \partial \hat u_i = \alpha_i = \sum_k \pi_{ik} g_i'(u_{ik})` and
       :math:`\partial \ell / \partial \log \tau_i = \beta_i =
       1 + \sum_k \pi_{ik} g_i'(u_{ik}) \sqrt 2 \tau_i x_k`.

    Source: Pinheiro & Bates (1995), doi:10.1080/10618600.1995.10474663; as R's ordinal::clmm with nAGQ = K.
    """

    def __init__(self, data: OrdinalData, nodes: int) -> None:
        self.data = data
        self._x, w = np.polynomial.hermite.hermgauss(nodes)
        self._log_weight = np.log(w) + self._x**2 - np.log(np.pi) / 2
        self._laplace = LaplaceLikelihood(data)

    def evaluate(self, p: Parameters) -> tuple[float, Parameters]:
        """Log-likelihood, eq. 2, and its gradient in the form of Parameters."""
        d, sd = self.data, float(p.sd[0])
        modes, tau, trials = self._laplace.intercepts(p)
        moves = np.sqrt(2.0) * tau[:, None] * self._x
        u = modes[:, None] + moves
        edges = np.concatenate([[-np.inf], p.thresholds, [np.inf]])
        top, bottom = edges[d.category + 1], edges[d.category]
        eta = (d.x @ p.beta)[:, None] + sd * u[d.participant]
        a, b = top[:, None] - eta, bottom[:, None] - eta
        gap = np.exp(bottom - top)[:, None]
        each = special.log_expit(a) + special.log_expit(-b) + np.log1p(-gap)
        joint = self._summed(each) - u**2 / 2 + self._log_weight
        of_people = special.logsumexp(joint, axis=1)
        share = np.exp(joint - of_people[:, None])
        between = gap / (1 - gap)
        upper, lower = special.expit(-a) + between, -special.expit(b) - between
        upper, lower = share[d.participant] * upper, share[d.participant] * lower
        slope = -(upper + lower)
        pulls = sd * self._summed(slope) - share * u
        moved = _moved(d, sd, (modes, tau, trials), (pulls.sum(axis=1), 1 + (pulls * moves).sum(axis=1)))
        of_sd = float((slope * u[d.participant]).sum()) + float(moved.sd[0])
        gradient = Parameters(
            _by_edge(d, upper.sum(axis=1), lower.sum(axis=1)) + moved.thresholds,
            d.x.T @ slope.sum(axis=1) + moved.beta,
            np.array([of_sd, 0.0]),
        )
        return float((of_people + np.log(tau)).sum()), gradient

    def _summed(self, values: Floats) -> Floats:
        """Sums over the ratings of each participant, (people, K)."""
        total = np.zeros((self.data.n_participants, len(self._x)))
        np.add.at(total, self.data.participant, values)
        return total


def _by_edge(d: OrdinalData, upper: Floats, lower: Floats) -> Floats:
    """Sums of trials' derivatives (n,) by the edge above and the edge below, at the thresholds."""
    edges = np.bincount(d.category + 1, upper, d.n_categories + 1)
    edges += np.bincount(d.category, lower, d.n_categories + 1)
    return np.asarray(edges[1:-1], dtype=np.float64)


def _moved(
    d: OrdinalData, sd: float, at: tuple[Floats, Floats, Trials], weights: tuple[Floats, Floats]
) -> Parameters:
    r"""Gradient of :math:`\sum_i \alpha_i \hat u_i + \beta_i \log \tau_i`, the weights of eq. 3 held.

    With :math:`h_i = \tau_i^{-2} = 1 + s^2 \sum_t w_{it}`, w the weights of ratings and s the SD, implicit
    differentiation of the mode gives

    4. :math:`\partial \hat u_i / \partial \eta_{it} = -s w_{it} / h_i` and
       :math:`\partial \hat u_i / \partial \log s = \hat u_i (2 - h_i) / h_i`.
    """
    (u, tau, t), (alpha, beta) = at, weights
    spread, people = (sd * tau) ** 2, d.participant
    change = -spread[people] * (t.curve_upper + t.curve_lower)
    changes = sd * np.bincount(people, change, d.n_participants)
    half, kappa = -beta / 2, alpha - beta / 2 * changes
    curved, pulled = (half * spread)[people], (kappa * sd * tau**2)[people]
    by_eta = half[people] * change - pulled * t.weight
    thresholds = _by_edge(
        d, curved * t.curve_upper + pulled * t.f_upper, curved * t.curve_lower + pulled * t.f_lower
    )
    by_log_sd = half * (u * changes + 2 * (1 - tau**2)) + kappa * u * (2 * tau**2 - 1)
    of_sd = by_sd(np.array([by_log_sd.sum(), 0.0]), np.array([sd, 0.0]))
    return Parameters(thresholds, d.x.T @ by_eta, of_sd)
