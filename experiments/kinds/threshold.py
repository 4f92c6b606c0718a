"""Adaptive series: order of the series, page model, columns."""

import random
from collections.abc import Iterable
from typing import Literal

from experiments.assignment import Shown, Trial
from experiments.assignment.groups import groups, name_of, seat_of
from experiments.assignment.order import ordered_blocks, with_attention
from experiments.columns import base
from experiments.columns.base import rows_of
from experiments.columns.column import Column
from experiments.columns.playback import answer_columns
from experiments.columns.view import View
from experiments.declaration.base import Declaration, Translated
from experiments.declaration.experiment import Experiment
from experiments.declaration.threshold import (
    Series,
    Stop,
    Threshold,
    ThresholdAnswer,
    YesNo,
    check_response,
    threshold_of,
)
from experiments.declaration.trial import BlockSpec
from experiments.errors import InputError
from experiments.kinds.kind import Kind, PlanCommand
from experiments.kinds.threshold_grid import (
    clip_of,
    exemplar_at,
    fault,
    model,
    points,
    series_in_group,
    series_of,
    standard_beside,
    standard_doubt,
    standard_of,
    stimuli,
)
from experiments.schema.effects import Effect

# Exports of a threshold: the base columns, the stimulus, the answer and the estimate, one row per
# presentation. Aliases in addition to those of the base columns: q series_trials, w series_answers. The
# columns of the clip describe the stimulus; `interval` shows where the standard was.

SERIES: tuple[Column, ...] = (
    Column("series", "text", "Name of the adaptive series; empty in practice and checks.", source="q"),
    Column("position", "integer", "Position of the trial in its series, from 1.", minimum=1, source="q"),
    Column("value", "number", "Number of the stimulus: the number of its level.", source="w"),
    Column(
        "interval",
        "text",
        "Interval of the stimulus: the only clip, or the first or second of two.",
        values=("shown", "first", "second"),
        source="q.role",
    ),
)

ANSWER: tuple[Column, ...] = (
    Column(
        "response",
        "text",
        "The answer: yes or no, or which of two clips.",
        values=("yes", "no", "first", "second"),
        source="t.payload",
        member="chosen",
    ),
    Column(
        "correct",
        "boolean",
        "The answer as used in analyses: 1 if it was yes, or chose the stimulus; empty if it does not count.",
        source="w",
    ),
    Column(
        "expected_response",
        "integer",
        "The required answer in an attention check (1 or 2), or the correct answer in a motion check.",
        source="a",
    ),
)

ESTIMATE: tuple[Column, ...] = (
    Column(
        "counts",
        "boolean",
        "True if the answer changed the estimate: given in a main trial whose presentation did not fail.",
        source="w",
    ),
    Column(
        "known",
        "integer",
        "Number of answers of the series used to choose this stimulus.",
        minimum=0,
        source="w",
    ),
    Column(
        "ahead",
        "integer",
        "Number of earlier answers of the series not used for this choice. It is above 0 if the page went "
        "ahead of the server, as it does offline.",
        minimum=0,
        source="w",
    ),
    Column("threshold", "number", "Mean of the threshold's posterior after this answer.", source="w"),
    Column(
        "threshold_sd",
        "number",
        "Standard deviation of the threshold's posterior after this answer.",
        minimum=0,
        source="w",
    ),
    Column(
        "spread",
        "number",
        "Mean of the posterior of the SD (normal) or slope (Weibull) of the function after this answer.",
        minimum=0,
        source="w",
    ),
    Column(
        "entropy",
        "number",
        "Entropy of the posterior over all parameters after this answer.",
        unit="bit",
        minimum=0,
        source="w",
    ),
)

_TABLES = """\
LEFT JOIN series_trials q ON q.study_run_id = t.study_run_id AND q.trial_index = t.trial_index
LEFT JOIN series_answers w ON w.study_run_id = t.study_run_id AND w.trial_index = t.trial_index
    AND w.play = t.play
LEFT JOIN version_clips c ON c.id = w.version_clip_id
"""

THRESHOLDS = View(
    name="thresholds",
    title="Thresholds: one row per presentation in a trial",
    columns=answer_columns((*SERIES, *base.CLIP), (*ANSWER, *ESTIMATE)),
    rows=rows_of("threshold", {}, _TABLES),
)


# What the participant's page receives about a threshold.


class ShownAnswer(Declaration):
    """One of the two answers: its name in the data and its label."""

    response: Literal["yes", "no", "first", "second"]
    label: Translated


class ShownThreshold(Declaration):
    """The declared threshold as the page receives it, without stimuli, series or function."""

    kind: Literal["threshold"]
    question: Translated
    answers: tuple[ShownAnswer, ShownAnswer]
    gap_ms: int
    ahead: int
    pointer_delay_ms: int
    expected_seconds: float


def shown(experiment: Experiment) -> ShownThreshold:
    """Return the part of the declared trial that its page needs."""
    trial = threshold_of(experiment)
    task = trial.task
    if isinstance(task, YesNo):
        answers = (ShownAnswer(response="yes", label=task.yes), ShownAnswer(response="no", label=task.no))
    else:
        answers = (
            ShownAnswer(response="first", label=task.first),
            ShownAnswer(response="second", label=task.second),
        )
    return ShownThreshold(
        kind=trial.kind,
        question=trial.question,
        answers=answers,
        gap_ms=0 if isinstance(task, YesNo) else task.gap_ms,
        ahead=trial.ahead,
        pointer_delay_ms=trial.pointer_delay_ms,
        expected_seconds=trial.expected_seconds,
    )


# Order of the series, and the placeholder stimuli until the server has chosen.


def assign(experiment: Experiment, seed: int, slot: int) -> list[Trial]:
    """The trials of one participant in order, as many of each series as it may have.

    Series take turns in rounds, in an order drawn for each. The stimuli are a plan without answers (levels
    spread evenly over the grid); the server puts its choices in their place, the first before the run begins.

    Parameters
    ----------
    seed : int
        Of practice, order of series and intervals.
    slot : int
        Place in the counterbalancing, for the group of participants and the blocks.
    """
    rng, seat = random.Random(seed), seat_of(experiment, slot)
    mine, levels = list(series_in_group(experiment, seat.levels)), list(points(experiment).values())
    trials = [_practice(experiment, mine, rng) for _ in range(experiment.practice.trials)]
    done = dict.fromkeys((one.name for one in mine), 0)
    for number, block in enumerate(ordered_blocks(experiment, rng, seat.number), start=1):
        main: list[Trial] = []
        here = _series_in(experiment, block, mine)
        for _ in range(_trials_a_block(experiment)):
            if experiment.blocks.trial_order == "random":
                rng.shuffle(here)
            for one in here:
                position = done[one.name]
                done[one.name] += 1
                shown = _shown(
                    experiment, one, _spread(levels, position), exemplar_at(experiment, position + 1), rng
                )
                main.append(Trial("main", number, block.label, shown, series=one.name))
        if main:
            trials.extend(with_attention(experiment, main, rng, lambda draw: draw.randint(1, 2)))
    return trials


def _practice(experiment: Experiment, mine: list[Series], rng: random.Random) -> Trial:
    """A stimulus drawn from the whole grid, so that plain and faint ones are met before they count."""
    one = rng.choice(mine)
    level = rng.choice(list(points(experiment).values()))
    exemplar = rng.randint(1, experiment.exemplars.per_cell)
    return Trial("practice", 0, "practice", _shown(experiment, one, level, exemplar, rng))


def _shown(
    experiment: Experiment, one: Series, stimulus: dict[str, str], exemplar: int, rng: random.Random
) -> tuple[Shown, ...]:
    trial = threshold_of(experiment)
    standard = standard_beside(trial, stimulus)
    levels = [stimulus] if standard is None else [stimulus, standard]
    if rng.random() < 0.5:
        levels.reverse()
    clips = [clip_of(experiment, one.levels, name, exemplar) for name in levels]
    return tuple(Shown(role, clip) for role, clip in zip(trial.roles, clips, strict=True))


def _spread(levels: list[dict[str, str]], position: int) -> dict[str, str]:
    """The stimuli in van der Corput's order of base 2: any run of places covers the grid evenly."""
    share, weight = 0.0, 0.5
    number = position + 1
    while number:
        share += weight * (number & 1)
        number >>= 1
        weight /= 2
    return levels[int(share * len(levels))]


def _series_in(experiment: Experiment, block: BlockSpec, every: Iterable[Series]) -> list[Series]:
    split = experiment.blocks.split_by
    return [one for one in every if split is None or one.levels[split] == block.label]


def _trials_a_block(experiment: Experiment) -> int:
    """Trials of one series in one block: all of them, divided over the repeated blocks."""
    return (threshold_of(experiment).stop.trials or 0) // experiment.blocks.repeats


def block_size(experiment: Experiment, block: BlockSpec) -> int:
    """Maximum number of trials of a participant in a block: those of every series in it, in the largest
    group."""
    each = (series_in_group(experiment, levels) for levels in groups(experiment))
    return max(len(_series_in(experiment, block, mine)) for mine in each) * _trials_a_block(experiment)


def plan(experiment: Experiment) -> tuple[str, ...]:
    """Series, stimuli, what is looked for and when it ends, in words."""
    trial, assumed, every = threshold_of(experiment), model(experiment), series_of(experiment)
    standard = standard_of(trial)
    task = f"against the standard {standard}" if standard else "yes or no"
    named = ", ".join(f"{one.name} ({'/'.join(one.levels.values()) or 'all'})" for one in every)
    numbers, across = assumed.stimuli, assumed.seconds
    grid = f"{trial.stimulus.factor}: {len(numbers)} stimuli from {numbers[0]:g} to {numbers[-1]:g}"
    if trial.stimulus.second:
        grid += (
            f", times {len(across)} of {trial.stimulus.second.factor} from {across[0]:g} to {across[-1]:g}, "
            f"tilts from {assumed.tilts[0]:g} to {assumed.tilts[-1]:g}"
        )
    between = [(name_of(levels), series_in_group(experiment, levels)) for levels in groups(experiment)]
    length = _length(trial.stop, max(len(mine) for _, mine in between))
    return (
        f"{len(every)} adaptive series, interleaved: {named}",
        *(
            f"group {name}: {', '.join(one.name for one in mine)}"
            for name, mine in between
            if len(between) > 1
        ),
        f"each moves along {grid}, {task}",
        f"thresholds from {assumed.thresholds[0]:g} to {assumed.thresholds[-1]:g} are considered; guess "
        f"{assumed.guess:g}, lapse {assumed.lapse:g}",
        f"{length}; up to {trial.ahead} trials of a series offline",
    )


def _length(stop: Stop, series: int) -> str:
    longest = stop.trials or 0
    rules = [f"SD {stop.sd:g}"] if stop.sd is not None else []
    rules += [f"entropy {stop.entropy:g} bit"] if stop.entropy is not None else []
    if not rules:
        return f"{longest} trials per series, {longest * series} per participant"
    shortest = min(stop.at_least, longest)
    return (
        f"{shortest} to {longest} trials per series, {shortest * series} to {longest * series} per "
        f"participant: a series ends at {' and '.join(rules)}"
    )


# Adaptive series over a rendered grid: where along a factor does the answer change?

EFFECTS: dict[str, Effect] = {
    "kind": "measured",
    "question": "measured",
    "task": "measured",
    "stimulus": "measured",
    "series": "measured",
    "function": "measured",
    "direction": "measured",
    "lapse": "measured",
    "thresholds": "measured",
    "spreads": "measured",
    "tilts": "measured",
    "stop": "measured",
    "ahead": "measured",
    "pointer_delay_ms": "wording",
    "expected_seconds": "wording",
}

EXAMPLE = """\
[trial]
kind = "threshold"
question = { en = "Did the lower lid move?", de = "Hat sich das Unterlid bewegt?" }
stimulus = { factor = "lower_lid", values = { none = 0, horizontal = 1, vertical = 2, both = 3 } }
series = [{ name = "first_run" }, { name = "second_run" }]
function = "normal"
direction = "rising"
lapse = 0.02
thresholds = { lowest = -0.5, highest = 3.5, steps = 33 }
spreads = { lowest = 0.25, highest = 2.0, steps = 8 }
stop = { trials = 30, at_least = 12, sd = 0.25, entropy = 4.0 }
ahead = 3
pointer_delay_ms = 1500
expected_seconds = 5.0

[trial.task]
asks = "yes_no"
yes = { en = "Yes", de = "Ja" }
no = { en = "No", de = "Nein" }
guess = 0.02
"""

FURTHER_EXAMPLES = (
    """\
[trial]
kind = "threshold"
question = { en = "In which blink did the lower lid move more?" }
stimulus = { factor = "lower_lid", values = { horizontal = 1, vertical = 2, both = 3 } }
series = [{ name = "lid", levels = { character = "cartoon" } }]
function = "weibull"
stop = { trials = 40 }

[trial.task]
asks = "two_interval"
standard = "none"
first = { en = "The first" }
second = { en = "The second" }
gap_ms = 500
""",
    """\
[trial]
kind = "threshold"
question = { en = "Which blink was slower?" }
tilts = { lowest = -1.0, highest = 1.0, steps = 9 }
stop = { trials = 40 }

[trial.stimulus]
factor = "duration"
second = { factor = "lower_lid", values = { none = 0, horizontal = 1, both = 2 } }

[trial.task]
asks = "two_interval"
standard = "100"
standard_second = "none"
first = { en = "The first" }
second = { en = "The second" }
""",
)


def power_of_thresholds(experiment: Experiment) -> PlanCommand:
    """Power of a difference between the thresholds of two conditions."""
    trial = threshold_of(experiment)
    conditions = [
        one for one in experiment.factors if one.name not in trial.stimulus.factors and not one.random
    ]
    if all(len(one.levels) < 2 for one in conditions):
        raise InputError(
            "power cannot be computed: the stimulus is the only factor, so there are no conditions to compare"
        )
    if any(one.between and len(one.levels) > 1 for one in conditions):
        raise InputError("power of thresholds can be computed only if each participant sees all conditions")
    if len(series_of(experiment)) < 2:
        raise InputError(
            "power cannot be computed: there is only one series, so there are no two thresholds to compare"
        )
    numbers = sorted(stimuli(experiment))
    if len(numbers) < 3:
        raise InputError(f"power of thresholds needs at least three stimuli, got {len(numbers)}")
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
        f"as if each stimulus came {times} times: a series that searches for the threshold is more "
        f"informative",
    )


THRESHOLD = Kind(
    declaration=Threshold,
    answer=ThresholdAnswer,
    view=THRESHOLDS,
    roles=("shown",),
    effects=EFFECTS,
    page=ShownThreshold,
    shown=shown,
    assign=assign,
    block_size=block_size,
    example=EXAMPLE,
    further_examples=FURTHER_EXAMPLES,
    plan=plan,
    fault=fault,
    doubt=standard_doubt,
    power=power_of_thresholds,
    check_response=check_response,
    adapts=True,
    groups=True,
)
