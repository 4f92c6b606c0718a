"""What in declared ratings of single clips does not fit the rest of the experiment."""

from experiments import design
from experiments.definition import Experiment
from experiments.definition.factors import Factor
from experiments.errors import did_you_mean
from experiments.trials.clip_rating.declaration import MAX_FRAMES_LOGGED, clip_rating_of
from experiments.trials.clip_rating.reference import RatingReference


def fault(experiment: Experiment) -> str | None:
    """More views of a long performance than a trial may log; a reference that does not fit."""
    trial = clip_rating_of(experiment)
    levels = [level.render for factor in experiment.factors for level in factor.levels]
    settings = [experiment.render, *(level.applied_to(experiment.render) for level in levels)]
    if trial.reference and any(one.performance for one in settings):
        return "trial.reference: performances have no reference; leave it out, or show single blinks"
    if trial.reference and (wrong := fault_of_reference(trial.reference, experiment)):
        return wrong
    longest = max((round(one.seconds * one.fps) for one in settings if one.performance), default=0)
    if longest * trial.views <= MAX_FRAMES_LOGGED:
        return None
    return (
        f"trial.views: {trial.views} views of {longest} frames are more than the {MAX_FRAMES_LOGGED} that "
        "a trial may log; show shorter clips, fewer frames a second or fewer views"
    )


def fault_of_reference(reference: RatingReference, experiment: Experiment) -> str | None:
    """What here does not fit the design, as `path: what to do`; None where all is well."""
    return (
        _fault_of_clip(reference, experiment)
        or _fault_of_difference(reference, experiment)
        or (None if reference.rate_itself else _fault_of_rest(reference, experiment))
    )


def _fault_of_clip(reference: RatingReference, experiment: Experiment) -> str | None:
    if reference.factor is None:
        cells = ["/".join(level for _, level in cell) for cell in design.cells(experiment)]
        if reference.cell not in cells:
            return (
                f"trial.reference.cell: the design has no cell '{reference.cell}'"
                f"{did_you_mean(str(reference.cell), cells)}"
            )
        return None
    if reference.factor not in experiment.factor_names:
        nearest = did_you_mean(reference.factor, experiment.factor_names)
        return f"trial.reference.factor: no factor is called '{reference.factor}'{nearest}"
    factor = experiment.factor(reference.factor)
    names = [level.name for level in factor.levels]
    if reference.level not in names:
        return (
            f"trial.reference.level: '{reference.factor}' has no level '{reference.level}'"
            f"{did_you_mean(str(reference.level), names)}"
        )
    return _fault_of_factor(factor)


def _fault_of_factor(factor: Factor) -> str | None:
    if factor.between or factor.dealt:
        return (
            f"trial.reference.factor: participants see some levels of '{factor.name}' only; name a "
            "factor of which everybody sees all"
        )
    return None


def _differing(reference: RatingReference, experiment: Experiment) -> list[str]:
    """The factors in whose levels a reference can differ from its clip, in declared order."""
    return [
        factor.name
        for factor in experiment.factors
        if len(factor.levels) > 1
        and (factor.name == reference.factor if reference.cell is None else not factor.between)
    ]


def _fault_of_difference(reference: RatingReference, experiment: Experiment) -> str | None:
    """A reference is another clip than some, and shows the blink of each."""
    differing = _differing(reference, experiment)
    if not differing:
        return (
            "trial.reference: every clip would be its own reference; name a factor of which each "
            "participant sees two levels or more"
        )
    own = next((name for name in differing if name in experiment.exemplars.own_per), None)
    if own is not None:
        return (
            f"exemplars.own_per: a reference shows the blink of its clip, but the levels of '{own}', in "
            f"which the two differ, have blinks of their own; leave '{own}' out of own_per"
        )
    return None


def _fault_of_rest(reference: RatingReference, experiment: Experiment) -> str | None:
    """Without the reference's own trials the rated cells must still be a crossed design."""
    hidden = "or set rate_itself = true"
    split = experiment.blocks.split_by
    if reference.factor is None and len(experiment.factors) > 1:
        return (
            f"trial.reference.cell: without ratings of '{reference.cell}' the rated cells are not crossed; "
            f"name factor and level, {hidden}"
        )
    name = reference.factor or experiment.factor_names[0]
    if split == name:
        return (
            f"blocks.split_by: the reference's level of '{name}' would be an empty block; "
            f"split by another factor, {hidden}"
        )
    if len(experiment.factor(name).levels) < 3:
        return (
            f"trial.reference: '{name}' needs two levels beside the reference's to compare; "
            f"add a level, {hidden}"
        )
    return None
