"""Intervals of abilities: Wald, profile, bootstrap, and for rankings that are watched while they grow."""

import math
from dataclasses import dataclass
from itertools import combinations
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy import optimize, special, stats

from analysis.pairs.comparisons import Comparisons
from analysis.pairs.likelihood import (
    STEPS,
    TIED,
    Counts,
    Fit,
    Method,
    Model,
    count_by_rater,
    count_outcomes,
    fit,
    free_abilities,
    outcome_gradients,
    softmax_step,
)
from analysis.within.adjustments import holm
from experiments.errors import InputError

Array = NDArray[np.float64]
Intervals = Literal["wald", "profile", "bootstrap", "anytime"]
ALPHA = 0.05
SEED = 53
TRIES = 4
"""Samples that are drawn for each one that is used."""
RATERS_TIGHTEST, COMPARISONS_TIGHTEST = 40, 1000
"""Where anytime-valid intervals are narrowest, of raters or of single comparisons. Fixed before the data."""
RATERS_MIN = 10
STEP_MAX = 5.0
FAR = 50.0
"""An ability, in logits, at which every comparison is certain."""


@dataclass(frozen=True, eq=False)
class FittedPairs:
    """A fitted model and its data; `robust` is the covariance with raters as clusters, if they are known."""

    comparisons: Comparisons
    model: Model
    counts: Counts
    fitted: Fit
    robust: Array | None
    firth: bool = False


def interval_limits(
    pairs: FittedPairs, rows: Array, kind: Intervals, samples: int
) -> tuple[Array, list[str]]:
    """95% limits (r, 2) of linear functions `rows` (r, p) of the parameters, and decisions in words.

    Raises
    ------
    InputError
        A profile of a penalized likelihood; samples in which an item always wins; too few raters to watch.
    """
    if kind == "profile":
        if pairs.firth:
            raise InputError("--intervals profile takes no --firth; use --intervals bootstrap or wald")
        return np.array([_profile(pairs, row) for row in rows]), []
    if kind == "bootstrap":
        draws, dropped = resampled_parameters(pairs, samples)
        limits = np.quantile(draws @ rows.T, (ALPHA / 2, 1 - ALPHA / 2), axis=0, method="hazen").T
        return limits, [f"{dropped} samples without a finite estimate were drawn again"] if dropped else []
    estimates, covariance = rows @ pairs.fitted.parameters, pairs.fitted.covariance
    factor = float(stats.norm.ppf(1 - ALPHA / 2))
    if kind == "anytime":
        covariance = covariance if pairs.robust is None else pairs.robust
        factor = anytime_factor(pairs)
    half = factor * np.sqrt(np.clip(np.einsum("rp,pq,rq->r", rows, covariance, rows), 0.0, None))
    return np.stack([estimates - half, estimates + half], axis=1), []


def anytime_factor(pairs: FittedPairs) -> float:
    r"""How many standard errors an interval extends that holds at all sizes and for all pairs of items.

    Raises
    ------
    InputError
        Fewer raters than ten, or than three per free ability: the guarantee is asymptotic.

    Notes
    -----
    An asymptotic confidence sequence: after t raters (without raters: comparisons),

    .. math::

        \hat\lambda_t \pm SE_t \sqrt{\frac{t \rho^2 + 1}{t \rho^2} \log \frac{t \rho^2 + 1}{(\alpha / m)^2}},
        \qquad \rho^2 = \frac{-W_{-1}(-(\alpha / m)^2 / e) - 1}{t^*} \tag{1}

    contains the difference of two abilities at all t at once with probability 1 - alpha / m, so that all
    m differences are covered together (Bonferroni). W is Lambert's function, t* where the interval is
    narrowest. Source: Waudby-Smith, Arbour, Sinha, Kennedy & Ramdas (2024), Annals of Statistics 52, 2613.
    """
    raters = pairs.comparisons.participant is not None
    t = len(pairs.comparisons.participants) if raters else pairs.comparisons.outcome.size
    items = len(pairs.comparisons.items)
    least = max(RATERS_MIN, 3 * (items - 1))
    if raters and t < least:
        raise InputError(
            f"--intervals anytime needs {least} raters or more for {items} items, got {t}; watch from there"
        )
    level = ALPHA / (items * (items - 1) / 2)
    tightest = RATERS_TIGHTEST if raters else COMPARISONS_TIGHTEST
    scaled = t * float(-np.real(special.lambertw(-(level**2) / math.e, -1)) - 1) / tightest
    return float(np.sqrt((1 + 1 / scaled) * np.log((scaled + 1) / level**2)))


def rank_limits(items: int, limits: Array) -> list[tuple[int, int]]:
    """Best and worst rank of each item that the limits (pairs, 2) of its differences leave open.

    Where the limits hold for all pairs at once, so do the ranks (Klein, Wright & Wieczorek 2020, Journal of
    the Royal Statistical Society C 69, 589).
    """
    better, worse = np.zeros(items, dtype=int), np.zeros(items, dtype=int)
    for (first, second), (low, high) in zip(combinations(range(items), 2), limits, strict=True):
        better[first if high < 0 else second] += int(high < 0 or low > 0)
        worse[second if high < 0 else first] += int(high < 0 or low > 0)
    return [(1 + int(up), items - int(down)) for up, down in zip(better, worse, strict=True)]


def _profile(pairs: FittedPairs, row: Array) -> tuple[float, float]:
    r"""Ends of the profile likelihood interval of c = `row`'theta.

    The end is the extreme of c'theta where the log-likelihood l is half a chi-squared quantile below its
    maximum. Both are found as the maximum of :math:`\pm c'\theta + \mu \, l(\theta)`, which is concave, with
    mu such that l is at that height.
    """
    spread = float(row @ pairs.fitted.covariance @ row)
    # A function that is fixed, such as the ability of the reference item: its interval is a point.
    if spread <= 0:
        return 0.0, 0.0
    step = STEPS.get(pairs.model.method, softmax_step)
    height = float(stats.chi2.ppf(1 - ALPHA, 1)) / 2
    best = step(pairs.model, pairs.counts, pairs.fitted.parameters, False)[0]
    ends = []
    for sign in (-1.0, 1.0):
        # Begun at the Wald end, where a quadratic likelihood would have its end as well.
        at = pairs.fitted.parameters + sign * np.sqrt(2 * height / spread) * (pairs.fitted.covariance @ row)

        def reached(log_mu: float, sign: float = sign) -> float:
            nonlocal at
            start = at if np.abs(at).max() < FAR else pairs.fitted.parameters
            # Far out a share is 0 and its logarithm minus infinity: lower than any height, as it should be.
            with np.errstate(divide="ignore", invalid="ignore"):
                at = _climb(pairs, sign * np.exp(-log_mu) * row, start)
                value = float(step(pairs.model, pairs.counts, at, False)[0])
            return value - best + height if np.isfinite(value) else -1e9

        # The multiplier that a quadratic likelihood has at that height.
        middle = 0.5 * np.log(spread / (2 * height))
        width = 0.25
        while reached(middle - width) > 0 or reached(middle + width) < 0:
            width *= 2
        # The root itself is not needed: the evaluations leave the point in `at`.
        optimize.brentq(reached, middle - width, middle + width, xtol=1e-11)
        ends.append(float(row @ at))
    return ends[0], ends[1]


def _climb(pairs: FittedPairs, slope: Array, start: Array) -> Array:
    """Maximum of the log-likelihood plus `slope`'theta, by Newton steps that are halved where they lose."""
    step = STEPS.get(pairs.model.method, softmax_step)
    at, value, gradient, information, *_ = start, *step(pairs.model, pairs.counts, start, False)
    # Where the likelihood is not finite at the start, the estimate is a safe one.
    if not np.isfinite(value):
        at = pairs.fitted.parameters
        value, gradient, information, *_ = step(pairs.model, pairs.counts, at, False)
    for _ in range(100):
        # A slope steeper than the likelihood falls anywhere has no maximum: the point runs away, and its
        # likelihood, far below the height, says so.
        if np.abs(at).max() > FAR or np.linalg.cond(information) > 1e14:
            break
        change, size = np.linalg.solve(information, gradient + slope), 1.0
        if np.max(np.abs(change)) < 1e-10:
            break
        # Where the likelihood is nearly flat, a whole Newton step would leave the range of numbers.
        change *= min(1.0, STEP_MAX / float(np.abs(change).max()))
        while size > 1e-8:
            value_there, *there = step(pairs.model, pairs.counts, at + size * change, False)
            if value_there + slope @ (at + size * change) >= value + slope @ at - 1e-12 * (1 + abs(value)):
                break
            size /= 2
        else:
            break
        at, value, (gradient, information, *_) = at + size * change, value_there, there
    return at


def resampled_parameters(pairs: FittedPairs, samples: int) -> tuple[Array, int]:
    """Parameters (samples, p) of raters (without raters: comparisons) drawn with replacement.

    Samples without a finite estimate are drawn again; the second value is their number.

    Raises
    ------
    InputError
        Where most samples have none.
    """
    # A fixed seed: the same table gives the same intervals.
    random = np.random.default_rng(SEED)
    raters = pairs.comparisons.participant is not None
    of_raters = count_by_rater(pairs.comparisons, pairs.counts) if raters else None
    number = of_raters.shape[0] if of_raters is not None else pairs.comparisons.outcome.size
    if raters and number < 2:
        raise InputError("--intervals bootstrap needs two raters or more, got 1; omit --participant")
    draws: list[Array] = []
    for tried in range(TRIES * samples):
        if len(draws) == samples:
            return np.array(draws), tried - samples
        if of_raters is None:
            # Comparisons of one pair with one outcome are alike: how often each is drawn is multinomial.
            share = pairs.counts.outcomes.ravel() / number
            drawn = random.multinomial(number, share).astype(np.float64)
        else:
            drawn = np.bincount(random.integers(number, size=number), minlength=number) @ of_raters
        counts = Counts(pairs.counts.left, pairs.counts.right, drawn.reshape(pairs.counts.outcomes.shape))
        try:
            draws.append(fit(pairs.model, counts, firth=pairs.firth).parameters)
        except (InputError, np.linalg.LinAlgError):
            continue
    raise InputError(
        f"in most samples of the {number} {'raters' if raters else 'comparisons'} an item wins or loses "
        "every comparison; use --intervals profile, or add --firth"
    )


# Several questions about the same pairs.


@dataclass(frozen=True)
class QuestionDifference:
    """An item's ability (against the mean of all items) for one question minus that for another."""

    item: str
    difference: float
    se: float
    p: float
    p_holm: float


@dataclass(frozen=True)
class QuestionPair:
    """Two questions: correlation of the abilities, and Hotelling's test that all abilities are the same.

    `f_value` to `p` are None where raters are too few; without raters chi2 / df, on infinite error df.
    """

    first: str
    second: str
    correlation: float
    f_value: float | None
    df: int
    df_error: float | None
    p: float | None
    differences: tuple[QuestionDifference, ...]


def compare_questions(
    questions: dict[str, Comparisons], method: Method, *, order_effect: bool = False
) -> tuple[QuestionPair, ...]:
    r"""Compare the abilities of the same items between questions that the same or other raters answered.

    Notes
    -----
    With :math:`s_{gq}` rater g's gradient for question q and :math:`C_q` that model's covariance, the
    difference of two questions has the covariance :math:`G / (G - 1) \sum_g h_g h_g'`,
    :math:`h_g = C_1 s_{g1} - C_2 s_{g2}`, so that what raters share between questions counts.

    Raises
    ------
    InputError
        Questions whose items differ.
    """
    names = list(questions)
    items = questions[names[0]].items
    for name in names[1:]:
        if questions[name].items != items:
            raise InputError(
                f"question '{name}' has other items than '{names[0]}'; expected the same items for each"
            )
    people = sorted({person for own in questions.values() for person in own.participants})
    if len(people) == 1:
        raise InputError("--question needs two raters or more, got 1; omit --participant")
    design = free_abilities(len(items))
    centring = design - design.mean(axis=0)
    abilities, parts, covariances = {}, {}, {}
    for name, own in questions.items():
        counts = count_outcomes(own, ties=method in TIED)
        free = Model(method, design, order_effect)
        fitted = fit(free, counts)
        inside = slice(0, design.shape[1])
        abilities[name] = centring @ fitted.parameters[inside]
        covariances[name] = centring @ fitted.covariance[inside, inside] @ centring.T
        if people:
            gradients = outcome_gradients(free, counts, fitted).reshape(-1, free.names)
            influence = (count_by_rater(own, counts) @ gradients) @ fitted.covariance
            parts[name] = np.zeros((len(people), len(items)))
            parts[name][[people.index(one) for one in own.participants]] = influence[:, inside] @ centring.T
    pairs = []
    for first, second in combinations(names, 2):
        difference = abilities[first] - abilities[second]
        if people:
            apart = parts[first] - parts[second]
            covariance = apart.T @ apart * len(people) / (len(people) - 1)
        else:
            covariance = covariances[first] + covariances[second]
        pairs.append(
            _question_pair((first, second), items, difference, covariance, len(people) or None, abilities)
        )
    return tuple(pairs)


def _question_pair(
    names: tuple[str, str],
    items: tuple[str, ...],
    difference: Array,
    covariance: Array,
    raters: int | None,
    abilities: dict[str, Array],
) -> QuestionPair:
    df = len(items) - 1
    # Abilities against their mean sum to zero, so that one of the items is redundant.
    square = float(difference[1:] @ np.linalg.pinv(covariance[1:, 1:]) @ difference[1:])
    f_value: float | None = None
    p: float | None = None
    if raters is None:
        f_value, p = square / df, float(stats.chi2.sf(square, df))
    elif raters > df:
        # Hotelling's T^2 as an F value, since the covariance is estimated from the same raters.
        f_value = square * (raters - df) / ((raters - 1) * df)
        p = float(stats.f.sf(f_value, df, raters - df))
    df_error = None if raters is None or raters <= df else float(raters - df)
    se = np.sqrt(np.clip(np.diag(covariance), 0.0, None))
    z = np.abs(np.divide(difference, se, out=np.zeros_like(se), where=se > 0))
    p_each = 2 * (stats.norm.sf(z) if raters is None else stats.t.sf(z, raters - 1))
    differences = zip(items, difference, se, p_each, holm(p_each), strict=True)
    return QuestionPair(
        *names,
        float(np.corrcoef(abilities[names[0]], abilities[names[1]])[0, 1]),
        f_value,
        df,
        df_error,
        p,
        tuple(QuestionDifference(item, *map(float, rest)) for item, *rest in differences),
    )
