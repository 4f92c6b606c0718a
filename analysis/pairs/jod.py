"""Paired comparisons as video quality labs scale them: JOD with pwcmp's prior, per content, and screening."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy import optimize, stats
from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]

from analysis.pairs.comparisons import LEFT, RIGHT, Comparisons, refuse_disconnected, separated_items
from experiments.errors import InputError

Array = NDArray[np.float64]
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
        zero = float(by.mean() if at is None else by[at])
        return [float(value) - zero + reference_jod for value in values]

    nothing: list[None] = [None] * len(scores)
    low: list[float] | list[None] = nothing
    high: list[float] | list[None] = nothing
    if own.participant is not None and bootstrap and len(wins) > 1:
        draws = _resampled(wins, prior, scores, bootstrap)
        low, high = (anchored(np.quantile(draws, q, axis=0, method="hazen"), scores) for q in (0.025, 0.975))
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


def _refuse_unfit(content: str, own: Comparisons, prior: Prior) -> None:
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
