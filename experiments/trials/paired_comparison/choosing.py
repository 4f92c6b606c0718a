"""A participant's pairs chosen by what is stored: the most telling ones, and a random share of the others."""

import random
from collections import Counter
from collections.abc import Iterable
from itertools import count
from typing import TYPE_CHECKING

from experiments.assignment.active import Edge, Stored, batch
from experiments.assignment.compared import Compared
from experiments.trials.declared import ClipSpec
from experiments.trials.paired_comparison.declaration import Active, paired_comparison_of
from experiments.trials.paired_comparison.pairs import Pair, every_pair, item_of

if TYPE_CHECKING:
    from experiments.definition import Experiment

SCORES = {"left": 1.0, "tie": 0.5, "right": 0.0}


def chosen_pairs(experiment: "Experiment", seed: int, compared: Iterable[Compared]) -> list[Pair]:
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
    """The pairs of a design with what is stored of each, and those taken so far."""

    def __init__(self, experiment: "Experiment", compared: Iterable[Compared], rng: random.Random) -> None:
        self.pairs, self.taken = every_pair(experiment), list[Pair]()
        self._rng = rng
        self._shown = Counter[tuple[str, str]]()
        self._number: dict[str, int] = {}
        self._edges: dict[Edge, list[Pair]] = {}
        self._stored: dict[Edge, Stored] = {}
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
        stored = self._stored.setdefault((min(one, other), max(one, other)), Stored())
        if row.winner is None:
            stored.open += row.times
        else:
            score = SCORES[row.winner]
            stored.answered += row.times
            stored.won += row.times * (score if one < other else 1 - score)

    def take_telling(self, number: int) -> None:
        """Take the pairs of items that tell most; of the clips that stand for them those shown least."""
        edges = [edge for edge in self._edges if edge[0] != edge[1]]
        for edge in batch(len(self._number), edges, self._stored, min(number, len(edges)), self._rng):
            self._take_least_shown(self._edges[edge])

    def take_random(self, number: int) -> None:
        """Take so many of the others by lot, whatever they tell."""
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
        """The pair on the side on which it has been shown less often; by lot where that is equal."""
        lead = self._on_this_side(pair) - self._on_this_side(pair.swapped)
        return pair.swapped if lead > 0 or (lead == 0 and self._rng.random() < 0.5) else pair


def _key(clip: ClipSpec) -> str:
    return f"{clip.cell}/{clip.exemplar}"
