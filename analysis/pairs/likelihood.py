"""Maximum likelihood for choices between two items, with or without ties."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from analysis.pairs.comparisons import LEFT, RIGHT, TIE, Comparisons
from experiments.errors import InputError

Array = NDArray[np.float64]
Method = Literal["bradley-terry", "davidson", "thurstone"]
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
    method : {"bradley-terry", "davidson", "thurstone"}
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
        return int(self.design.shape[1]) + self.order_effect + (self.method == "davidson")


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
    ties = model.method == "davidson"
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
    step = _thurstone_step if model.method == "thurstone" else _softmax_step
    # All items alike: for a concave likelihood any start will do, and this one lies inside.
    parameters = np.zeros(model.names)
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
        while size > 1e-8 and step(model, counts, parameters + size * change, firth)[0] < value - 1e-12:
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
    return float(np.sum(counts.outcomes * np.log(np.where(counts.outcomes > 0, shares, 1.0))))


def _softmax_step(
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
