"""The power of a declared plan: which `analysis plan` a declaration asks for, and what has to be assumed."""

from typing import NamedTuple

from experiments.definition import Experiment
from experiments.errors import InputError
from experiments.trials.paired_comparison.declaration import PairedComparison
from experiments.trials.paired_comparison.pairs import every_pair, item_of
from experiments.trials.paired_comparison.plan import assign, chooses
from experiments.trials.threshold.declaration import Threshold
from experiments.trials.threshold.grid import series_of, stimuli

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
    alone = all(factor.between for factor in factors)
    means = "each participant gives one mean" if alone else "two means of a participant correlate by 0.5"
    return PlanCommand(
        arguments, f"each factor by itself has a medium effect (Cohen's f = {MEDIUM_F}), {means}"
    )


def _of_pairs(experiment: Experiment) -> PlanCommand:
    if any(factor.between for factor in experiment.factors):
        raise InputError("groups of participants compare different items, so no one power holds for all")
    if chooses(experiment):
        raise InputError("pairs are chosen by the answers so far, so no power is reckoned before the data")
    pairs = every_pair(experiment)
    named = [(item_of(experiment, pair.left), item_of(experiment, pair.right)) for pair in pairs]
    items = len({item for both in named for item in both})
    if not 2 <= items <= MAX_ITEMS:
        raise InputError(f"power of pairs is reckoned for 2 to {MAX_ITEMS} items, and there are {items}")
    of_items = items * (items - 1) // 2
    if len({frozenset(both) for both in named}) < of_items:
        raise InputError("power of pairs is reckoned where every two items are compared; here some are not")
    shown = sum(trial.kind == "main" for trial in assign(experiment, seed=0, slot=0))
    if shown < of_items:
        raise InputError(
            f"power of pairs is reckoned where a participant compares every two items; here it is {shown} of "
            f"{of_items} pairs"
        )
    abilities = ",".join(f"{STEP * item:.1f}" for item in range(items))
    arguments = ["plan", "pairs", "--abilities", abilities]
    if (repeats := shown // of_items) > 1:
        arguments += ["--repeats", str(repeats)]
    often = {1: "once", 2: "twice"}.get(repeats, f"{repeats} times")
    return PlanCommand(
        arguments,
        f"neighbouring items differ by {STEP} in log odds, each participant compares every two items "
        f"{often}, all by the same abilities",
    )


def _of_thresholds(experiment: Experiment, trial: Threshold) -> PlanCommand:
    conditions = [
        one for one in experiment.factors if one.name not in trial.stimulus.factors and not one.random
    ]
    if all(len(one.levels) < 2 for one in conditions):
        raise InputError(
            "the stimulus is the only factor, so there are no conditions whose thresholds could differ"
        )
    if any(one.between and len(one.levels) > 1 for one in conditions):
        raise InputError("power of thresholds is reckoned for conditions that each participant sees all of")
    if len(series_of(experiment)) < 2:
        raise InputError(
            "there is one series, so there are no two thresholds to compare and no power to reckon"
        )
    numbers = sorted(stimuli(experiment))
    if len(numbers) < 3:
        raise InputError(f"power of thresholds takes three stimuli or more, and there are {len(numbers)}")
    step = (numbers[-1] - numbers[0]) / (len(numbers) - 1)
    middle = numbers[len(numbers) // 2]
    times = max(1, round((trial.stop.trials or 0) / len(numbers)))
    arguments = ["plan", "thresholds", "--levels", ",".join(f"{number:g}" for number in numbers)]
    arguments += ["--threshold", f"{middle:g}", "--difference", f"{step / 2:g}", "--spread", f"{step:g}"]
    arguments += ["--sd-people", f"{step / 2:g}", "--sd-difference", f"{step / 4:g}"]
    arguments += ["--guess", f"{trial.task.guess:g}", "--trials", str(times)]
    return PlanCommand(
        arguments,
        f"thresholds near {middle:g} that differ by {step / 2:g} between two conditions, a function as wide "
        f"as the step of {step:g} between stimuli, a series of {trial.stop.trials} trials in each condition, "
        f"as if each stimulus came {times} times: a series that looks for the threshold tells more",
    )
