"""From a declared experiment to its cells, clips and blocks: pure functions, no randomness."""

from itertools import product

from experiments.declaration.experiment import Experiment
from experiments.declaration.rendering import RenderSettings
from experiments.declaration.trial import BlockSpec, ClipSpec


def cells(experiment: Experiment) -> list[tuple[tuple[str, str], ...]]:
    """Every combination of levels, last factor fastest."""
    names = [[(factor.name, level.name) for level in factor.levels] for factor in experiment.factors]
    return [tuple(combination) for combination in product(*names)]


def clips(experiment: Experiment) -> list[ClipSpec]:
    """Every unique clip: cells times exemplars."""
    numbers = range(1, experiment.exemplars.per_cell + 1)
    return [ClipSpec(cell, number) for cell in cells(experiment) for number in numbers]


def rated_clips(experiment: Experiment) -> list[ClipSpec]:
    """The clips that trials ask about; references are only shown with them."""
    return [clip for clip in clips(experiment) if experiment.trial.rates(experiment, clip)]


def rated_levels(experiment: Experiment, factor: str) -> list[str]:
    """The declared levels of a factor, in order, except those only shown as references."""
    rated = {clip.level(factor) for clip in rated_clips(experiment)}
    return [level.name for level in experiment.factor(factor).levels if level.name in rated]


def blocks(experiment: Experiment) -> list[BlockSpec]:
    """Blocks in declared order, including repeats; the server determines each participant's order."""
    every = clips(experiment)
    split = experiment.blocks.split_by
    if split is None:
        single = [BlockSpec("all", tuple(every))]
    else:
        levels = [level.name for level in experiment.factor(split).levels]
        single = [BlockSpec(level, tuple(c for c in every if c.level(split) == level)) for level in levels]
    return single * experiment.blocks.repeats


def render_settings(experiment: Experiment, spec: ClipSpec) -> RenderSettings:
    """The experiment's render settings with the overrides of this clip's levels, in factor order."""
    settings = experiment.render
    for factor_name, level_name in spec.levels:
        level = next(lv for lv in experiment.factor(factor_name).levels if lv.name == level_name)
        settings = level.render.applied_to(settings)
    return settings


def exemplar_key(experiment: Experiment, spec: ClipSpec) -> str:
    """Key of the blink that a clip shows: clips with the same key show the same blink (see `Exemplars`)."""
    own = [level for factor, level in spec.levels if factor in experiment.exemplars.own_per]
    return "/".join([*own, f"{spec.exemplar:03d}"])
