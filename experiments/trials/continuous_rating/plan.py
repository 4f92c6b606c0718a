"""Who rates which clips in what order: as single clips are dealt."""

import random
from typing import TYPE_CHECKING

from experiments.assignment.order import single_clips
from experiments.assignment.trial import Trial
from experiments.trials.continuous_rating.declaration import CHECK_POINTS

if TYPE_CHECKING:
    from experiments.definition import Experiment


def assign(experiment: "Experiment", seed: int, slot: int) -> list[Trial]:
    """The trials of one participant in order, see `single_clips`."""

    def asked(rng: random.Random) -> int:
        return rng.randint(1, CHECK_POINTS)

    return single_clips(experiment, seed, slot, asked)
