"""Who rates which clips in what order: everyone every clip, in blocks as declared."""

import random
from typing import TYPE_CHECKING

from experiments.assignment.groups import place_of
from experiments.assignment.order import single_clips
from experiments.assignment.shares import lines, share
from experiments.assignment.trial import Trial
from experiments.design import BlockSpec
from experiments.trials.clip_rating.declaration import clip_rating_of

if TYPE_CHECKING:
    from experiments.definition import Experiment


def assign(experiment: "Experiment", seed: int, slot: int) -> list[Trial]:
    """The trials of one participant in order, see `single_clips`; a check asks for any point of the scale."""
    scale = clip_rating_of(experiment).check_scale

    def asked(rng: random.Random) -> int:
        return rng.randint(scale.minimum, scale.maximum)

    return single_clips(experiment, seed, slot, asked)


def plan(experiment: "Experiment") -> tuple[str, ...]:
    """Groups, and how often each clip is seen."""
    return lines(experiment)


def block_size(experiment: "Experiment", block: BlockSpec) -> int:
    """One trial a clip of the participant's share, the largest where they differ."""
    laps = len(experiment.assignment.lists) or 1
    places = (place_of(experiment, slot) for slot in range(laps))
    return max(len(share(experiment, place).intersection(block.clips)) for place in places)
