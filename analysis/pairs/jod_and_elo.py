"""Scores of other fields: JOD with pwcmp's prior, per content, with screening; Elo ratings over orders."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy import optimize, stats
from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]

from analysis.pairs.comparisons import LEFT, RIGHT, TIE, Comparisons, refuse_disconnected, separated_items
from analysis.pairs.likelihood import Model, count_outcomes, fit, free_abilities
from experiments.errors import InputError

Array = NDArray[np.float64]
Codes = NDArray[np.int64]
Prior = Literal["gaussian", "none"]
SIGMA = 1.4826
"""SD of the difference of two items in JOD: one JOD apart, 75% prefer the better (pwcmp rounds 1.482602)."""
PRIOR_FLOOR, MEAN_WEIGHT = 0.1, 0.01
"""pwcmp's constants: added to the prior of each pair, and the weight of the squared mean."""
SEED = 53
TRIES = 4
"""Samples of raters that are drawn for each one that is used."""
FAR_FROM_QUARTILE = 1.5
"""Interquartile ranges below the first quartile beyond which pwcmp's authors leave out an observer."""
DOMINANT = 0.5
"""JOD by which the prior may move a difference of two items before it is reported as dominant."""


@dataclass(frozen=True)
class JodItem:
    """An item's score in JOD, its bootstrap interval (None without raters), and what was counted.

    `jod_plain` is the score without the prior; None where that has no maximum.
    """

    name: str
    jod: float
    jod_low: float | None
    jod_high: float | None
    jod_plain: float | None
    wins: int
    losses: int


@dataclass(frozen=True)
class JodScale:
    """The items of one content.

    Attributes
    ----------
    content : str
        `all` if contents are not distinguished or are taken together.
    reference : str or None
        The item whose score is `reference_jod`; None: scores have a mean of zero.
    """

    content: str
    reference: str | None
    items: tuple[JodItem, ...]
    n_comparisons: int
    n_participants: int | None
    log_likelihood: float


@dataclass(frozen=True)
class Observer:
    """How likely an observer's answers are if the others' scores hold.

    Attributes
    ----------
    log_likelihood : float or None
        Mean log10 probability of the counts of a pair; None of a single answer.
    distance : float or None
        Interquartile ranges below the first quartile of all observers; 0 above it.
    """

    name: str
    n: int
    log_likelihood: float | None
    distance: float | None
    is_far: bool


@dataclass(frozen=True)
class JodResult:
    """Everything `analysis pairs --method jod` knows of a table."""

    prior: Prior
    scales: tuple[JodScale, ...]
    reference_jod: float
    bootstrap: int
    observers: tuple[Observer, ...] = ()
    n_far: int = 0
    decisions: tuple[str, ...] = field(default_factory=tuple)


def scale_jod(
    contents: dict[str, Comparisons],
    prior: Prior = "gaussian",
    reference: str | None = None,
    reference_jod: float = 0.0,
    bootstrap: int = 500,
    screen: bool = False,
) -> JodResult:
    """Scale each content by itself, in units that are the same for all.

    Parameters
    ----------
    contents : dict
        Comparisons by content; of an item with itself they count in the prior alone, as in pwcmp.
    prior : {"gaussian", "none"}
        pwcmp's prior, or maximum likelihood.
    reference : str, optional
        An item of every content, whose score is `reference_jod`.
    bootstrap : int
        Samples of raters for the intervals; 0 for none.
    screen : bool
        Whether to compare each observer with the others.

    Raises
    ------
    InputError
        Ties; items that no chain of comparisons joins; without the prior an item that always wins; a content
        without the reference; no content with two items; screening without raters or of fewer than four.
    """
    decisions: list[str] = []
    alone = [name for name, own in contents.items() if len(own.items) < 2]
    if alone:
        decisions.append(f"excluded, with a single item: {', '.join(alone)}")
    kept = {name: own for name, own in contents.items() if name not in alone}
    if not kept:
        raise InputError(f"expected two items or more, got one alone in {', '.join(alone)}")
    # matrices this small only wait for a second thread
    with threadpool_limits(1, "blas"):
        scales = [
            _scaled(name, own, prior, reference, reference_jod, bootstrap, decisions)
            for name, own in kept.items()
        ]
        # All contents together would count every answer a second time.
        apart = {name: own for name, own in kept.items() if name != "all" or len(kept) == 1}
        observers = screen_observers(apart, prior, decisions) if screen else ()
    first = next(iter(contents.values()))
    return JodResult(
        prior,
        tuple(scales),
        reference_jod,
        bootstrap,
        observers,
        sum(one.is_far for one in observers),
        (*first.decisions, *decisions),
    )


def _scaled(
    content: str,
    own: Comparisons,
    prior: Prior,
    reference: str | None,
    reference_jod: float,
    bootstrap: int,
    decisions: list[str],
) -> JodScale:
    _refuse_unfit(content, own, prior)
    if reference is not None and reference not in own.items:
        raise InputError(
            f"{own.source}: '{reference}' is not an item of {content}; expected a reference that every "
            f"content has, got {', '.join(own.items)}"
        )
    wins = _wins_of_raters(own)
    total = wins.sum(axis=0)
    scores, likelihood = _maximum(total, prior)
    plain = scores if prior == "none" else None
    if prior == "gaussian" and separated_items(own) is None:
        plain = _maximum(total, "none", scores)[0]
    decisions += _prior_notes(content, own, scores, plain)
    at = None if reference is None else own.items.index(reference)

    def anchored(values: Array, by: Array) -> list[float]:
        # The ends of intervals get the zero of the estimate, so that all lie on one scale.
        zero = float(by.mean() if at is None else by[at])
        return [float(value) - zero + reference_jod for value in values]

    nothing: list[None] = [None] * len(scores)
    low: list[float] | list[None] = nothing
    high: list[float] | list[None] = nothing
    if own.participant is not None and bootstrap and len(wins) > 1:
        draws = _resampled(wins, prior, scores, bootstrap)
        low, high = (anchored(np.quantile(draws, q, axis=0, method="hazen"), scores) for q in (0.025, 0.975))
    # Comparisons of an item with itself are on the diagonal, and no item wins those.
    apart = total - np.diag(np.diag(total))
    items = zip(
        own.items,
        anchored(scores, scores),
        low,
        high,
        nothing if plain is None else anchored(plain, plain),
        apart.sum(axis=1).astype(int).tolist(),
        apart.sum(axis=0).astype(int).tolist(),
        strict=True,
    )
    raters = None if own.participant is None else len(wins)
    return JodScale(
        content,
        reference,
        tuple(JodItem(*one) for one in items),
        own.outcome.size,
        raters,
        likelihood,
    )


def _refuse_all_ties(own: Comparisons) -> None:
    if own.ties == own.outcome.size:
        raise InputError(f"{own.source}: every comparison is a tie, so nothing can be scaled")


def _refuse_unfit(content: str, own: Comparisons, prior: Prior) -> None:
    _refuse_all_ties(own)
    if own.ties:
        raise InputError(
            f"{own.source}: {own.ties} comparisons of {content} are ties, which jod does not support; use "
            "--method davidson"
        )
    refuse_disconnected(own)
    always = separated_items(own)
    if always and prior == "none":
        raise InputError(f"{own.source}: {content}: {always}, so no finite score fits; use --prior gaussian")


def _prior_notes(content: str, own: Comparisons, scores: Array, plain: Array | None) -> list[str]:
    """What the scores owe to the prior rather than to the comparisons."""
    if plain is None:
        return [f"{content}: {separated_items(own)}: only the prior keeps the score finite"]
    moved = (plain - plain.mean()) - (scores - scores.mean())
    widest = int(np.argmax(np.abs(moved)))
    if abs(moved[widest]) <= DOMINANT:
        return []
    return [f"{content}: the prior dominates: it moves {own.items[widest]} by {-moved[widest]:+.2f} JOD"]


def _wins_of_raters(own: Comparisons) -> Array:
    """How often the row's item won over the column's (raters, k, k); one matrix without raters."""
    people = np.zeros(own.outcome.size, dtype=np.int64) if own.participant is None else own.participant
    wins = np.zeros((int(people.max()) + 1, len(own.items), len(own.items)))
    for side, first, second in ((LEFT, own.left, own.right), (RIGHT, own.right, own.left)):
        chosen = own.outcome == side
        np.add.at(wins, (people[chosen], first[chosen], second[chosen]), 1.0)
    return wins


def _resampled(wins: Array, prior: Prior, start: Array, number: int) -> Array:
    """Scores (number, k) of raters drawn with replacement; draws without a maximum are drawn again."""
    random = np.random.default_rng(SEED)
    draws: list[Array] = []
    for _ in range(TRIES * number):
        if len(draws) == number:
            return np.array(draws)
        # How often each rater is drawn: a weighted sum of matrices takes the place of copied rows.
        counts = np.bincount(random.integers(len(wins), size=len(wins)), minlength=len(wins))
        total = np.tensordot(counts, wins, axes=1)
        if prior == "gaussian" or _has_maximum(total):
            draws.append(_maximum(total, prior, start)[0])
    raise InputError(
        f"in most samples of the {len(wins)} raters an item wins or loses every comparison, so there is no "
        "interval without a prior. Use --prior gaussian, or --bootstrap 0"
    )


def _has_maximum(total: Array) -> bool:
    from scipy.sparse.csgraph import connected_components

    return int(connected_components(total > 0, directed=True, connection="strong")[0]) == 1


def _maximum(total: Array, prior: Prior, start: Array | None = None) -> tuple[Array, float]:
    """Best scores (k,) and their log-likelihood, of wins (k, k) of the row over the column."""
    loss, likelihood, information = _posterior(total, prior)
    begin = np.zeros(len(total)) if start is None else start
    # pwcmp's mean of zero makes the information regular
    inverse = np.linalg.inv(information(begin) + MEAN_WEIGHT / len(total) ** 2)
    # BFGS takes a first inverse only if it is symmetric to the last digit.
    optimum = optimize.minimize(
        loss, begin, jac=True, method="BFGS", options={"gtol": 1e-6, "hess_inv0": (inverse + inverse.T) / 2}
    )
    return np.asarray(optimum.x, dtype=np.float64), likelihood(optimum.x)


def _posterior(
    total: Array, prior: Prior
) -> tuple[Callable[[Array], tuple[float, Array]], Callable[[Array], float], Callable[[Array], Array]]:
    r"""Loss with its gradient, log-likelihood, and expected information of scores q.

    Each pair (i, j) of the m compared in either order, of n comparisons of which i won k, has with
    :math:`P = \Phi((q_i - q_j) / 1.4826)` the likelihood :math:`P^k (1 - P)^{n - k}`, and pwcmp's prior: how
    well its P would explain each pair b's answers, next to all other pairs' P,

    .. math:: \sum_b \frac{P^{k_b} (1 - P)^{n_b - k_b}}{\sum_a P_a^{k_b} (1 - P_a)^{n_b - k_b}} + 0.1

    where k of unanimous pairs is one less unanimous. Source: Perez-Ortiz & Mantiuk (2017), arXiv:1712.03686,
    and pwcmp's pw_scale.
    """
    left, right = np.nonzero(total + total.T)
    won, n = total[left, right], (total + total.T)[left, right]
    shifted = np.where(won == 0, 1.0, np.where(won == n, won - 1, won))
    signs = np.zeros((left.size, len(total)))
    np.add.at(signs, (np.arange(left.size), left), 1.0)
    np.add.at(signs, (np.arange(left.size), right), -1.0)

    def likelihood(q: Array) -> float:
        d = signs @ q / SIGMA
        # each pair is in the table in both orders
        return float(won @ stats.norm.logcdf(d) + (n - won) @ stats.norm.logcdf(-d)) / 2

    def information(q: Array) -> Array:
        d = signs @ q / SIGMA
        # By logarithms, since density and probabilities all vanish far out.
        weight = n * np.exp(2 * stats.norm.logpdf(d) - stats.norm.logcdf(d) - stats.norm.logcdf(-d))
        return np.asarray((signs.T * weight) @ signs / SIGMA**2, dtype=np.float64)

    def loss(q: Array) -> tuple[float, Array]:
        d = signs @ q / SIGMA
        log_p, log_other, log_density = stats.norm.logcdf(d), stats.norm.logcdf(-d), stats.norm.logpdf(d)
        toward, away = np.exp(log_density - log_p) / SIGMA, np.exp(log_density - log_other) / SIGMA
        value = -(won @ log_p + (n - won) @ log_other)
        slope = won * toward - (n - won) * away
        if prior == "gaussian":
            explained = np.outer(log_p, shifted) + np.outer(log_other, n - shifted)
            # Less the largest, so that exp cannot overflow; the shares stay the same.
            share = np.exp(explained - explained.max(axis=0))
            share /= share.sum(axis=0)
            each = share.sum(axis=1) + PRIOR_FLOOR
            change = share * (np.outer(toward, shifted) - np.outer(away, n - shifted))
            value -= np.log(each).sum()
            slope += change.sum(axis=1) / each - change @ (share.T @ (1 / each))
        mean = q.mean()
        return float(value + MEAN_WEIGHT * mean**2), 2 * MEAN_WEIGHT * mean / q.size - signs.T @ slope

    return loss, likelihood, information


# Observers whose answers the others' scores make unlikely.


def screen_observers(
    contents: dict[str, Comparisons], prior: Prior, decisions: list[str]
) -> tuple[Observer, ...]:
    """Compare each observer's answers with scores of all others (pwcmp's outlier analysis)."""
    names = list(dict.fromkeys(name for own in contents.values() for name in own.participants))
    if not names:
        raise InputError("--screen compares observers; add --participant COLUMN")
    sums, pairs, answers = (np.zeros(len(names)) for _ in range(3))
    for own in contents.values():
        wins = _wins_of_raters(own)
        total = wins.sum(axis=0)
        start = _maximum(total, prior)[0]
        for k, name in enumerate(own.participants):
            others = total - wins[k]
            # without this observer an item may never have lost: only the prior then has a maximum
            fitted = prior if _has_maximum(others) else "gaussian"
            scores = _maximum(others, fitted, start)[0]
            # Each pair once: the sum has it in both orders.
            n = np.triu(wins[k] + wins[k].T, 1)
            first, second = np.nonzero(n)
            p = stats.norm.cdf((scores[first] - scores[second]) / SIGMA)
            seen = stats.binom.logpmf(wins[k][first, second], n[first, second], p) / np.log(10)
            at = names.index(name)
            sums[at] += seen.sum()
            pairs[at] += first.size
            answers[at] += n.sum()
    able = answers > 1
    single = [name for name, one in zip(names, able, strict=True) if not one]
    if single:
        decisions.append(f"not screened, with one answer: {', '.join(single)}")
    if able.sum() < 4:
        raise InputError(f"expected four observers or more to screen, got {int(able.sum())}")
    mean = sums / np.maximum(pairs, 1)
    first_quartile, third = np.quantile(mean[able], (0.25, 0.75), method="hazen")
    spread = third - first_quartile
    below = np.maximum(first_quartile - mean, 0.0)
    distance = np.divide(below, spread, out=np.zeros_like(below), where=spread > 0)
    return tuple(
        Observer(
            name,
            int(answers[k]),
            float(mean[k]) if able[k] else None,
            float(distance[k]) if able[k] else None,
            bool(able[k] and distance[k] > FAR_FROM_QUARTILE),
        )
        for k, name in enumerate(names)
    )


# Elo ratings: averaged over random orders of the comparisons, with intervals.

CENTER = 1500.0
PER_LOGIT = 400 / np.log(10)
"""Elo points of one log odds: 400 points apart, the better wins ten times as often."""
PASSES_MAX = 8
STEPS_MAX = 200_000
"""Comparisons that are gone through in each batch of samples; more comparisons have fewer passes."""
CELLS_MAX = 20_000_000
SAMPLES_MIN = 40


@dataclass(frozen=True)
class EloItem:
    """An item's Elo rating, the mean over random orders, with a bootstrap interval.

    Attributes
    ----------
    sd_order : float
        SD of the rating over orders of the same comparisons: what a single pass owes to the order.
    as_recorded : float
        Rating of one pass in the order of the rows.
    bradley_terry : float or None
        Ability on Elo's scale by maximum likelihood, which has no order; ties are half a win for each. None
        where an item always wins.
    """

    name: str
    elo: float
    elo_low: float | None
    elo_high: float | None
    sd_order: float
    as_recorded: float
    bradley_terry: float | None
    wins: int
    losses: int
    ties: int


@dataclass(frozen=True)
class EloResult:
    """Everything `analysis pairs --method elo` knows of a table. `samples` are those of the intervals."""

    items: tuple[EloItem, ...]
    k_factor: float
    orders: int
    samples: int
    passes: int
    n_comparisons: int
    n_participants: int | None
    decisions: tuple[str, ...]


def rate_elo(comparisons: Comparisons, k_factor: float = 32.0, samples: int = 500) -> EloResult:
    r"""Rate items by Elo's rule.

    Parameters
    ----------
    comparisons : Comparisons
        Ties count as half a win for each item.
    k_factor : float
        Points that a comparison can move at most.
    samples : int
        Random orders, and bootstrap samples of raters (without raters: of comparisons); 0 for no interval.

    Raises
    ------
    InputError
        One item; items that no chain of comparisons joins; a k_factor that is not positive.

    Notes
    -----
    From 1500 each comparison moves the two ratings by

    .. math::

        \pm K \, \{y - 1 / (1 + 10^{(R_r - R_l) / 400})\} \tag{1}

    y is 1 if the left item won, 0.5 for a tie (Elo 1978). A single pass depends on the order of the
    comparisons, although their order says nothing about the items. The rating is therefore the mean over
    random orders; each bootstrap sample is averaged over `passes` orders too.
    """
    if not k_factor > 0:
        raise InputError(f"expected --k-factor above 0, got {k_factor:g}")
    if len(comparisons.items) < 2:
        raise InputError(
            f"{comparisons.source}: expected two items or more, got '{comparisons.items[0]}' alone"
        )
    _refuse_all_ties(comparisons)
    refuse_disconnected(comparisons)
    n, random = comparisons.outcome.size, np.random.default_rng(SEED)
    # Rows times samples are in memory at once: a larger table gets fewer samples.
    used = min(samples, max(SAMPLES_MIN, CELLS_MAX // n)) if samples else 0
    orders = used or SAMPLES_MIN
    rows = np.arange(n)
    single = _last_ratings(comparisons, rows[:, None], k_factor)[0]
    shuffled = _last_ratings(comparisons, _orders(np.tile(rows[:, None], (1, orders)), random), k_factor)
    passes = max(1, min(PASSES_MAX, STEPS_MAX // n))
    nothing: list[float | None] = [None] * len(comparisons.items)
    low = high = nothing
    decisions = list(comparisons.decisions)
    if used:
        drawn = _drawn_rows(comparisons, used, random)
        draws = sum(
            _last_ratings(comparisons, _orders(drawn, random), k_factor) for _ in range(passes)
        ) / np.float64(passes)
        low, high = (np.quantile(draws, q, axis=0, method="hazen").tolist() for q in (0.025, 0.975))
        if used < samples:
            decisions.append(f"{n} comparisons: intervals rest on {used} samples instead of {samples}")
    reference = _bradley_terry(comparisons)
    if reference is None:
        decisions.append(
            f"{separated_items(comparisons)}: the ratings would move apart with every further comparison"
        )
    items = []
    for k, name in enumerate(comparisons.items):
        on_left, on_right = comparisons.left == k, comparisons.right == k
        tied = int(np.sum((on_left | on_right) & (comparisons.outcome == TIE)))
        won = int(
            np.sum(np.where(on_left, comparisons.outcome == LEFT, on_right & (comparisons.outcome == 1)))
        )
        of_item = (float(shuffled[:, k].mean()), low[k], high[k], float(shuffled[:, k].std(ddof=1)))
        fixed = None if reference is None else float(reference[k])
        lost = int(np.sum(on_left | on_right)) - won - tied
        items.append(EloItem(name, *of_item, float(single[k]), fixed, won, lost, tied))
    raters = None if comparisons.participant is None else len(comparisons.participants)
    return EloResult(tuple(items), k_factor, orders, used, passes, n, raters, tuple(decisions))


def _last_ratings(comparisons: Comparisons, rows: Codes, k_factor: float) -> Array:
    """Ratings (samples, items) after the comparisons of each column of `rows` (n, samples), -1 for none."""
    # Row -1 picks the last entry, a comparison that never was; its change is set to zero below.
    left, right = np.append(comparisons.left, 0), np.append(comparisons.right, 0)
    score = np.append(np.array([1.0, 0.0, 0.5])[comparisons.outcome], np.nan)
    samples = np.arange(rows.shape[1])
    ratings = np.full((rows.shape[1], len(comparisons.items)), CENTER)
    # Row by row, but all samples at once: a rating depends on the comparisons before it.
    for row in rows:
        a, b, y = left[row], right[row], score[row]
        one, other = ratings[samples, a], ratings[samples, b]
        change = k_factor * (y - 1 / (1 + np.exp((other - one) / PER_LOGIT)))
        change = np.where(row < 0, 0.0, change)
        ratings[samples, a] = one + change
        ratings[samples, b] += np.where(row < 0, 0.0, -change)
    return ratings


def _orders(rows: Codes, random: np.random.Generator) -> Codes:
    """Each column in a random order."""
    return random.permuted(rows, axis=0)


def _drawn_rows(comparisons: Comparisons, samples: int, random: np.random.Generator) -> Codes:
    """Rows (longest, samples) of raters, or of comparisons, drawn with replacement; -1 fills shorter ones."""
    n = comparisons.outcome.size
    if comparisons.participant is None:
        return random.integers(n, size=(n, samples))
    raters = len(comparisons.participants)
    by_rater = np.argsort(comparisons.participant, kind="stable")
    of_rater = np.split(by_rater, np.cumsum(np.bincount(comparisons.participant, minlength=raters))[:-1])
    drawn = [
        np.concatenate([of_rater[k] for k in random.integers(raters, size=raters)]) for _ in range(samples)
    ]
    rows = np.full((max(map(len, drawn)), samples), -1, dtype=np.int64)
    for column, one in enumerate(drawn):
        rows[: len(one), column] = one
    return rows


def _bradley_terry(comparisons: Comparisons) -> Array | None:
    """Abilities on Elo's scale around 1500, ties as half a win for each; None without a maximum."""
    if separated_items(comparisons) is not None:
        return None
    counts = count_outcomes(comparisons, ties=True)
    halves = counts.outcomes[:, :2] + counts.outcomes[:, 2:] / 2
    model = Model("bradley-terry", free_abilities(len(comparisons.items)))
    abilities = model.design @ fit(model, type(counts)(counts.left, counts.right, halves)).parameters
    scaled: Array = CENTER + PER_LOGIT * (abilities - abilities.mean())
    return scaled
