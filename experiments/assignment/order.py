"""Every clip for everyone, one a trial: in blocks, with practice before and attention checks between."""

import random
from collections.abc import Callable
from itertools import cycle, islice
from typing import TYPE_CHECKING, Literal

from experiments import design
from experiments.assignment.block_orders import block_orders
from experiments.assignment.checks import attention_by_block
from experiments.assignment.groups import Seat, cells_of, seat_of
from experiments.assignment.levels import seen_levels, sees
from experiments.assignment.shares import share
from experiments.assignment.trial import Shown, Trial
from experiments.trials.declared import BlockSpec, ClipSpec

if TYPE_CHECKING:
    from experiments.definition import Experiment


def single_clips(
    experiment: "Experiment", seed: int, slot: int, asked: Callable[[random.Random], int]
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


def _levels(experiment: "Experiment") -> list[BlockSpec]:
    """One block of each level of the split factor (or the one block of all clips), repeats left out."""
    every = design.blocks(experiment)
    return every[: len(every) // experiment.blocks.repeats]


def ordered_blocks(experiment: "Experiment", rng: random.Random, slot: int) -> list[BlockSpec]:
    """The blocks of one participant in order, repeats included."""
    declared = experiment.blocks
    levels = _levels(experiment)
    if declared.order == "random":
        blocks = levels * declared.repeats
        rng.shuffle(blocks)
        return blocks
    orders = block_orders(experiment)
    return [levels[index] for index in orders[slot % len(orders)]] * declared.repeats


def _practice(experiment: "Experiment", seat: Seat, rng: random.Random) -> list[Trial]:
    """Clips from as many different cells as there are practice trials, exemplars at random."""
    seen, rates = seen_levels(experiment, seat.number), experiment.trial.rates
    own = (cell for cell in cells_of(experiment, seat) if rates(experiment, ClipSpec(cell, 1)))
    cells = [cell for cell in own if sees(seen, cell)]
    rng.shuffle(cells)
    drawn = islice(cycle(cells), experiment.practice.trials)
    clips = [ClipSpec(cell, rng.randint(1, experiment.exemplars.per_cell)) for cell in drawn]
    return [_of_one("practice", 0, "practice", clip) for clip in clips]


def _of_one(kind: Literal["practice", "main"], block: int, label: str, clip: ClipSpec) -> Trial:
    return Trial(kind, block, label, (Shown("shown", clip),))


def with_attention(
    experiment: "Experiment", main: list[Trial], rng: random.Random, asked: Callable[[random.Random], int]
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
