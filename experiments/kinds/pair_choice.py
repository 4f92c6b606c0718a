"""Pairs chosen by the stored comparisons: the most informative ones, and a random share."""

import random
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import count
from math import erf, exp, log2, pi, sqrt
from math import log as ln

from experiments.assignment import Compared
from experiments.declaration.experiment import Experiment
from experiments.declaration.paired_comparison import Active, paired_comparison_of
from experiments.declaration.trial import ClipSpec
from experiments.kinds.pairs import Pair, every_pair, item_of

# Active sampling: the pairs of items that are most informative next, given the stored comparisons.
#
# As ASAP (Mikhailiuk et al. 2020, Active Sampling for Pairwise Comparisons via Approximate Message Passing
# and Information Gain Maximization, ICPR), in its batch form: the score of an item has a normal posterior,
# a pair is worth the information that one more answer is expected to give, and a batch is a spanning tree
# of the items with the greatest sum, so that it hangs together. The posterior is the mode of a Bradley-
# Terry model with a normal prior and the curvature along each score there (a diagonal Laplace
# approximation), which pure Python has in some milliseconds.
#
# Letters: s_i score of item i in logits, p_ij = 1 / (1 + exp(s_j - s_i)), n_ij comparisons of i with j, w_ij
# those that i won (a tie is half of one), T the prior's variance, v_i the variance of s_i.
#
#     s_i  solves  sum_j (w_ij - n_ij p_ij) = s_i / T                                            (1)
#     1 / v_i = 1 / T + sum_j n_ij p_ij (1 - p_ij)                                               (2)
#     gain_ij = h(Phi(m / sqrt(1 + u))) - C / sqrt(C^2 + u) exp(-m^2 / (2 (C^2 + u)))         (3)
#
# with h the entropy of a coin in bits, C^2 = pi ln 2 / 2, and m, u mean and variance of s_i - s_j in units of
# the probit, 1.702 logits (Houlsby et al. 2011, Bayesian Active Learning for Classification and Preference
# Learning, eq. 3).

PRIOR_VARIANCE = 4.0
LOGITS_A_PROBIT = 1.702
C2 = pi * ln(2) / 2
MAX_SWEEPS, CLOSE_ENOUGH = 12, 0.01
MAX_TREES = 4

Edge = tuple[int, int]


@dataclass
class StoredComparisons:
    """What is stored of the comparisons of two items, the lower number first.

    Attributes
    ----------
    answered : float
        Comparisons with an answer.
    won : float
        How many of them the first item won, a tie counting half.
    open : int
        Comparisons assigned to participants who have not finished.
    """

    answered: float = 0.0
    won: float = 0.0
    open: int = 0


@dataclass
class Posterior:
    """Scores in logits, and how much is known of each: the inverse of its variance."""

    scores: list[float]
    precision: list[float]
    known: dict[Edge, float] = field(default_factory=dict)

    def expect(self, edge: Edge, times: int = 1) -> None:
        """Count comparisons that were assigned but not answered; they will be as informative as answers."""
        one, other = edge
        p = _share(self.scores[one] - self.scores[other])
        for item in edge:
            self.precision[item] += times * p * (1 - p)

    def gain(self, edge: Edge) -> float:
        """Bits that one more comparison is expected to give, eq. 3."""
        one, other = edge
        m2 = ((self.scores[one] - self.scores[other]) / LOGITS_A_PROBIT) ** 2
        u = (1 / self.precision[one] + 1 / self.precision[other]) / LOGITS_A_PROBIT**2
        p = 0.5 + 0.5 * erf(sqrt(m2 / (1 + u) / 2))
        entropy = -p * log2(p) - (1 - p) * log2(1 - p) if p < 1 else 0.0
        return entropy - sqrt(C2 / (C2 + u)) * exp(-m2 / (2 * (C2 + u)))


def _share(difference: float) -> float:
    return 1 / (1 + exp(-max(-30.0, min(30.0, difference))))


def posterior(items: int, stored: Mapping[Edge, StoredComparisons]) -> Posterior:
    """Scores by eq. 1, item after item until none moves by more than 0.01 logits; precisions by eq. 2."""
    met: list[list[tuple[int, float, float]]] = [[] for _ in range(items)]
    for (one, other), answers in stored.items():
        if answers.answered:
            met[one].append((other, answers.answered, answers.won))
            met[other].append((one, answers.answered, answers.answered - answers.won))
    scores, precision = [0.0] * items, [1 / PRIOR_VARIANCE] * items
    for _ in range(MAX_SWEEPS):
        furthest = 0.0
        for item, others in enumerate(met):
            slope, bend, own = -scores[item] / PRIOR_VARIANCE, 1 / PRIOR_VARIANCE, scores[item]
            for other, times, won in others:
                p = _share(own - scores[other])
                slope += won - times * p
                bend += times * p * (1 - p)
            step = max(-1.0, min(1.0, slope / bend))
            scores[item], precision[item] = own + step, bend
            furthest = max(furthest, abs(step))
        if furthest < CLOSE_ENOUGH:
            break
    posterior = Posterior(scores, precision)
    for edge, answers in stored.items():
        if answers.open:
            posterior.expect(edge, answers.open)
    return posterior


def batch(
    items: int,
    edges: Sequence[Edge],
    stored: Mapping[Edge, StoredComparisons],
    number: int,
    rng: random.Random,
) -> list[Edge]:
    """The pairs of items to compare next, the most informative first; no pair twice if others remain.

    Parameters
    ----------
    items : int
        How many there are, called 0 to `items` - 1.
    edges : sequence of Edge
        The pairs that may be compared.
    stored : mapping of Edge to Stored
        What is stored of each.
    number : int
        Of pairs to choose.
    rng : random.Random
        Breaks ties.
    """
    known = posterior(items, stored)
    shuffled = rng.sample(list(edges), len(edges))
    chosen: list[Edge] = []
    for _ in range(MAX_TREES):
        taken = set(chosen)
        ranked = sorted((edge for edge in shuffled if edge not in taken), key=known.gain, reverse=True)
        tree = _spanning(items, ranked)[: number - len(chosen)]
        chosen += tree
        if len(chosen) >= number:
            return chosen
        for edge in tree:
            known.expect(edge)
    taken = set(chosen)
    rest = sorted((edge for edge in shuffled if edge not in taken), key=known.gain, reverse=True)
    return [*chosen, *rest[: number - len(chosen)]]


def _spanning(items: int, ranked: Sequence[Edge]) -> list[Edge]:
    """The spanning tree with the greatest sum (Kruskal 1956): ever the best edge that closes no circle."""
    root = list(range(items))

    def top(item: int) -> int:
        while root[item] != item:
            root[item] = item = root[root[item]]
        return item

    tree = []
    for one, other in ranked:
        a, b = top(one), top(other)
        if a != b:
            root[a] = b
            tree.append((one, other))
    return tree


# A participant's pairs: the most informative ones given what is stored, and a random share of the others.

SCORES = {"left": 1.0, "tie": 0.5, "right": 0.0}


def chosen_pairs(experiment: Experiment, seed: int, compared: Iterable[Compared]) -> list[Pair]:
    """The pairs of a participant who begins, each on the side where it has been shown less often.

    Parameters
    ----------
    seed : int
        Of the run; it breaks ties and draws the random share.
    compared : iterable of Compared
        Everything that is stored.
    """
    rng, trial = random.Random(f"active/{seed}"), paired_comparison_of(experiment)
    share = trial.dealing.random_share if isinstance(trial.dealing, Active) else 0.0
    choice = _Choice(experiment, compared, rng)
    number = min(trial.pairs_per_person or 1, len(choice.pairs))
    at_random = round(share * number)
    choice.take_telling(number - at_random)
    choice.take_random(number - len(choice.taken))
    return [choice.sided(pair) for pair in choice.taken]


class _Choice:
    """The pairs of a design with the stored data of each, and those taken so far."""

    def __init__(self, experiment: Experiment, compared: Iterable[Compared], rng: random.Random) -> None:
        self.pairs, self.taken = every_pair(experiment), list[Pair]()
        self._rng = rng
        self._shown = Counter[tuple[str, str]]()
        self._number: dict[str, int] = {}
        self._edges: dict[Edge, list[Pair]] = {}
        self._stored: dict[Edge, StoredComparisons] = {}
        numbers = count()
        item_of_clip: dict[str, int] = {}
        for pair in self.pairs:
            for clip in pair:
                item = item_of(experiment, clip)
                if item not in self._number:
                    self._number[item] = next(numbers)
                item_of_clip[_key(clip)] = self._number[item]
            one, other = item_of_clip[_key(pair.left)], item_of_clip[_key(pair.right)]
            self._edges.setdefault((min(one, other), max(one, other)), []).append(pair)
        for row in compared:
            self._count(row, item_of_clip)

    def _count(self, row: Compared, item_of_clip: dict[str, int]) -> None:
        self._shown[row.left, row.right] += row.times
        one, other = item_of_clip.get(row.left), item_of_clip.get(row.right)
        if one is None or other is None or one == other:
            return
        stored = self._stored.setdefault((min(one, other), max(one, other)), StoredComparisons())
        if row.winner is None:
            stored.open += row.times
        else:
            score = SCORES[row.winner]
            stored.answered += row.times
            stored.won += row.times * (score if one < other else 1 - score)

    def take_telling(self, number: int) -> None:
        """Take the most informative pairs of items; among their clips, those shown least."""
        edges = [edge for edge in self._edges if edge[0] != edge[1]]
        for edge in batch(len(self._number), edges, self._stored, min(number, len(edges)), self._rng):
            self._take_least_shown(self._edges[edge])

    def take_random(self, number: int) -> None:
        """Take this many of the others at random, however informative they are."""
        taken = set(self.taken)
        self.taken += self._rng.sample([pair for pair in self.pairs if pair not in taken], number)

    def _take_least_shown(self, pairs: list[Pair]) -> None:
        fewest = min(map(self._times, pairs))
        self.taken.append(self._rng.choice([pair for pair in pairs if self._times(pair) == fewest]))

    def _times(self, pair: Pair) -> int:
        return self._on_this_side(pair) + self._on_this_side(pair.swapped)

    def _on_this_side(self, pair: Pair) -> int:
        return self._shown[_key(pair.left), _key(pair.right)]

    def sided(self, pair: Pair) -> Pair:
        """The pair with the sides it has been shown with less often; at random if equal."""
        lead = self._on_this_side(pair) - self._on_this_side(pair.swapped)
        return pair.swapped if lead > 0 or (lead == 0 and self._rng.random() < 0.5) else pair


def _key(clip: ClipSpec) -> str:
    return f"{clip.cell}/{clip.exemplar}"
