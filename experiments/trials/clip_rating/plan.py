"""Who rates which clips in what order: everyone every clip, in blocks as declared."""

import random
from dataclasses import replace
from typing import TYPE_CHECKING

from experiments.assignment.groups import seat_of
from experiments.assignment.order import single_clips
from experiments.assignment.shares import lines, share
from experiments.assignment.trial import Shown, Trial
from experiments.trials.clip_rating.declaration import clip_rating_of
from experiments.trials.clip_rating.reference import RatingReference
from experiments.trials.declared import BlockSpec

if TYPE_CHECKING:
    from experiments.definition import Experiment


def assign(experiment: "Experiment", seed: int, slot: int) -> list[Trial]:
    """The trials of one participant in order, see `single_clips`; a check asks for any point of the scale."""
    scale = clip_rating_of(experiment).check_scale

    def asked(rng: random.Random) -> int:
        return rng.randint(scale.minimum, scale.maximum)

    trials = single_clips(experiment, seed, slot, asked)
    reference = clip_rating_of(experiment).reference
    return trials if reference is None else [_after(reference, experiment, trial) for trial in trials]


def check_choices(experiment: "Experiment") -> int:
    """The points of the scale on which attention checks ask."""
    scale = clip_rating_of(experiment).check_scale
    return scale.maximum - scale.minimum + 1


def _after(reference: RatingReference, experiment: "Experiment", trial: Trial) -> Trial:
    """The trial with its reference; checks have none."""
    if trial.clip is None or trial.check is not None:
        return trial
    return replace(trial, shown=(*trial.shown, Shown("reference", reference.of(experiment, trial.clip))))


def plan(experiment: "Experiment") -> tuple[str, ...]:
    """Groups, how often each clip is seen, and which clip comes before it."""
    reference = clip_rating_of(experiment).reference
    return lines(experiment) if reference is None else (*lines(experiment), reference.said())


def block_size(experiment: "Experiment", block: BlockSpec) -> int:
    """One trial a clip of the participant's share, the largest where they differ."""
    laps = len(experiment.assignment.lists) or 1
    seats = (seat_of(experiment, slot) for slot in range(laps))
    return max(len(share(experiment, seat).intersection(block.clips)) for seat in seats)
