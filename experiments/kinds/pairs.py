"""The pairs of a design: which clips are compared, dealt whole or in the blocks of an incomplete design."""

import random
from collections.abc import Iterable, Iterator, Sequence
from functools import cached_property
from itertools import combinations, islice, starmap
from typing import NamedTuple

from experiments import design
from experiments.assignment.groups import groups as groups_of
from experiments.assignment.groups import of_group
from experiments.assignment.incomplete_blocks import Block, balanced_blocks, near_sizes
from experiments.declaration.experiment import Experiment
from experiments.declaration.paired_comparison import (
    AllPairs,
    DeclaredPairs,
    IncompleteBlocks,
    PairedComparison,
    WithinFactor,
    paired_comparison_of,
)
from experiments.declaration.trial import ClipSpec
from experiments.errors import InputError, did_you_mean

# The pairs of a design: which clips are compared, whether they are connected, and who gets which.
#
# Pure functions of the declaration. A pair is deterministic in its order; sides are dealt by `Deal`.

MAX_PAIRS = 20_000


class Pair(NamedTuple):
    """Two different clips that are compared; `left` names the one that is left at its first showing."""

    left: ClipSpec
    right: ClipSpec

    @property
    def swapped(self) -> "Pair":
        """The same clips, sides exchanged."""
        return Pair(self.right, self.left)


def fault(experiment: Experiment) -> str | None:
    """What in the declared pairs does not fit the experiment, in one line; None where all is well."""
    trial = paired_comparison_of(experiment)
    cells = ["/".join(level for _, level in cell) for cell in design.cells(experiment)]
    named: list[tuple[str, str]] = []
    if isinstance(trial.pairs, WithinFactor):
        if wrong := _fault_of_factor(experiment, trial.pairs.factor):
            return wrong
    elif not isinstance(trial.pairs, AllPairs):
        named = [
            ("trial.pairs.cells", cell) for pair in trial.pairs.cells for cell in (pair.cell, pair.other)
        ]
        same = [pair.cell for pair in trial.pairs.cells if pair.cell == pair.other]
        if same:
            return f"trial.pairs.cells: '{same[0]}' is paired with itself; a pair needs two different cells"
    if trial.reference:
        named.append(("trial.reference.cell", trial.reference.cell))
    unknown = next(((path, cell) for path, cell in named if cell not in cells), None)
    if unknown:
        return f"{unknown[0]}: no cell is called '{unknown[1]}'{did_you_mean(unknown[1], cells)}"
    across = _across_groups(experiment, trial)
    if across:
        return across
    designs = [of_group(experiment, levels) for levels in groups_of(experiment)]
    every = (_no_pairs_or_split(one) or _fault_of_blocks(one, trial) for one in designs)
    return next((wrong for wrong in every if wrong), None)


def _fault_of_factor(experiment: Experiment, name: str) -> str | None:
    names = experiment.factor_names
    if name not in names:
        return f"trial.pairs.factor: no factor is called '{name}'{did_you_mean(name, names)}"
    if experiment.factor(name).between:
        return f"trial.pairs.factor: '{name}' is between participants, so nobody sees two of its levels"
    return None


def _across_groups(experiment: Experiment, trial: PairedComparison) -> str | None:
    """A declared pair whose cells no participant sees both of; None where there is none."""
    if not isinstance(trial.pairs, DeclaredPairs):
        return None
    between = [index for index, factor in enumerate(experiment.factors) if factor.between]
    for pair in trial.pairs.cells:
        one, other = pair.cell.split("/"), pair.other.split("/")
        if any(one[index] != other[index] for index in between):
            return (
                f"trial.pairs.cells: '{pair.cell}' and '{pair.other}' are seen by different groups, so "
                "nobody can compare them; pair cells of one group"
            )
    return None


def _fault_of_blocks(experiment: Experiment, trial: PairedComparison) -> str | None:
    if not isinstance(trial.dealing, IncompleteBlocks):
        return None
    clips, size = len(comparable_sets(experiment)[0]), trial.dealing.clips_per_block
    if size > clips:
        return (
            f"trial.dealing.clips_per_block: expected at most the {clips} clips that are compared, got {size}"
        )
    if balanced_blocks(clips, size) is None:
        near = ", ".join(map(str, near_sizes(clips, size))) or "2"
        return (
            f"trial.dealing.clips_per_block: no balanced design of {clips} clips in blocks of {size} is "
            f"known here; take {near}, or deal the pairs in turn"
        )
    return None


def _no_pairs_or_split(experiment: Experiment) -> str | None:
    pairs, split = list(islice(_all_pairs(experiment), MAX_PAIRS + 1)), experiment.blocks.split_by
    if not pairs:
        return "trial.pairs: the design has no two clips to compare; give the factor two levels or more"
    if len(pairs) > MAX_PAIRS:
        return (
            f"trial.pairs: the design has more than {MAX_PAIRS} pairs; compare within a factor, or list them"
        )
    for left, right in pairs:
        if split and left.level(split) != right.level(split):
            return (
                f"blocks.split_by: pairs such as {left.cell} with {right.cell} lie across the levels of "
                f"'{split}', so they are in no block; leave split_by out, or compare within another factor"
            )
    return None


def every_pair(experiment: Experiment) -> list[Pair]:
    """Every pair of the design once, sides as even for each clip as they can be.

    Each pair in turn is put so that the clip which has been left less often (relative to right) is left.
    """
    lead: dict[ClipSpec, int] = {}
    pairs = []
    for pair in _all_pairs(experiment):
        placed = pair if lead.get(pair.left, 0) <= lead.get(pair.right, 0) else pair.swapped
        lead[placed.left] = lead.get(placed.left, 0) + 1
        lead[placed.right] = lead.get(placed.right, 0) - 1
        pairs.append(placed)
    return pairs


def _all_pairs(experiment: Experiment) -> Iterator[Pair]:
    declared, clips = paired_comparison_of(experiment).pairs, design.clips(experiment)
    if isinstance(declared, AllPairs):
        matched = declared.exemplars == "matched"
        yield from (Pair(a, b) for a, b in combinations(clips, 2) if not matched or a.exemplar == b.exemplar)
    elif isinstance(declared, WithinFactor):
        for group in comparable_sets(experiment):
            yield from starmap(Pair, combinations(group, 2))
    else:
        at = {(clip.cell, clip.exemplar): clip for clip in clips}
        numbers = range(1, experiment.exemplars.per_cell + 1)
        mine = {cell for cell, _ in at}
        for cells in declared.cells:
            if cells.cell not in mine:
                continue
            yield from (Pair(at[cells.cell, number], at[cells.other, number]) for number in numbers)


def comparable_sets(experiment: Experiment) -> list[list[ClipSpec]]:
    """Sets of clips: every two of one are compared, none with another set's. Not for lists of pairs."""
    declared, sets = paired_comparison_of(experiment).pairs, dict[object, list[ClipSpec]]()
    for clip in design.clips(experiment):
        key: object = clip.exemplar
        if isinstance(declared, WithinFactor):
            key = (*(level for level in clip.levels if level[0] != declared.factor), clip.exemplar)
        elif isinstance(declared, AllPairs) and declared.exemplars == "any":
            key = None
        sets.setdefault(key, []).append(clip)
    return list(sets.values())


class Deal:
    """Which pairs each slot gets, and with which sides.

    The pairs have one random order for the whole study. Each slot takes the next `pairs_per_person` of them,
    cyclically. Over any sequence of slots, each pair is therefore assigned equally often, to within one. Its
    sides are exchanged every second time.
    """

    def __init__(self, experiment: Experiment) -> None:
        self._experiment = experiment
        self.pairs = every_pair(experiment)
        self.each = paired_comparison_of(experiment).pairs_per_person or len(self.pairs)

    @cached_property
    def _order(self) -> list[int]:
        order = list(range(len(self.pairs)))
        if self.each < len(order):
            random.Random(f"pairs/{self._experiment.exemplars.seed}").shuffle(order)
        return order

    def of_slot(self, slot: int) -> list[Pair]:
        """The pairs of one slot, repeats of the blocks not counted."""
        places = range(slot * self.each, (slot + 1) * self.each)
        dealt = []
        for turn in places:
            times, at = divmod(turn, len(self.pairs))
            pair = self.pairs[self._order[at]]
            dealt.append(pair.swapped if times % 2 else pair)
        return dealt


def item_of(experiment: Experiment, clip: ClipSpec) -> str:
    """What a clip stands for when pairs are analyzed.

    Its cell; its level where pairs lie within one factor; itself where any exemplars are compared.
    """
    declared = paired_comparison_of(experiment).pairs
    if isinstance(declared, WithinFactor):
        return clip.level(declared.factor)
    if isinstance(declared, AllPairs) and declared.exemplars == "any":
        return f"{clip.cell} ({clip.exemplar})"
    return clip.cell


def groups(edges: Iterable[tuple[str, str]], items: Iterable[str]) -> list[list[str]]:
    """Items that are compared with one another, directly or through others; one group where all are."""
    group_of = {item: {item} for item in items}
    for a, b in edges:
        if group_of[a] is not group_of[b]:
            merged = group_of[a] | group_of[b]
            group_of.update(dict.fromkeys(merged, merged))
    distinct = {id(group): group for group in group_of.values()}
    return sorted(sorted(group) for group in distinct.values())


def check_connected(experiment: Experiment, pairs: Sequence[Pair]) -> None:
    """InputError where these pairs leave items on two scales, or clips out, naming them."""
    items = {item_of(experiment, clip) for clip in design.clips(experiment)}
    edges = [(item_of(experiment, pair.left), item_of(experiment, pair.right)) for pair in pairs]
    apart = groups(edges, items)
    if len(apart) > 1:
        raise InputError(
            f"'{experiment.name}': expected pairs that connect all items, got {len(apart)} groups never "
            f"compared with one another: {_named(apart)}. Declare a pair between them, or more participants "
            "or pairs_per_person"
        )
    compared = {clip for pair in pairs for clip in pair}
    left_out = [f"{clip.cell}/{clip.exemplar}" for clip in design.clips(experiment) if clip not in compared]
    if left_out:
        raise InputError(
            f"'{experiment.name}': expected every clip to be compared, got {len(left_out)} clips that nobody "
            f"sees: {_short(left_out, ', ')}; declare more participants or pairs_per_person"
        )


def _named(apart: list[list[str]]) -> str:
    return _short(["{" + _short(group, ", ") + "}" for group in apart], " and ")


def _short(names: list[str], joint: str, limit: int = 6) -> str:
    return joint.join(names[:limit] + (["..."] if len(names) > limit else []))


# Pairs dealt in the blocks of a balanced incomplete design.


class BlockDeal(Deal):
    """Which pairs each slot gets where a participant compares all clips of a few blocks.

    The blocks of every set of clips have one order, interleaved with those of the other sets. Each slot takes
    the next `blocks_per_person`, cyclically. Each time a pair is assigned again, its sides are exchanged.
    """

    def __init__(self, experiment: Experiment, declared: IncompleteBlocks) -> None:
        super().__init__(experiment)
        self._per_person, size = declared.blocks_per_person, declared.clips_per_block
        self._sets = [
            self._shuffled(number, clips) for number, clips in enumerate(comparable_sets(experiment))
        ]
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
