"""Parameters that maximize the likelihood of the cumulative-logit mixed model, and their covariance."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import optimize, special

from analysis.models.laplace import LaplaceLikelihood, OrdinalData, Parameters, Trials, by_sd

# Adaptive Gauss-Hermite quadrature of the cumulative-logit model with one random intercept per participant.

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

    One node is Laplace's approximation. Modes and spreads follow the parameters, so the gradient has two
    parts: that of 2 with nodes held, at each node that of the ratings weighted by its share of the integral
    :math:`\pi_{ik}`, and the effect of moved nodes:

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
        # In logarithms: the likelihood of many ratings underflows at every node.
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


Bools = NDArray[np.bool_]
Integers = NDArray[np.int64]
Likelihood = LaplaceLikelihood | QuadratureLikelihood

SD_MAX = float(np.exp(4))
START_SD = 0.6
LOG_GAP_BOUNDS = (-12.0, 5.0)
"""Bounds of the logarithms of the distances between thresholds."""

NEAR_ZERO = 0.01
"""An SD below this is tried at zero."""

LIFTS = (0.003, 0.01, 0.03, 0.1, 0.3, 1.0)
"""SDs at which one that ended at zero is tried: every likelihood is level there, at a minimum too."""

GAIN = 1e-9
"""Log-likelihoods closer than this are equal."""

NEWTON_GAIN = 1e-11
"""A Newton step that promises less than this was the last."""

HESSIAN_STEP = 1e-4
NEWTON_STEPS = 8


@dataclass(frozen=True)
class Maximum:
    """Estimates, the log-likelihood there, and the covariance of thresholds' logs, coefficients and SDs.

    SDs of zero are held fixed in `covariance`; `settled` says whether no Newton step can gain anything.
    """

    parameters: Parameters
    value: float
    covariance: Floats
    settled: bool


def pooled_start(d: OrdinalData, with_items: bool) -> Parameters:
    """Thresholds from the pooled cumulative shares, no effects, moderate SDs; that of no items is zero."""
    shares = np.cumsum(np.bincount(d.category, minlength=d.n_categories))[:-1] / len(d.category)
    sd = np.full(d.n_sds, START_SD)
    sd[-1] *= with_items
    return Parameters(np.log(shares / (1 - shares)), np.zeros(d.x.shape[1]), sd)


def maximise(likelihood: Likelihood, start: Parameters, with_items: bool) -> Maximum:
    """Climb by L-BFGS-B, lift SDs that stuck at zero, then by Newton until no step gains anything."""
    search = _Search(likelihood, with_items)
    packed = search.zeroed(search.climbed(_pack(start)))
    for _ in range(likelihood.data.n_sds):
        lifted = search.lifted(packed)
        if lifted is None:
            break
        packed = search.zeroed(search.climbed(lifted))
    return search.polished(packed)


def _pack(p: Parameters) -> Floats:
    """First threshold, logs of the gaps between thresholds, coefficients, SDs."""
    # Logs of the gaps keep the thresholds in order, whatever the search tries.
    return np.concatenate([p.thresholds[:1], np.log(np.diff(p.thresholds)), p.beta, p.sd])


def packed_gradient(gradient: Parameters, log_gaps: Floats) -> Floats:
    """Gradient by the first threshold, the logs of the gaps between thresholds, coefficients, SDs."""
    # The first threshold and every gap move all thresholds after them.
    later = np.cumsum(gradient.thresholds[::-1])[::-1]
    return np.concatenate([later[:1], later[1:] * np.exp(log_gaps), gradient.beta, gradient.sd])


def newton_step(likelihood: Likelihood, maximum: Maximum) -> Floats:
    """How far the maximum of another likelihood lies from this one, by its gradient here."""
    _, gradient = likelihood.evaluate(maximum.parameters)
    log_gaps = np.log(np.diff(maximum.parameters.thresholds))
    return np.asarray(maximum.covariance @ packed_gradient(gradient, log_gaps), dtype=np.float64)


def _unpack(packed: Floats, d: OrdinalData) -> Parameters:
    k = d.n_categories - 1
    thresholds = packed[0] + np.concatenate([[0.0], np.cumsum(np.exp(packed[1:k]))])
    return Parameters(thresholds, packed[k : -d.n_sds], packed[-d.n_sds :])


class _Search:
    """The log-likelihood of packed parameters; without items their SD stays at zero."""

    def __init__(self, likelihood: Likelihood, with_items: bool) -> None:
        self.likelihood, d = likelihood, likelihood.data
        free, gap = (-np.inf, np.inf), LOG_GAP_BOUNDS
        bounds = [free] + [gap] * (d.n_categories - 2) + [free] * d.x.shape[1]
        bounds += [(0.0, SD_MAX)] * (d.n_sds - 1) + [(0.0, SD_MAX if with_items else 0.0)]
        self.low, self.high = np.array(bounds).T
        self.is_sd: Bools = np.arange(len(bounds)) >= len(bounds) - d.n_sds

    def at(self, packed: Floats) -> tuple[float, Floats]:
        """Log-likelihood and its gradient."""
        d = self.likelihood.data
        value, gradient = self.likelihood.evaluate(_unpack(packed, d))
        return value, packed_gradient(gradient, packed[1 : d.n_categories - 1])

    def climbed(self, start: Floats) -> Floats:
        """Where L-BFGS-B stops."""

        def objective(packed: Floats) -> tuple[float, Floats]:
            value, gradient = self.at(packed)
            return -value, -gradient

        optimum = optimize.minimize(
            objective,
            start,
            jac=True,
            method="L-BFGS-B",
            bounds=list(zip(self.low, self.high, strict=True)),
            options={"maxiter": 2000, "maxfun": 4000, "ftol": 1e-13, "gtol": 1e-5, "maxcor": 30},
        )
        return np.asarray(optimum.x, dtype=np.float64)

    def zeroed(self, packed: Floats) -> Floats:
        """Tiny SDs put at zero where that loses nothing."""
        for k in np.flatnonzero(self.is_sd & (packed > 0) & (packed < NEAR_ZERO)):
            trial = packed.copy()
            trial[k] = 0.0
            if self.at(trial)[0] >= self.at(packed)[0] - GAIN:
                packed = trial
        return packed

    def lifted(self, packed: Floats) -> Floats | None:
        """With one SD lifted from zero where that gains, else None."""
        value = self.at(packed)[0]
        for k in np.flatnonzero(self.is_sd & (packed == 0) & (self.high > 0)):
            trials = np.repeat(packed[None], len(LIFTS), axis=0)
            trials[:, k] = LIFTS
            values = [self.at(trial)[0] for trial in trials]
            if max(values) > value + GAIN:
                return np.asarray(trials[int(np.argmax(values))], dtype=np.float64)
        return None

    def polished(self, packed: Floats) -> Maximum:
        """Newton steps while they gain; the last information matrix gives the covariance."""
        for left in reversed(range(NEWTON_STEPS)):
            value, gradient = self.at(packed)
            free = np.flatnonzero(~(self.is_sd & (packed == 0)))
            information = self._information(packed, free)
            # What is at a bound stays there: a step that is cut off afterwards is not Newton's any more.
            inside = (packed > self.low)[free] & (packed < self.high)[free]
            step = _newton_step(information[np.ix_(inside, inside)], gradient[free][inside])
            # What a quadratic likelihood gains by the step.
            gain = 0.0 if step is None else float(step @ gradient[free][inside]) / 2
            if left == 0 or step is None or gain < NEWTON_GAIN:
                break
            higher = self._stepped(packed, free[inside], step, value)
            if higher is None:
                break
            packed = higher
        covariance = np.zeros((len(packed), len(packed)))
        covariance[np.ix_(free, free)] = np.linalg.pinv(information, hermitian=True)
        settled = step is not None and gain < GAIN
        return Maximum(_unpack(packed, self.likelihood.data), value, covariance, settled)

    def _stepped(self, packed: Floats, free: Integers, step: Floats, value: float) -> Floats | None:
        """A Newton step, halved until the likelihood rises, within the bounds."""
        for halvings in range(5):
            trial = packed.copy()
            trial[free] += step / 2**halvings
            trial = np.clip(trial, self.low, self.high)
            if self.at(trial)[0] > value:
                return trial
        return None

    def _information(self, packed: Floats, free: Integers) -> Floats:
        """Observed information of the free parameters, from central differences of the exact gradient."""
        rows = []
        for k in free:
            move = HESSIAN_STEP * np.eye(len(packed))[k]
            rows.append((self.at(packed - move)[1] - self.at(packed + move)[1])[free] / (2 * HESSIAN_STEP))
        information = np.stack(rows)
        return np.asarray((information + information.T) / 2)


def _newton_step(information: Floats, gradient: Floats) -> Floats | None:
    """Where a quadratic likelihood has its maximum; None where this one is no such hill."""
    values, vectors = np.linalg.eigh(information)
    if values.min() <= 0:
        return None
    return np.asarray(vectors @ ((vectors.T @ gradient) / values))


# How far Laplace's approximation moves the estimates of an ordinal model: integrals by many points.

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
    p, laplace = maximum.parameters, LaplaceLikelihood(data)
    laplace.evaluate(p)
    scaled, scaled_item = data.scaled(p.sd)
    of_people = np.einsum("tc,tc->t", scaled, laplace.u[data.participant])
    of_items = np.einsum("tk,tk->t", scaled_item, laplace.v[data.item])
    people = _lacking(_one_grouping(data, of_items), p, p.sd[: data.n_terms])
    sd = np.append(people.sd[:-1], np.zeros(data.n_sds - data.n_terms))
    thresholds, beta = people.thresholds, people.beta[:-1]
    if with_items and p.sd[data.n_terms :].any():
        turned = replace(
            data,
            z=data.z_item,
            term=data.term_item,
            participant=data.item,
            n_participants=data.n_items,
        )
        items = _lacking(_one_grouping(turned, of_people), p, p.sd[data.n_terms :])
        thresholds, beta = thresholds + items.thresholds, beta + items.beta[:-1]
        sd[data.n_terms :] = items.sd[:-1]
    gradient = packed_gradient(Parameters(thresholds, beta, sd), np.log(np.diff(p.thresholds)))
    return np.asarray(maximum.covariance @ gradient, dtype=np.float64)


def _one_grouping(data: OrdinalData, of_items: Floats) -> OrdinalData:
    """The trials with participants alone: items' effects (n,) are one more column, whose coefficient is 1."""
    return replace(
        data,
        x=np.column_stack([data.x, of_items]),
        z_item=np.ones((len(data.category), 1)),
        term_item=np.zeros(1, np.int64),
        item=np.zeros_like(data.item),
        n_items=1,
    )


def _lacking(d: OrdinalData, whole: Parameters, sd: Floats) -> Parameters:
    """Gradient of the integral over one grouping less that of Laplace's approximation."""
    p = Parameters(whole.thresholds, np.append(whole.beta, 1.0), np.append(sd, 0.0))
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
    # The normal quantile of 0 or 1 is infinite.
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
    # The weights are of standard normal points, whose density is divided out again.
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
