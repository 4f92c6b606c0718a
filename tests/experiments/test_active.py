"""Active sampling: what it chooses, measured against known scores and plain numerical integration."""

import random
from itertools import combinations
from math import erf, exp, log2, pi, sqrt

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from experiments.kinds.pair_choice import Posterior, StoredComparisons, batch, posterior


def test_gain_is_the_mutual_information_of_answer_and_score() -> None:
    """Against the integral over the normal density, by the trapezoid rule."""
    for m, variance in ((0.0, 2.0), (1.0, 2.0), (2.5, 0.5), (4.0, 4.0)):
        known = Posterior([m, 0.0], [2 / variance, 2 / variance])
        mean, sd = m / 1.702, sqrt(variance) / 1.702
        steps = [mean + sd * (-8 + 16 * step / 4000) for step in range(4001)]
        weight = [exp(-(((x - mean) / sd) ** 2) / 2) / (sd * sqrt(2 * pi)) * 16 * sd / 4000 for x in steps]
        chance = [0.5 + 0.5 * erf(x / sqrt(2)) for x in steps]
        p = sum(w * c for w, c in zip(weight, chance, strict=True))
        exact = _coin(p) - sum(w * _coin(c) for w, c in zip(weight, chance, strict=True))
        # The closed form replaces the entropy of the cumulative normal by a bell: off by some thousandths.
        assert known.gain((0, 1)) == pytest.approx(exact, abs=0.006)


def _coin(p: float) -> float:
    return -p * log2(p) - (1 - p) * log2(1 - p) if 0 < p < 1 else 0.0


def test_scores_are_the_mode_of_the_posterior() -> None:
    """The slope of the log posterior is zero there, each term written out."""
    rng = random.Random(3)
    stored = {
        edge: StoredComparisons(n := rng.randint(0, 9), rng.randint(0, n))
        for edge in combinations(range(6), 2)
    }
    scores = posterior(6, stored).scores
    for item in range(6):
        slope = -scores[item] / 4.0
        for (one, other), count in stored.items():
            if item in (one, other):
                p = 1 / (1 + exp(scores[other] - scores[one]))
                slope += (count.won - count.answered * p) * (1 if item == one else -1)
        assert abs(slope) < 0.2  # within a hundredth of a logit of the mode


@settings(max_examples=40, deadline=None)
@given(items=st.integers(2, 14), number=st.integers(1, 60), seed=st.integers(0, 2**31))
def test_a_batch_holds_together_and_no_pair_twice(items: int, number: int, seed: int) -> None:
    rng = random.Random(seed)
    edges = list(combinations(range(items), 2))
    stored = {
        edge: StoredComparisons(n := rng.randint(0, 5), rng.randint(0, n))
        for edge in edges
        if rng.random() < 0.7
    }
    chosen = batch(items, edges, stored, number, random.Random(seed))
    assert len(chosen) == len(set(chosen)) == min(number, len(edges))
    assert chosen == batch(items, edges, stored, number, random.Random(seed))
    reached = {0}
    for _ in range(items):
        reached |= {item for edge in chosen if reached & set(edge) for item in edge}
    assert reached == set(range(items)) or number < items - 1


def test_what_is_known_is_not_asked_again() -> None:
    """Two items that are far apart, and two that nobody has compared: the latter come first."""
    stored = {
        (0, 1): StoredComparisons(40, 40),
        (0, 2): StoredComparisons(40, 20),
        (1, 2): StoredComparisons(40, 1),
    }
    edges = list(combinations(range(4), 2))
    first = batch(4, edges, stored, 1, random.Random(1))
    assert 3 in first[0]
    # What others are just being asked counts as known, though nobody has answered.
    waiting = {
        (0, 3): StoredComparisons(open=200),
        (1, 3): StoredComparisons(open=200),
        (2, 3): StoredComparisons(open=200),
    }
    known = posterior(4, stored | waiting)
    assert max(known.gain(edge) for edge in waiting) < posterior(4, stored).gain((2, 3)) / 3
