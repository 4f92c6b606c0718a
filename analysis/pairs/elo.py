"""Elo ratings of items: averaged over random orders of the comparisons, with intervals."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.pairs.comparisons import LEFT, TIE, Comparisons, refuse_disconnected, separated_items
from analysis.pairs.likelihood import Model, count_outcomes, fit, free_abilities
from experiments.errors import InputError

Array = NDArray[np.float64]
Codes = NDArray[np.int64]
CENTER = 1500.0
PER_LOGIT = 400 / np.log(10)
"""Elo points of one log odds: 400 points apart, the better wins ten times as often."""
SEED = 53
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
    refuse_disconnected(comparisons)
    n, random = comparisons.outcome.size, np.random.default_rng(SEED)
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
    left, right = np.append(comparisons.left, 0), np.append(comparisons.right, 0)
    score = np.append(np.array([1.0, 0.0, 0.5])[comparisons.outcome], np.nan)
    samples = np.arange(rows.shape[1])
    ratings = np.full((rows.shape[1], len(comparisons.items)), CENTER)
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
