"""How many checks a run has in each block, and motion checks between its trials, for every kind of trial."""

import random
from collections.abc import Sequence
from itertools import groupby
from typing import TYPE_CHECKING

from experiments import design
from experiments.assignment.trial import Trial

if TYPE_CHECKING:
    from experiments.definition import Experiment

RECRUITED_MOTION_CHECKS = 2
RECRUITED_QUESTIONS = 1
"""What `online_recruitment` asks of each run at least."""


def motion_checks_by_block(experiment: "Experiment") -> list[int]:
    """How many motion checks each block has."""
    declared = experiment.evidence
    least = RECRUITED_MOTION_CHECKS if declared.online_recruitment else 0
    return _spread(declared.motion_checks.per_block, least, len(design.blocks(experiment)))


def attention_by_block(experiment: "Experiment") -> list[int]:
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


def with_checks(experiment: "Experiment", trials: Sequence[Trial], seed: int, available: int) -> list[Trial]:
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
