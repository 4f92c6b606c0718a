"""The scales that a trial of any kind asks for, as Results, reports and the analysis read them."""

from typing import TYPE_CHECKING

from experiments.errors import InputError, did_you_mean
from experiments.trials.declared import RatedScale

if TYPE_CHECKING:
    from experiments.definition import Experiment


def scales_of(experiment: "Experiment") -> tuple[RatedScale, ...]:
    """The scales of the experiment's trials in order; none for kinds that are not rated on scales."""
    return experiment.trial.rated_scales()


def scale_called(experiment: "Experiment", name: str | None = None) -> RatedScale:
    """The scale of this name, the first where none is given; InputError where there is none."""
    scales = scales_of(experiment)
    if not scales:
        raise InputError(
            f"this needs trials with a scale, '{experiment.name}' has trials of the kind "
            f"{experiment.trial.kind}"
        )
    names = [scale.name for scale in scales]
    if name is not None and name not in names:
        raise InputError(f"'{experiment.name}' has no scale '{name}'{did_you_mean(name, names)}")
    return scales[names.index(name) if name is not None else 0]
