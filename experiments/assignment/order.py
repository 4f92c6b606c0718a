"""Every clip for everyone, one per trial: in blocks, with practice before and attention checks between."""

import random
from collections.abc import Callable, Sequence
from itertools import cycle, groupby, islice
from typing import Literal

from experiments import design
from experiments.assignment import Shown, Trial
from experiments.assignment.groups import Seat, cells_of, seat_of
from experiments.assignment.incomplete_blocks import block_orders
from experiments.assignment.shares import seen_levels, sees_levels, share
from experiments.declaration.experiment import Experiment
from experiments.declaration.trial import BlockSpec, ClipSpec

# How many checks a run has in each block, and motion checks between its trials, for every kind of trial.

RECRUITED_MOTION_CHECKS = 2
RECRUITED_QUESTIONS = 1
"""What `online_recruitment` asks of each run at least."""


def motion_checks_by_block(experiment: Experiment) -> list[int]:
    """How many motion checks each block has."""
    declared = experiment.evidence
    least = RECRUITED_MOTION_CHECKS if declared.online_recruitment else 0
    return _spread(declared.motion_checks.per_block, least, len(design.blocks(experiment)))


def attention_by_block(experiment: Experiment) -> list[int]:
    """How many attention questions each block has."""
    least = RECRUITED_QUESTIONS if experiment.evidence.online_recruitment else 0
    return _spread(experiment.attention.per_block, least, len(design.blocks(experiment)))


def _spread(per_block: int, least: int, blocks: int) -> list[int]:
    """`per_block` in each block, and what is missing to `least` spread evenly over the blocks."""
    counts = [per_block] * blocks
    missing = max(0, least - sum(counts))
    for number in range(missing):
        counts[(2 * number + 1) * blocks // (2 * missing)] += 1
    return counts


def with_checks(experiment: Experiment, trials: Sequence[Trial], seed: int, available: int) -> list[Trial]:
    """Put the declared number of checks into each block, at random places but never first.

    Parameters
    ----------
    seed : int
        Of the run; the order of the other trials does not depend on the checks.
    available : int
        How many check clips there are; none is drawn twice.
    """
    counts = motion_checks_by_block(experiment)
    if not any(counts) or not available:
        return list(trials)
    rng = random.Random(f"{seed}/checks")
    drawn = iter(rng.sample(range(available), available))
    planned: list[Trial] = []
    for block, members in groupby(trials, lambda trial: trial.block):
        inside = list(members)
        asked = min(counts[block - 1], len(inside)) if block else 0
        places = rng.sample(range(1, len(inside) + 1), asked)
        for position in sorted(places, reverse=True):
            number = next(drawn, None)
            if number is not None:
                label = inside[0].block_label
                inside.insert(position, Trial("check", block, label, check=number))
        planned.extend(inside)
    return planned


def single_clips(
    experiment: Experiment, seed: int, slot: int, asked: Callable[[random.Random], int]
) -> list[Trial]:
    """The trials of one participant in order.

    Parameters
    ----------
    experiment : Experiment
        The declaration.
    seed : int
        Of everything random; equal seeds give equal orders.
    slot : int
        Place in the counterbalancing, from 0; block orders are dealt by it, evenly over any run of slots.
    asked : callable
        Draws the answer that an attention check asks for.
    """
    rng = random.Random(seed)
    seat = seat_of(experiment, slot)
    mine = share(experiment, seat)
    trials = _practice(experiment, seat, rng)
    for number, block in enumerate(ordered_blocks(experiment, rng, seat.number), start=1):
        clips = [clip for clip in block.clips if clip in mine]
        if experiment.blocks.trial_order == "random":
            rng.shuffle(clips)
        main = [_of_one("main", number, block.label, clip) for clip in clips]
        trials.extend(with_attention(experiment, main, rng, asked))
    return trials


def _levels(experiment: Experiment) -> list[BlockSpec]:
    """One block of each level of the split factor (or the one block of all clips), repeats left out."""
    every = design.blocks(experiment)
    return every[: len(every) // experiment.blocks.repeats]


def ordered_blocks(experiment: Experiment, rng: random.Random, slot: int) -> list[BlockSpec]:
    """The blocks of one participant in order, repeats included."""
    declared = experiment.blocks
    levels = _levels(experiment)
    if declared.order == "random":
        blocks = levels * declared.repeats
        rng.shuffle(blocks)
        return blocks
    orders = block_orders(experiment)
    return [levels[index] for index in orders[slot % len(orders)]] * declared.repeats


def _practice(experiment: Experiment, seat: Seat, rng: random.Random) -> list[Trial]:
    """Clips from as many different cells as there are practice trials, exemplars at random."""
    seen, rates = seen_levels(experiment, seat.number), experiment.trial.rates
    own = (cell for cell in cells_of(experiment, seat) if rates(experiment, ClipSpec(cell, 1)))
    cells = [cell for cell in own if sees_levels(seen, cell)]
    rng.shuffle(cells)
    drawn = islice(cycle(cells), experiment.practice.trials)
    clips = [ClipSpec(cell, rng.randint(1, experiment.exemplars.per_cell)) for cell in drawn]
    return [_of_one("practice", 0, "practice", clip) for clip in clips]


def _of_one(kind: Literal["practice", "main"], block: int, label: str, clip: ClipSpec) -> Trial:
    return Trial(kind, block, label, (Shown("shown", clip),))


def with_attention(
    experiment: Experiment, main: list[Trial], rng: random.Random, asked: Callable[[random.Random], int]
) -> list[Trial]:
    """Put the declared number of instructed ratings between a block's trials, never before the first."""
    trials = list(main)
    count = attention_by_block(experiment)[main[0].block - 1] if main else 0
    places = sorted(rng.sample(range(1, len(main) + 1), min(count, len(main))))
    for position in reversed(places):
        response = asked(rng)
        check = Trial("attention", main[0].block, main[0].block_label, expected_response=response)
        trials.insert(position, check)
    return trials
