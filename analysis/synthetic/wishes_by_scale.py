"""Wishes for one scale of several: `eeriness/character=9`; without a name a wish holds for every scale."""

from collections.abc import Sequence

from analysis.synthetic.published import PrintedMean
from experiments.definition import Experiment
from experiments.errors import InputError, did_you_mean
from experiments.trials.scales import RatedScale, scales_of


def wishes_for(experiment: Experiment, scale: RatedScale, wishes: Sequence[str]) -> list[str]:
    """The wishes that hold for a scale, without its name before them.

    Raises
    ------
    InputError
        A wish for a scale that the study does not have.
    """
    names = [known.name for known in scales_of(experiment)]
    held = []
    for wish in wishes:
        name, slash, rest = wish.partition("/")
        if slash and name not in names:
            raise InputError(f"'{experiment.name}' has no scale '{name}'{did_you_mean(name, names)}")
        if not slash or name == scale.name:
            held.append(rest if slash else wish)
    return held


def refuse_off_scale(means: Sequence[PrintedMean], experiment: Experiment, scale: RatedScale) -> None:
    """InputError for the first mean that ratings on this scale cannot have."""
    for mean in means:
        if not scale.minimum <= float(mean.printed) <= scale.maximum:
            several = len(scales_of(experiment)) > 1
            hint = "; name the scale that it is of, as SCALE/factor.level=..." if several else ""
            raise InputError(
                f"expected means from {scale.minimum:g} to {scale.maximum:g} on the scale '{scale.name}', "
                f"got {mean.printed}{hint}"
            )
