"""Maximum likelihood for choices between two items, with or without ties."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy import sparse, special, stats

from analysis.pairs.comparisons import LEFT, RIGHT, TIE, Comparisons
from experiments.errors import InputError

Array = NDArray[np.float64]
Method = Literal["bradley-terry", "davidson", "rao-kupper", "thurstone"]
TIED: tuple[Method, ...] = ("davidson", "rao-kupper")
"""Methods with ties as a third outcome; their last parameter is that of ties."""
STEPS_MAX = 200
TOLERANCE = 1e-12
FAR = 15.0
"""Abilities this far apart (log odds) mean that the likelihood has no maximum."""


@dataclass(frozen=True, eq=False)
class Counts:
    """Comparisons counted by ordered pair: left and right item (m,), outcomes (m, 2) or (m, 3)."""

    left: NDArray[np.int64]
    right: NDArray[np.int64]
    outcomes: Array

    @property
    def totals(self) -> Array:
        """How often each ordered pair was compared (m,)."""
        total: Array = self.outcomes.sum(axis=1)
        return total


@dataclass(frozen=True, eq=False)
class Fit:
    """Parameters (p,), their covariance (p, p), log-likelihood, and expected shares of outcomes (m, o)."""

    parameters: Array
    covariance: Array
    log_likelihood: float
    shares: Array


@dataclass(frozen=True, eq=False)
class Model:
    """What is fitted.

    Attributes
    ----------
    method : {"bradley-terry", "davidson", "rao-kupper", "thurstone"}
    design : (k, p) array
        Abilities of the k items are `design @ parameters[:p]`.
    order_effect : bool
        Whether the parameter after the abilities is the advantage delta of the left (first) side.
    """

    method: Method
    design: Array
    order_effect: bool = False

    @property
    def names(self) -> int:
        """How many parameters the model has."""
        return int(self.design.shape[1]) + self.order_effect + (self.method in TIED)


def free_abilities(items: int) -> Array:
    """Return the design (k, k - 1) of free abilities against the first item's 0."""
    return np.eye(items)[:, 1:]


def count_outcomes(comparisons: Comparisons, *, ties: bool) -> Counts:
    """Count outcomes by ordered pair."""
    items = len(comparisons.items)
    pair = comparisons.left * items + comparisons.right
    # Ordered pairs with their counts: the cost of a step depends on items, not on comparisons.
    seen, index = np.unique(pair, return_inverse=True)
    outcomes = np.zeros((seen.size, 3 if ties else 2))
    np.add.at(outcomes, (index, comparisons.outcome), 1.0)
    return Counts(seen // items, seen % items, outcomes)


def count_by_rater(comparisons: Comparisons, counts: Counts) -> sparse.csr_array:
    """Each rater's counts (G, m * o) of the pairs and outcomes of `counts`, in its order.

    Without raters each comparison counts as one rater's.
    """
    items, width = len(comparisons.items), counts.outcomes.shape[1]
    pair = np.searchsorted(counts.left * items + counts.right, comparisons.left * items + comparisons.right)
    rater = comparisons.participant
    rows = np.arange(pair.size) if rater is None else rater
    shape = (int(rows.max()) + 1, counts.outcomes.size)
    cells = pair * width + comparisons.outcome
    return sparse.csr_array(sparse.coo_array((np.ones(pair.size), (rows, cells)), shape=shape))


def scores(model: Model, left: NDArray[np.int64], right: NDArray[np.int64]) -> Array:
    r"""Return the linear predictors' coefficients z (m, outcomes, p) of a softmax model.

    With abilities lambda, order effect delta and tie parameter nu (Davidson 1970, Journal of the American
    Statistical Association 65, 317; Bradley-Terry without its third line):

    .. math::

        \eta_\text{left} = \lambda_l + \delta / 2 \tag{1}

        \eta_\text{right} = \lambda_r - \delta / 2 \tag{2}

        \eta_\text{tie} = \log \nu + (\lambda_l + \lambda_r) / 2 \tag{3}

    and the probability of an outcome is its exp(eta) over their sum.
    """
    one, other = model.design[left], model.design[right]
    ties = model.method in TIED
    z = np.zeros((left.size, 3 if ties else 2, model.names))
    abilities = model.design.shape[1]
    z[:, LEFT, :abilities], z[:, RIGHT, :abilities] = one, other
    if model.order_effect:
        z[:, LEFT, abilities], z[:, RIGHT, abilities] = 0.5, -0.5
    if ties:
        z[:, TIE, :abilities] = (one + other) / 2.0
        z[:, TIE, -1] = 1.0
    return z


def fit(model: Model, counts: Counts, *, firth: bool = False) -> Fit:
    """Fit by Newton's method; the likelihoods are concave.

    Parameters
    ----------
    model : Model
    counts : Counts
    firth : bool
        Firth's (1993) penalty, which keeps estimates finite where one item wins always; Bradley-Terry only.

    Raises
    ------
    InputError
        Where the likelihood has no maximum.
    """
    step = STEPS.get(model.method, softmax_step)
    # All items alike: for a concave likelihood any start will do, and this one lies inside.
    parameters = np.zeros(model.names)
    if model.method == "rao-kupper":
        # Where all items are alike, P(tie) = tanh(tau / 2).
        share = counts.outcomes[:, TIE].sum() / counts.outcomes.sum()
        parameters[-1] = 2 * np.arctanh(share)
    previous = -np.inf
    for _ in range(STEPS_MAX):
        value, gradient, information, curvature, shares = step(model, counts, parameters, firth)
        # Separation shows as abilities that run away, long before the likelihood is flat to the last digit.
        if np.any(np.abs(parameters[: model.design.shape[1]]) > FAR):
            raise no_maximum(firth)
        change = _solved(curvature, gradient)
        if value - previous < TOLERANCE * (1 + abs(value)) and np.max(np.abs(change), initial=0) < 1e-9:
            covariance = np.linalg.inv(information).astype(np.float64)
            return Fit(parameters, covariance, _plain(counts, shares), shares)
        # Halved where a full Newton step would lose, as it may in Thurstone's model far from the maximum.
        size = 1.0
        # `not >=`: beyond the parameters' limits the likelihood is not a number
        while size > 1e-8 and not (
            step(model, counts, parameters + size * change, firth)[0] >= value - 1e-12 * (1 + abs(value))
        ):
            size /= 2
        parameters, previous = parameters + size * change, value
    raise no_maximum(firth)


def sandwich(fitted: Fit, clusters: Array) -> Array:
    r"""Covariance of parameters robust to what comparisons of one rater share.

    Parameters
    ----------
    fitted : Fit
    clusters : (G, p) array
        Gradients :math:`s_g` of the log-likelihood, summed over the comparisons of each of G raters.

    Notes
    -----
    :math:`C \big( \sum_g s_g s_g' \big) C \cdot G / (G - 1)` with C the model's covariance. Source:
    Liang & Zeger (1986), Biometrika 73, 13.
    """
    raters = len(clusters)
    robust: Array = fitted.covariance @ (clusters.T @ clusters) @ fitted.covariance * raters / (raters - 1)
    return robust


def no_maximum(firth: bool = False) -> InputError:
    """The likelihood grows without end, or `firth` was of no avail."""
    remedy = "leave it out" if firth else "add --firth for finite estimates, or remove it"
    return InputError(
        "the likelihood has no maximum: an item (or level) wins or loses every comparison with the others; "
        f"{remedy}"
    )


def _solved(information: Array, gradient: Array) -> Array:
    try:
        change = np.linalg.solve(information, gradient).astype(np.float64)
    except np.linalg.LinAlgError as error:
        raise InputError(
            "the abilities are not identified: a factor repeats another, or some levels are never compared"
        ) from error
    return change


def _plain(counts: Counts, shares: Array) -> float:
    # An outcome that never came adds 0 log 0 = 0, also where its share is 0.
    return float(np.sum(counts.outcomes * np.log(np.where(counts.outcomes > 0, shares, 1.0))))


def softmax_step(
    model: Model, counts: Counts, parameters: Array, firth: bool
) -> tuple[float, Array, Array, Array, Array]:
    """Log-likelihood, gradient, information, the curvature that a step goes by, and shares of outcomes."""
    z = scores(model, counts.left, counts.right)
    eta = z @ parameters
    # Softmax is the same for shifted predictors, and exp cannot overflow below 0.
    eta -= eta.max(axis=1, keepdims=True)
    shares = np.exp(eta)
    shares /= shares.sum(axis=1, keepdims=True)
    centred = z - np.einsum("mo,mop->mp", shares, z)[:, None, :]
    weights = counts.totals[:, None] * shares
    information = np.einsum("mo,mop,moq->pq", weights, centred, centred)
    gradient = np.einsum("mo,mop->p", counts.outcomes - weights, z)
    value = float(np.sum(counts.outcomes * np.log(shares)))
    curvature = information
    if firth:
        difference = z[:, LEFT] - z[:, RIGHT]
        spread = counts.totals * shares[:, LEFT] * shares[:, RIGHT]
        # Firth's penalty is half the log determinant of the information; its gradient needs these alone
        # (Heinze & Schemper 2002).
        leverage = spread * np.einsum("mp,pq,mq->m", difference, np.linalg.inv(information), difference)
        gradient = gradient + (leverage * (0.5 - shares[:, LEFT])) @ difference
        value += 0.5 * float(np.linalg.slogdet(information)[1])
        # The penalty acts like as many more comparisons as the leverage: steps without them overshoot, and of
        # a single comparison, whose leverage is 1, they go to and fro for ever.
        more = spread + leverage * shares[:, LEFT] * shares[:, RIGHT]
        curvature = np.einsum("m,mp,mq->pq", more, difference, difference)
    return value, gradient, information, curvature, shares


def _thurstone_step(
    model: Model, counts: Counts, parameters: Array, firth: bool
) -> tuple[float, Array, Array, Array, Array]:
    r"""Thurstone's case V: the difference of two impressions is normal with SD 1.

    .. math::

        P(\text{left}) &= \Phi(\eta), \quad \eta = \lambda_l - \lambda_r + \delta \tag{1} \\
        \partial l / \partial \eta &= y_l \, \varphi(\eta) / \Phi(\eta)
            - y_r \, \varphi(\eta) / \Phi(-\eta) \tag{2} \\
        I &= n \, \varphi(\eta)^2 / \{\Phi(\eta) \Phi(-\eta)\} \tag{3}

    lambda are the abilities, delta the advantage of the left side, y_l and y_r how often each side of a pair
    was chosen in n comparisons, l the log-likelihood, I its expected information of eta.
    """
    del firth  # refused before: the penalty is derived for the logistic model
    z = scores(model, counts.left, counts.right)
    difference = z[:, LEFT] - z[:, RIGHT]
    eta = difference @ parameters
    log_left, log_right = stats.norm.logcdf(eta), stats.norm.logcdf(-eta)
    shares = np.exp(np.stack([log_left, log_right], axis=1))
    density = stats.norm.logpdf(eta)
    toward = counts.outcomes[:, LEFT] * np.exp(density - log_left)
    away = counts.outcomes[:, RIGHT] * np.exp(density - log_right)
    weight = counts.totals * np.exp(2 * density - log_left - log_right)
    information = np.einsum("m,mp,mq->pq", weight, difference, difference)
    value = float(counts.outcomes[:, LEFT] @ log_left + counts.outcomes[:, RIGHT] @ log_right)
    return value, (toward - away) @ difference, information, information, shares


def _rao_kupper_step(
    model: Model, counts: Counts, parameters: Array, firth: bool
) -> tuple[float, Array, Array, Array, Array]:
    r"""Rao and Kupper's model: an item wins if its advantage exceeds a threshold (1967, JASA 62, 194).

    .. math::

        P(\text{left}) &= F(\eta - \tau), \quad P(\text{right}) = F(-\eta - \tau), \quad
            \eta = \lambda_l - \lambda_r + \delta \tag{1} \\
        P(\text{tie}) &= (e^{2 \tau} - 1) \, P(\text{left}) \, P(\text{right}) \tag{2} \\
        I &= \sum_o n P_o \, g_o g_o' \tag{3}

    F is logistic, tau the logarithm of their theta, g_o the gradient of log P of the outcome o.
    """
    del firth  # refused before: the penalty is derived for the logistic model
    gradients, shares = _rao_kupper_outcomes(model, counts, parameters)
    # A negative tau gives ties a negative probability: the value is NaN, and `fit` halves the step.
    with np.errstate(invalid="ignore", divide="ignore"):
        value = float(np.sum(special.xlogy(counts.outcomes, shares)))
    gradient = np.einsum("mo,mop->p", counts.outcomes, gradients)
    weights = counts.totals[:, None] * shares
    information = np.einsum("mo,mop,moq->pq", weights, gradients, gradients)
    return value, gradient, information, information, shares


def _rao_kupper_outcomes(model: Model, counts: Counts, parameters: Array) -> tuple[Array, Array]:
    """Gradients (m, 3, p) of the outcomes' log probabilities, and these probabilities (m, 3)."""
    z = scores(model, counts.left, counts.right)
    difference, tau = z[:, LEFT] - z[:, RIGHT], parameters[-1]
    eta, threshold = difference @ parameters, np.zeros(model.names)
    threshold[-1] = 1.0
    left, right = special.expit(eta - tau), special.expit(-eta - tau)
    shares = np.stack([left, right, np.expm1(2 * tau) * left * right], axis=1)
    of_left = (1 - left)[:, None] * (difference - threshold)
    of_right = (1 - right)[:, None] * (-difference - threshold)
    # e^2t - 1, whose logarithm has the derivative 2 / (1 - e^-2t)
    of_tie = of_left + of_right + threshold * (2 / -np.expm1(-2 * tau))
    return np.stack([of_left, of_right, of_tie], axis=1), shares


def outcome_gradients(model: Model, counts: Counts, fitted: Fit) -> Array:
    """Gradient (m, o, p) of the log probability of each pair's outcomes, at the fitted parameters."""
    if model.method == "rao-kupper":
        return _rao_kupper_outcomes(model, counts, fitted.parameters)[0]
    z = scores(model, counts.left, counts.right)
    if model.method == "thurstone":
        difference = z[:, LEFT] - z[:, RIGHT]
        eta = difference @ fitted.parameters
        # By logarithms, since the density and the distribution both vanish far out, where their ratio is
        # about eta.
        ratios = [np.exp(stats.norm.logpdf(eta) - stats.norm.logcdf(sign * eta)) for sign in (1, -1)]
        return np.stack([ratios[0][:, None] * difference, -ratios[1][:, None] * difference], axis=1)
    centred: Array = z - np.einsum("mo,mop->mp", fitted.shares, z)[:, None, :]
    return centred


STEPS = {"thurstone": _thurstone_step, "rao-kupper": _rao_kupper_step}
