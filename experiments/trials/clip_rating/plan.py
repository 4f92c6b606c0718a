"""Who rates which clips in what order: everyone every clip, in blocks as declared."""

import random
from typing import TYPE_CHECKING

from experiments.assignment.order import single_clips
from experiments.assignment.trial import Trial
from experiments.design import BlockSpec
from experiments.trials.clip_rating.declaration import clip_rating_of

if TYPE_CHECKING:
    from experiments.definition import Experiment


def assign(experiment: "Experiment", seed: int, slot: int) -> list[Trial]:
    """The trials of one participant in order, see `single_clips`; a check asks for any point of the scale."""
    scale = clip_rating_of(experiment).scale

    def asked(rng: random.Random) -> int:
        return rng.randint(scale.minimum, scale.maximum)

    return single_clips(experiment, seed, slot, asked)


def block_size(experiment: "Experiment", block: BlockSpec) -> int:
    """One trial a clip."""
    del experiment
    return len(block.clips)
