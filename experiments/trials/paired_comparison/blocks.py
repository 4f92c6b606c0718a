"""Pairs dealt in the blocks of a balanced incomplete design."""

import random
from functools import cached_property
from itertools import combinations
from typing import TYPE_CHECKING

from experiments.assignment.incomplete_blocks import Block, balanced_blocks
from experiments.trials.declared import ClipSpec
from experiments.trials.paired_comparison.declaration import IncompleteBlocks
from experiments.trials.paired_comparison.pairs import Deal, Pair, alike

if TYPE_CHECKING:
    from experiments.definition import Experiment


class BlockDeal(Deal):
    """Which pairs each slot gets where a participant compares all clips of a few blocks.

    The blocks of every set of clips stand in one order, those of one set between those of the others; slot
    after slot takes the next `blocks_per_person`, round and round. Each time a pair is dealt again its
    sides are exchanged.
    """

    def __init__(self, experiment: "Experiment", declared: IncompleteBlocks) -> None:
        super().__init__(experiment)
        self._per_person, size = declared.blocks_per_person, declared.clips_per_block
        self._sets = [self._shuffled(number, clips) for number, clips in enumerate(alike(experiment))]
        self.blocks = balanced_blocks(len(self._sets[0]), size) or ()
        self.each = self._per_person * size * (size - 1) // 2

    @property
    def round(self) -> int:
        """Blocks of one round, after which every pair has been dealt as often as any other."""
        return len(self.blocks) * len(self._sets)

    def _shuffled(self, number: int, clips: list[ClipSpec]) -> list[ClipSpec]:
        # Else the same cells would meet in the first block of every set.
        seed = f"blocks/{self._experiment.exemplars.seed}/{number}"
        return random.Random(seed).sample(clips, len(clips))

    @cached_property
    def _placed(self) -> dict[frozenset[ClipSpec], Pair]:
        return {frozenset(pair): pair for pair in self.pairs}

    def of_slot(self, slot: int) -> list[Pair]:
        """The pairs of one slot, repeats of the blocks not counted."""
        places = range(slot * self._per_person, (slot + 1) * self._per_person)
        return [pair for turn in places for pair in self._of_block(turn)]

    def _of_block(self, turn: int) -> list[Pair]:
        rounds, at = divmod(turn, self.round)
        index, of_set = divmod(at, len(self._sets))
        dealt = []
        for two in combinations(self.blocks[index], 2):
            pair = self._placed[frozenset(self._sets[of_set][point] for point in two)]
            before = rounds * self._times(two, len(self.blocks)) + self._times(two, index)
            dealt.append(pair.swapped if before % 2 else pair)
        return dealt

    def _times(self, two: Block, index: int) -> int:
        """In how many of the first blocks these two points meet."""
        one, other = two
        return sum(one in block and other in block for block in self.blocks[:index])
