"""Who compares which pairs, in which order and with which sides; and what that adds up to."""

import random
from collections import Counter
from typing import TYPE_CHECKING, Literal

from experiments.assignment.order import ordered_blocks, with_attention
from experiments.assignment.trial import Shown, Trial
from experiments.design import BlockSpec, ClipSpec
from experiments.trials.paired_comparison.declaration import paired_comparison_of
from experiments.trials.paired_comparison.pairs import Deal, Pair, check_connected, every_pair

if TYPE_CHECKING:
    from experiments.definition import Experiment


def assign(experiment: "Experiment", seed: int, slot: int) -> list[Trial]:
    """The trials of one participant in order.

    Parameters
    ----------
    seed: of the order of trials and of practice. slot: place in the counterbalancing, which deals the pairs
    and their sides.
    """
    rng = random.Random(seed)
    trials = _practice(experiment, rng)
    dealt, times = Deal(experiment).of_slot(slot), Counter[str]()
    choices = 3 if paired_comparison_of(experiment).ties else 2
    for number, block in enumerate(ordered_blocks(experiment, rng, slot), start=1):
        members = set(block.clips)
        pairs = [pair for pair in dealt if pair.left in members]
        if times[block.label] % 2:
            pairs = [pair.swapped for pair in pairs]
        times[block.label] += 1
        if experiment.blocks.trial_order == "random":
            rng.shuffle(pairs)
        main = [_trial(experiment, "main", number, block.label, pair) for pair in pairs]
        trials.extend(with_attention(experiment, main, rng, lambda draw: draw.randint(1, choices)))
    return trials


def _practice(experiment: "Experiment", rng: random.Random) -> list[Trial]:
    """Pairs drawn from all of the design, sides at random."""
    pairs = every_pair(experiment)
    drawn = [rng.choice(pairs) for _ in range(experiment.practice.trials)]
    sided = [pair.swapped if rng.random() < 0.5 else pair for pair in drawn]
    return [_trial(experiment, "practice", 0, "practice", pair) for pair in sided]


def _trial(
    experiment: "Experiment", kind: Literal["practice", "main"], block: int, label: str, pair: Pair
) -> Trial:
    declared = paired_comparison_of(experiment)
    shown = [Shown(role, clip) for role, clip in zip(declared.roles, pair, strict=True)]
    if declared.reference:
        levels = zip(experiment.factor_names, declared.reference.cell.split("/"), strict=True)
        shown.append(Shown("reference", ClipSpec(tuple(levels), pair.left.exemplar)))
    return Trial(kind, block, label, tuple(shown))


def block_size(experiment: "Experiment", block: BlockSpec) -> int:
    """Pairs that the first slot compares in a block; other slots have as many, or one more or less."""
    members = set(block.clips)
    return sum(pair.left in members for pair in Deal(experiment).of_slot(0))


def plan(experiment: "Experiment") -> tuple[str, ...]:
    """Counts over the declared participants, in words; InputError where the pairs do not hang together."""
    deal, repeats = Deal(experiment), experiment.blocks.repeats
    shown = [pair for slot in range(experiment.participants) for pair in deal.of_slot(slot)]
    check_connected(experiment, shown)
    times = Counter(frozenset(pair) for pair in shown)
    per_pair = [repeats * times[frozenset(pair)] for pair in deal.pairs]
    clips = Counter(clip for pair in shown for clip in pair)
    per_clip = [repeats * clips[clip] for clip in {clip for pair in deal.pairs for clip in pair}]
    again = f", {repeats} times each" if repeats > 1 else ""
    return (
        f"{len(deal.pairs)} pairs; each participant makes {deal.each} comparisons{again}",
        f"over {experiment.participants} participants each pair is compared {_range(per_pair)} times, "
        f"each clip is in {_range(per_clip)} comparisons",
    )


def _range(counts: list[int]) -> str:
    low, high = min(counts), max(counts)
    return str(low) if low == high else f"{low} to {high}"
