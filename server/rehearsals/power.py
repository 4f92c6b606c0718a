"""The power of a declared plan: which `analysis plan` a declaration asks for, and what has to be assumed."""

from typing import NamedTuple

from experiments import design
from experiments.definition import Experiment
from experiments.errors import InputError
from experiments.trials.paired_comparison.declaration import PairedComparison
from experiments.trials.threshold.declaration import Threshold, YesNo

MEDIUM_F = 0.25
"""Cohen's f that is called medium."""
STEP = 0.3
"""Log odds between neighbouring items: the better one wins 57 of 100."""
MAX_ITEMS = 12
SIMULATIONS = 200


class PlanCommand(NamedTuple):
    """Arguments behind `analysis`, and in words what they assume."""

    arguments: list[str]
    assumed: str


def plan_command(experiment: Experiment) -> PlanCommand:
    """How the power of this plan is reckoned; InputError where it cannot be."""
    trial = experiment.trial
    if isinstance(trial, PairedComparison):
        return _of_pairs(experiment)
    if isinstance(trial, Threshold):
        return _of_thresholds(experiment, trial)
    return _of_means(experiment)


def _of_means(experiment: Experiment) -> PlanCommand:
    factors = [factor for factor in experiment.factors if len(factor.levels) > 1 and not factor.random]
    if not factors:
        raise InputError("there is no factor whose levels are compared, so there is no power to reckon")
    arguments = ["plan", "anova"]
    for option, between in (("--within", False), ("--between", True)):
        named = [f"{one.name}:{len(one.levels)}" for one in factors if one.between is between]
        arguments += [option, ",".join(named)] if named else []
    for factor in factors:
        arguments += ["--effect", f"{factor.name}={MEDIUM_F}"]
    return PlanCommand(
        arguments,
        f"each factor by itself has a medium effect (Cohen's f = {MEDIUM_F}), two means of a participant "
        "correlate by 0.5",
    )


def _of_pairs(experiment: Experiment) -> PlanCommand:
    items = len(design.cells(experiment))
    if not 2 <= items <= MAX_ITEMS:
        raise InputError(f"power of pairs is reckoned for 2 to {MAX_ITEMS} items, and there are {items}")
    abilities = ",".join(f"{STEP * item:.1f}" for item in range(items))
    return PlanCommand(
        ["plan", "pairs", "--abilities", abilities],
        f"neighbouring items differ by {STEP} in log odds, each participant compares every pair once",
    )


def _of_thresholds(experiment: Experiment, trial: Threshold) -> PlanCommand:
    factor = next(one for one in experiment.factors if one.name == trial.stimulus.factor)
    levels = sorted(_numbers([level.name for level in factor.levels], trial.stimulus.values))
    if len(levels) < 3:
        raise InputError(f"power of thresholds takes three stimuli or more, and there are {len(levels)}")
    step = (levels[-1] - levels[0]) / (len(levels) - 1)
    middle = levels[len(levels) // 2]
    guess = trial.task.guess if isinstance(trial.task, YesNo) else 0.5
    arguments = ["plan", "thresholds", "--levels", ",".join(f"{level:g}" for level in levels)]
    arguments += ["--threshold", f"{middle:g}", "--difference", f"{step / 2:g}", "--spread", f"{step:g}"]
    arguments += ["--sd-people", f"{step / 2:g}", "--sd-difference", f"{step / 4:g}", "--guess", f"{guess:g}"]
    return PlanCommand(
        arguments,
        f"thresholds near {middle:g} that differ by {step / 2:g} between two conditions, a function as wide "
        f"as the step of {step:g} between stimuli, ten trials of each",
    )


def _numbers(names: list[str], values: dict[str, float]) -> list[float]:
    try:
        return [values[name] if name in values else float(name) for name in names]
    except ValueError as error:
        raise InputError("the stimuli have no numbers, so there is no power to reckon") from error
