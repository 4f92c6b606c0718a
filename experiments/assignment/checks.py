"""Motion checks between a participant's trials, in studies of every kind of trial."""

import random
from collections.abc import Sequence
from itertools import groupby
from typing import TYPE_CHECKING

from experiments.assignment.trial import Trial

if TYPE_CHECKING:
    from experiments.definition import Experiment


def with_checks(experiment: "Experiment", trials: Sequence[Trial], seed: int, available: int) -> list[Trial]:
    """Put the declared number of checks into each block, at random places but never first.

    Parameters
    ----------
    seed : int
        Of the run; the order of the other trials does not depend on the checks.
    available : int
        How many check clips there are; none is drawn twice.
    """
    per_block = experiment.evidence.motion_checks.per_block
    if not per_block or not available:
        return list(trials)
    rng = random.Random(f"{seed}/checks")
    drawn = iter(rng.sample(range(available), available))
    planned: list[Trial] = []
    for block, members in groupby(trials, lambda trial: trial.block):
        inside = list(members)
        places = rng.sample(range(1, len(inside) + 1), min(per_block, len(inside))) if block else []
        for position in sorted(places, reverse=True):
            number = next(drawn, None)
            if number is not None:
                label = inside[0].block_label
                inside.insert(position, Trial("check", block, label, check=number))
        planned.extend(inside)
    return planned
