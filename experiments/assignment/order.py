"""Every clip for everyone, one a trial: in blocks, with practice before and attention checks between."""

import random
from collections.abc import Callable
from itertools import cycle, islice, permutations
from typing import TYPE_CHECKING, Literal

from experiments import design
from experiments.assignment.groups import Place, cells_of, place_of
from experiments.assignment.shares import share
from experiments.assignment.trial import Shown, Trial
from experiments.design import BlockSpec, ClipSpec

if TYPE_CHECKING:
    from experiments.definition import Experiment

MAX_ORDERS = 120
"""Up to five blocks every order is dealt; beyond that a Latin square: each block in each place."""


def single_clips(
    experiment: "Experiment", seed: int, slot: int, asked: Callable[[random.Random], int]
) -> list[Trial]:
    """The trials of one participant in order.

    Parameters
    ----------
    experiment: the declaration.
    seed: of everything random; equal seeds give equal orders.
    slot: place in the counterbalancing, from 0; block orders are dealt by it, evenly over any run of slots.
    asked: draws the answer that an attention check asks for.
    """
    rng = random.Random(seed)
    place = place_of(experiment, slot)
    mine = share(experiment, place)
    trials = _practice(experiment, place, rng)
    for number, block in enumerate(ordered_blocks(experiment, rng, place.number), start=1):
        clips = [clip for clip in block.clips if clip in mine]
        if experiment.blocks.trial_order == "random":
            rng.shuffle(clips)
        main = [_of_one("main", number, block.label, clip) for clip in clips]
        trials.extend(with_attention(experiment, main, rng, asked))
    return trials


def block_orders(experiment: "Experiment") -> list[tuple[int, ...]]:
    """The orders of the levels' blocks that slots are dealt, as indices; one where nothing is dealt."""
    count = len(_levels(experiment))
    if experiment.blocks.order == "alternating":
        return [tuple((start + step) % count for step in range(count)) for start in range(count)]
    if experiment.blocks.order == "counterbalanced":
        every = list(islice(permutations(range(count)), MAX_ORDERS + 1))
        return every if len(every) <= MAX_ORDERS else _latin_square(count)
    return [tuple(range(count))]


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


def _latin_square(count: int) -> list[tuple[int, ...]]:
    """Williams' balanced square (1949): each block in each place, and after each other equally often."""
    first = [0]
    for step in range(1, count):
        first.append((step + 1) // 2 if step % 2 else count - step // 2)
    rows = [tuple((index + shift) % count for index in first) for shift in range(count)]
    return rows if count % 2 == 0 else rows + [tuple(reversed(row)) for row in rows]


def _practice(experiment: "Experiment", place: Place, rng: random.Random) -> list[Trial]:
    """Clips from as many different cells as there are practice trials, exemplars at random."""
    cells = cells_of(experiment, place)
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
    places = sorted(rng.sample(range(1, len(main) + 1), min(experiment.attention.per_block, len(main))))
    for place in reversed(places):
        response = asked(rng)
        check = Trial("attention", main[0].block, main[0].block_label, expected_response=response)
        trials.insert(place, check)
    return trials
