"""Crossed effects of paired comparisons: raters, contents and items that differ beyond the abilities."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy import optimize, sparse, special, stats

from analysis.models.laplace import Trials
from analysis.pairs.comparisons import LEFT, RIGHT, TIE, Comparisons
from analysis.pairs.likelihood import Fit, Model
from experiments.errors import InputError

Array = NDArray[np.float64]
Codes = NDArray[np.int64]
OTHERS_MAX = 4000
"""Effects of contents and items whose matrix is inverted whole."""
SD_MAX = 10.0
"""Log odds beyond which answers never contradict one another."""
OVERESTIMATE_MAX = 1.0
"""Of the log-likelihood by Laplace's approximation: where an SD runs away it is too high by 10 and more."""
BIAS_NOTED = 1.0
"""Underestimates of the log-likelihood that are said: the SD is then a little too small."""
DRAWS, CELLS_MAX = 1000, 20_000_000
WIDER = 1.3
"""Of the draws' spread, so that they also reach where the likelihood is skewed."""
GRADIENT_MAX = 0.1
"""Of a log-likelihood at its maximum. The search stops at less, or where rounding hides a further rise."""


@dataclass(frozen=True)
class RandomEffect:
    """A standard deviation on the scale of the abilities, and the likelihood-ratio test that it is zero.

    The p value is half that of chi-squared with one df, since zero is the end of what an SD can be.
    """

    name: str
    levels: int
    sd: float
    chi2: float
    p: float


@dataclass(frozen=True, eq=False)
class CrossedPairs:
    """Comparisons with what varies between them.

    `x` (n, f) are the fixed abilities' differences, `category` is 0 (right won) to 1 or 2 (left won);
    `rater`, `left`, `right` (n,) index the raters' own items; `others` (n, q) has +1 and -1 for effects of
    contents and items, `of_column` (q,) the SD, from 1, that each column has.
    """

    x: Array
    category: Codes
    rater: Codes
    left: Codes
    right: Codes
    shape: tuple[int, int]
    others: sparse.csr_array
    of_column: Codes
    edges: Array
    names: tuple[str, ...]
    levels: tuple[int, ...]


class RaterBlocks:
    """H = I + L'WL: raters' blocks are eliminated, the effects of contents and items are inverted whole."""

    def __init__(self, data: CrossedPairs, sd: Array, weight: Array) -> None:
        (raters, items), g, left, right = data.shape, data.rater, data.left, data.right
        blocks = np.zeros((raters, items, items))
        # Weight times (e_left - e_right)(e_left - e_right)': added at both items, less between them.
        for one, other, sign in ((left, left, 1), (right, right, 1), (left, right, -1), (right, left, -1)):
            np.add.at(blocks, (g, one, other), sign * sd[0] ** 2 * weight)
        blocks += np.eye(items)
        self.inverse = np.linalg.inv(blocks)
        self.scale = sd[data.of_column]
        scaled = data.others * self.scale[None, :]
        weighted = sparse.csr_array(scaled * weight[:, None])
        between = np.zeros((raters, items, scaled.shape[1]))
        own = sd[0] * _rater_columns(data).T @ weighted
        between[:] = np.asarray(own.todense()).reshape(between.shape)
        self.pulled = self.inverse @ between
        schur = np.eye(scaled.shape[1]) + np.asarray((scaled.T @ weighted).todense())
        schur -= np.einsum("giq,gip->qp", between, self.pulled)
        self.rest = np.linalg.inv(schur)
        self.log_det = float(np.linalg.slogdet(blocks)[1].sum() + np.linalg.slogdet(schur)[1])
        self.cross = -self.pulled @ self.rest

    def solve(self, of_raters: Array, of_others: Array) -> tuple[Array, Array]:
        """H^-1 of a vector of raters (G, k) and others (q,)."""
        others = self.rest @ (of_others - np.einsum("giq,gi->q", self.pulled, of_raters))
        return np.einsum("gij,gj->gi", self.inverse, of_raters) - self.pulled @ others, others

    def rater_blocks(self) -> Array:
        """Raters' blocks (G, k, k) of H^-1."""
        return self.inverse - self.cross @ self.pulled.transpose(0, 2, 1)


def _rater_columns(data: CrossedPairs) -> sparse.csr_array:
    """(n, G * k): +1 where a rater judged the left item, -1 where the right one."""
    n, items = data.rater.size, data.shape[1]
    rows = np.tile(np.arange(n), 2)
    columns = np.concatenate([data.rater * items + data.left, data.rater * items + data.right])
    signs = np.repeat([1.0, -1.0], n)
    return sparse.csr_array(sparse.coo_array((signs, (rows, columns)), shape=(n, data.shape[0] * items)))


@dataclass
class CrossedLikelihood:
    r"""Laplace log-likelihood of comparisons with crossed effects, and its gradient.

    .. math::

        \eta = x' \beta + \sigma_1 (u_{g l} - u_{g r}) + \sum_c \sigma_c (v_{c l} - v_{c r}), \quad
        u, v \sim N(0, 1) \tag{1}

    The left item wins with P = F(eta), F logistic; with ties Rao and Kupper's model. The gradient follows
    equations (1) to (3) of `analysis.models.laplace.LaplaceLikelihood.evaluate`.
    """

    data: CrossedPairs
    u: Array = field(init=False, repr=False)
    v: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        self.u, self.v = np.zeros(self.data.shape), np.zeros(self.data.others.shape[1])
        self.own = _rater_columns(self.data)

    def _modes(self, thresholds: Array, fixed: Array, sd: Array) -> tuple[Trials, RaterBlocks]:
        data, scale = self.data, sd[self.data.of_column]

        def trials(u: Array, v: Array) -> tuple[Trials, float]:
            eta = fixed + sd[0] * (self.own @ u.ravel()) + data.others @ (scale * v)
            t = Trials(thresholds, data.category, eta)
            return t, t.log_likelihood - float((u**2).sum() + v @ v) / 2

        t, value = trials(self.u, self.v)
        for _ in range(100):
            blocks = RaterBlocks(data, sd, t.weight)
            of_u, of_v = self._carried(t.slope, sd)
            score = of_u - self.u, of_v - self.v
            # Without contents and items the second vector is empty, and has no maximum.
            if max(np.abs(score[0]).max(), np.abs(score[1]).max(initial=0)) < 1e-9 * (1 + abs(value)) ** 0.5:
                return t, blocks
            (step_u, step_v), size = blocks.solve(*score), 1.0
            while True:
                there, reached = trials(self.u + size * step_u, self.v + size * step_v)
                if reached >= value - 1e-9 * abs(value) or size < 1e-6:
                    break
                size /= 2
            self.u, self.v, t, value = self.u + size * step_u, self.v + size * step_v, there, reached
        raise InputError("the random effects did not converge; an item may always win for some raters")

    def _carried(self, values: Array, sd: Array) -> tuple[Array, Array]:
        u = sd[0] * (self.own.T @ values).reshape(self.data.shape)
        return u, sd[self.data.of_column] * (self.data.others.T @ values)

    def evaluate(self, theta: Array) -> tuple[float, Array]:
        """Log-likelihood, and its gradient, of theta: coefficients of x, of the edges, and SDs."""
        data, f = self.data, self.data.x.shape[1]
        e, sd = data.edges.shape[1], theta[f + data.edges.shape[1] :]
        thresholds = data.edges @ theta[f : f + e]
        # Thresholds out of order have no likelihood: the search has to turn back.
        if np.any(np.diff(thresholds) <= 0):
            return -np.inf, np.zeros_like(theta)
        t, h = self._modes(thresholds, data.x @ theta[:f], sd)
        scale, others, blocks = sd[data.of_column], data.others, h.rater_blocks()
        g, left, right = data.rater, data.left, data.right
        value = t.log_likelihood - float((self.u**2).sum() + self.v @ self.v) / 2 - h.log_det / 2
        # z'H^-1 z of each comparison, z = sigma (e_left - e_right): of raters, of the others, of both.
        spread = blocks[g, left, left] + blocks[g, right, right] - 2 * blocks[g, left, right]
        spread *= sd[0] ** 2
        scaled = sparse.csr_array(others * scale[None, :])
        spread += np.asarray((scaled * (scaled @ h.rest)).sum(axis=1)).ravel()
        joint = h.cross[g, left] - h.cross[g, right]
        spread += 2 * sd[0] * np.asarray((scaled * joint).sum(axis=1)).ravel()
        change = -spread * (t.curve_upper + t.curve_lower)
        of_u, of_v = h.solve(*self._carried(change, sd))
        pull = sd[0] * (self.own @ of_u.ravel()) + others @ (scale * of_v)
        beta = data.x.T @ (t.slope - (change - pull * t.weight) / 2)
        upper = t.above + t.between - (spread * t.curve_upper + pull * t.f_upper) / 2
        lower = -t.lower - t.between - (spread * t.curve_lower + pull * t.f_lower) / 2
        number = len(thresholds) + 2
        by_edge = np.bincount(data.category + 1, weights=upper, minlength=number)
        by_edge += np.bincount(data.category, weights=lower, minlength=number)
        first = (self.u**2 - (1 - np.einsum("gii->gi", blocks)) - of_u * self.u).sum()
        columns = self.v**2 - (1 - np.diag(h.rest)) - of_v * self.v
        # of no columns bincount counts in integers
        by_log = np.bincount(data.of_column, columns, len(sd)).astype(np.float64)
        by_log[0] = first
        by_sd = np.divide(by_log, sd, out=np.zeros(len(sd)), where=sd != 0)
        return value, np.concatenate([beta, data.edges.T @ by_edge[1:-1], by_sd])


def crossed_pairs(comparisons: Comparisons, model: Model, *, items_vary: bool) -> CrossedPairs:
    """Comparisons with each rater's own items, each content's, and (`items_vary`) items beyond their factors.

    Raises
    ------
    InputError
        No raters; too many contents and items.
    """
    if comparisons.participant is None or len(comparisons.participants) < 2:
        raise InputError("--crossed needs two raters or more; name their column with --participant")
    n, items = comparisons.outcome.size, len(comparisons.items)
    names, levels = ["rater"], [len(comparisons.participants)]
    columns: list[Codes] = []
    if comparisons.content is not None:
        contents, content = np.unique(comparisons.content, return_inverse=True)
        names.append("content")
        levels.append(len(contents))
        columns.append(content.astype(np.int64))
    if items_vary:
        names.append("item")
        levels.append(items)
        columns.append(np.zeros(n, dtype=np.int64))
    parts, of_column = [sparse.csr_array((n, 0))], [np.zeros(0, dtype=np.int64)]
    rows, signs = np.tile(np.arange(n), 2), np.repeat([1.0, -1.0], n)
    for term, codes in enumerate(columns, start=1):
        width = (int(codes.max()) + 1) * items
        at = np.concatenate([codes * items + comparisons.left, codes * items + comparisons.right])
        parts.append(sparse.csr_array(sparse.coo_array((signs, (rows, at)), shape=(n, width))))
        of_column.append(np.full(width, term, dtype=np.int64))
    others = sparse.csr_array(sparse.hstack(parts))
    if others.shape[1] > OTHERS_MAX:
        raise InputError(
            f"--crossed takes {OTHERS_MAX} contents times items at most, got {others.shape[1]}; remove --by"
        )
    ties = model.method == "rao-kupper"
    # From a win of the right item to one of the left, in the direction in which eta moves them.
    steps = {LEFT: 2 if ties else 1, RIGHT: 0, TIE: 1}
    category = np.array([steps[k] for k in (LEFT, RIGHT, TIE)], dtype=np.int64)[comparisons.outcome]
    # thresholds: -delta -+ tau; without both they are fixed at zero
    edges = [[-1.0] * (1 + ties)] if model.order_effect else []
    edges += [[-1.0, 1.0]] if ties else []
    return CrossedPairs(
        model.design[comparisons.left] - model.design[comparisons.right],
        category,
        comparisons.participant,
        comparisons.left,
        comparisons.right,
        (len(comparisons.participants), items),
        others,
        np.concatenate(of_column),
        np.array(edges, dtype=np.float64).reshape(len(edges), 1 + ties).T,
        tuple(names),
        tuple(levels),
    )


def fit_crossed(data: CrossedPairs, start: Fit) -> tuple[Fit, tuple[RandomEffect, ...], tuple[str, ...]]:
    """Maximize the Laplace likelihood from the fit without random effects; last, notes on its accuracy.

    Raises
    ------
    InputError
        The search does not converge, or its maximum is one of the approximation alone.
    """
    number = len(data.names)
    # Not from zero: the likelihood is even in an SD, so that the search would never leave it.
    theta, value = _maximum(data, np.concatenate([start.parameters, np.full(number, 0.5)]), ())
    effects = []
    for index, name in enumerate(data.names):
        without = theta.copy()
        without[len(start.parameters) + index] = 0.0
        smaller = _maximum(data, without, (len(start.parameters) + index,))[1]
        chi2 = max(0.0, 2 * (value - smaller))
        p = float(stats.chi2.sf(chi2, 1)) / 2 if chi2 > 0 else 1.0
        # The likelihood is even in an SD: a negative one is the same model.
        sd = abs(float(theta[len(start.parameters) + index]))
        effects.append(RandomEffect(name, data.levels[index], sd, chi2, p))
    error = laplace_error(data, theta)
    if error < -OVERESTIMATE_MAX:
        raise InputError(
            f"too few answers of each rater for --crossed: its log-likelihood is too high by {-error:.1f}. "
            "Remove --crossed, or collect more comparisons of each pair by each rater"
        )
    runaway = next((one for one in effects if one.sd > SD_MAX), None)
    if runaway is not None:
        raise InputError(
            f"the SD of '{runaway.name}' grows without limit (above {SD_MAX:g} log odds): answers of each "
            "hardly ever contradict one another. Remove --crossed, or collect more comparisons"
        )
    notes = (
        (f"crossed effects: the log-likelihood is {error:.1f} too low, so SDs may be a little too small",)
        if error > BIAS_NOTED
        else ()
    )
    covariance = _covariance(data, theta)[: len(start.parameters), : len(start.parameters)]
    return Fit(theta[: len(start.parameters)], covariance, value, start.shares), tuple(effects), notes


def laplace_error(data: CrossedPairs, theta: Array) -> float:
    r"""How far the Laplace log-likelihood of the raters' effects is from that by importance sampling.

    .. math::

        \log \int e^{\ell_g(u) - u'u/2} du \approx
        \log \frac{1}{S} \sum_s \frac{e^{\ell_g(u_s) - u_s'u_s/2}}{q(u_s)}, \quad
        u_s \sim q = N(\hat u_g, c^2 H_g^{-1}) \tag{2}

    Effects of contents and items stay at their mode.
    """
    f, edges = data.x.shape[1], data.edges.shape[1]
    thresholds, sd = data.edges @ theta[f : f + edges], theta[f + edges :]
    likelihood = CrossedLikelihood(data)
    _, blocks = likelihood._modes(thresholds, data.x @ theta[:f], sd)
    mode, (raters, items) = likelihood.u, data.shape
    fixed = data.x @ theta[:f] + data.others @ (sd[data.of_column] * likelihood.v)
    spread = WIDER * np.linalg.cholesky(blocks.inverse)

    def joint(u: Array) -> Array:
        """Log of likelihood and density of the effects u (G, k), by rater."""
        eta = fixed + sd[0] * (likelihood.own @ u.ravel())
        log_chances = Trials(thresholds, data.category, eta).log_chances
        by_rater = np.bincount(data.rater, log_chances, raters)
        return np.asarray(by_rater - (u**2).sum(axis=1) / 2)

    # Fewer draws for larger tables, whose raters have more answers each.
    count = max(50, min(DRAWS, CELLS_MAX // len(data.x)))
    random = np.random.default_rng(1)
    drawn = np.empty((count, raters))
    for row in drawn:
        e = random.standard_normal((raters, items))
        row[:] = joint(mode + np.einsum("gij,gj->gi", spread, e)) + (e**2).sum(axis=1) / 2
    reached = special.logsumexp(drawn, axis=0) - np.log(count) + items * np.log(WIDER)
    return float((reached - joint(mode)).sum())


def _maximum(data: CrossedPairs, theta: Array, fixed: tuple[int, ...]) -> tuple[Array, float]:
    likelihood, free = CrossedLikelihood(data), np.setdiff1d(np.arange(theta.size), fixed)
    whole = theta.copy()

    def loss(values: Array) -> tuple[float, Array]:
        whole[free] = values
        value, gradient = likelihood.evaluate(whole)
        # A finite wall in place of infinity, from which the line search steps back.
        return (-value, -gradient[free]) if np.isfinite(value) else (1e300, np.zeros(free.size))

    # The gradient is a sum over comparisons: what counts as zero grows with their number.
    gtol = 1e-5 * len(data.x) ** 0.5
    optimum = optimize.minimize(loss, theta[free], jac=True, method="BFGS", options={"gtol": gtol})
    whole[free] = optimum.x
    if not optimum.success and np.abs(optimum.jac).max() > GRADIENT_MAX:
        raise InputError(
            "the crossed effects did not converge; an item may win nearly always, or answers may be too few: "
            "remove --by or --crossed"
        )
    return whole, -float(optimum.fun)


def _covariance(data: CrossedPairs, theta: Array) -> Array:
    """Inverse of the curvature, by central differences of the exact gradient; SDs at zero are left out."""
    likelihood, size = CrossedLikelihood(data), theta.size
    hessian = np.zeros((size, size))
    for index in range(size):
        step = np.zeros(size)
        step[index] = 1e-4
        ends = [likelihood.evaluate(theta + sign * step)[1] for sign in (1, -1)]
        hessian[index] = (ends[1] - ends[0]) / 2e-4
    hessian = (hessian + hessian.T) / 2
    kept = np.ones(size, dtype=bool)
    kept[size - len(data.names) :] = np.abs(theta[size - len(data.names) :]) > 1e-3
    covariance = np.zeros((size, size))
    covariance[np.ix_(kept, kept)] = np.linalg.inv(hessian[np.ix_(kept, kept)])
    return covariance
