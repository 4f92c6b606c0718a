"""Adaptive series as declared: faults in one line, turns, stimuli, blocks, and what `stimuli plan` says."""

import re
from collections import Counter

import pytest

from experiments import design
from experiments.declaration.experiment import Experiment
from experiments.kinds import block_sizes
from experiments.kinds.threshold import THRESHOLD
from experiments.kinds.threshold_grid import Point, model, points, seconds, series_of, stimuli
from experiments.load import DefinitionError, parse_experiment
from tests.experiments.trials.test_kinds import text_with
from tests.helpers.thresholds import TWO_INTERVAL

FACTORS = """
[[factors]]
name = "duration"
label = "Duration"
levels = [
    { name = "100", label = "100 ms", render = { duration_frames = 3.0 } },
    { name = "400", label = "400 ms", render = { duration_frames = 12.0 } },
    { name = "200", label = "200 ms", render = { duration_frames = 6.0 } },
    { name = "300", label = "300 ms", render = { duration_frames = 9.0 } },
]

[[factors]]
name = "asymmetry"
label = "Asymmetry"
levels = [{ name = "SL", label = "Symmetric" }, { name = "AL", label = "Asymmetric" }]
"""
YES_NO = """
[trial]
kind = "threshold"
question = { en = "Slow?" , de = "Langsam?" }
stimulus = { factor = "duration" }
task = { asks = "yes_no", yes = { en = "Yes", de = "Ja" }, no = { en = "No", de = "Nein" } }
stop = { trials = 12, at_least = 8, sd = 20.0 }
"""
TWO = TWO_INTERVAL.replace("trials = 6", "trials = 12")


def text_of(trial: str = YES_NO) -> str:
    text = text_with(trial)
    text = re.sub(r"(?s)\n\[\[factors\]\].*?(?=\n\[exemplars\])", lambda _: FACTORS, text)
    return re.sub(r"(?s)\n\[analysis\].*?(?=\n\[|\Z)", "\n", text)


def declared(trial: str = YES_NO) -> Experiment:
    return parse_experiment(text_of(trial))


def test_stimuli_are_in_the_order_of_their_numbers_and_the_standard_is_none() -> None:
    assert stimuli(declared()) == {100.0: "100", 200.0: "200", 300.0: "300", 400.0: "400"}
    assert list(stimuli(declared(TWO))) == [200.0, 300.0, 400.0]


def test_what_is_left_out_of_the_function_follows_from_the_stimuli() -> None:
    assumed = model(declared())
    assert (assumed.thresholds[0], assumed.thresholds[-1], len(assumed.thresholds)) == (100, 400, 31)
    assert (assumed.spreads[0], assumed.spreads[-1]) == (15, 150)
    assert (assumed.guess, assumed.lapse, model(declared(TWO)).guess) == (0.02, 0.02, 0.5)


def test_series_are_the_other_factors_levels_where_none_are_declared() -> None:
    assert [one.levels for one in series_of(declared())] == [{"asymmetry": "SL"}, {"asymmetry": "AL"}]


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (
            'name = "400"',
            'name = "slow"',
            "expected a number for every level of 'duration', got the level 'slow'",
        ),
        ('name = "400"', 'name = "nan"', "got the level 'nan'"),
        ('name = "400"', 'name = "200.0"', "levels '200.0' and '200' have the same number 200"),
        (
            'factor = "duration"',
            'factor = "durations"',
            "no factor is called 'durations'; did you mean 'duration'",
        ),
        (
            'factor = "duration" }',
            'factor = "duration", values = { "99" = 1 } }',
            "'duration' has no level '99'",
        ),
        ("trials = 12, ", "", "trial.stop.trials is required"),
        ("at_least = 8", "at_least = 12", "sd and entropy never end one"),
        ("trials = 12", "trials = 13", "13 trials of a series cannot be divided into 2 blocks"),
        ("sd = 20.0", "sd = 0.0", "expected more than 0, got 0.0"),
        ("[trial]", "[trial]\nlapse = 0.4", "expected at most 0.2, got 0.4"),
        ('asks = "yes_no"', 'asks = "yes_no", guess = 0.95', "expected at most 0.9, got 0.95"),
        ('asks = "yes_no"', 'asks = "yes_no", guess = 0.9', "guess 0.9 and lapse 0.15 leave no range"),
        ("[trial]", '[trial]\nfunction = "weibull"\ndirection = "falling"', "got a falling function"),
        (
            "[trial]",
            "[trial]\nspreads = { lowest = 0, highest = 3 }",
            "trial.spreads.lowest: expected a number above",
        ),
        ("[trial]", "[trial]\nthresholds = { lowest = 5, highest = 3 }", "expected lowest below highest"),
        ("[trial]", '[trial]\nseries = [{ name = "a" }]', "expected a level of 'asymmetry', got none"),
        (
            "[trial]",
            '[trial]\nseries = [{ name = "a", levels = { asymetry = "SL" } }]',
            "no factor is called 'asymetry'; did you mean 'asymmetry'",
        ),
        ("[trial]", '[trial]\nseries = [{ name = "a", levels = { asymmetry = "S" } }]', "has no level 'S'"),
        (
            "[trial]",
            '[trial]\nseries = [{ name = "a", levels = { asymmetry = "SL", duration = "100" } }]',
            "is the stimulus factor of the series",
        ),
        (
            "[trial]",
            '[trial]\nseries = [{ name = "a", levels = { asymmetry = "SL" } },'
            ' { name = "a", levels = { asymmetry = "AL" } }]',
            "'a' is declared twice",
        ),
        ("repeats = 2", 'repeats = 2\nsplit_by = "duration"', "is the stimulus factor of each series"),
        ('yes = { en = "Yes", de = "Ja" }', 'yes = { en = "Yes" }', "task.yes has no text in 'de'"),
    ],
)
def test_what_does_not_fit_is_said_in_one_line(old: str, new: str, said: str) -> None:
    text = text_of(YES_NO + ("lapse = 0.15\n" if "0.9 and" in said else ""))
    assert old in text
    with pytest.raises(DefinitionError) as raised:
        parse_experiment(text.replace(old, new, 1))
    assert said in str(raised.value)
    assert "\n" not in raised.value.problems[0].message


def test_an_unknown_standard_is_named() -> None:
    with pytest.raises(DefinitionError, match="'duration' has no level '101'; did you mean '100'"):
        declared(TWO.replace('standard = "100"', 'standard = "101"'))


@pytest.mark.parametrize("seed", range(5))
def test_series_take_turns_and_have_all_their_trials(seed: int) -> None:
    main = [trial for trial in THRESHOLD.assign(declared(), seed, 0) if trial.kind == "main"]
    assert Counter(trial.series for trial in main) == {"s1": 12, "s2": 12}
    for turn in range(0, len(main), 2):
        assert {trial.series for trial in main[turn : turn + 2]} == {"s1", "s2"}
    for trial in main:
        level = {"s1": "SL", "s2": "AL"}[trial.series]
        assert [shown.clip.level("asymmetry") for shown in trial.shown] == [level]


def test_the_plan_without_answers_covers_the_grid() -> None:
    main = [trial for trial in THRESHOLD.assign(declared(), 1, 0) if trial.series == "s1"]
    shown = Counter(trial.shown[0].clip.level("duration") for trial in main)
    assert set(shown) == {"100", "200", "300", "400"}
    assert max(shown.values()) - min(shown.values()) <= 1


@pytest.mark.parametrize(
    ("standard", "direction", "said"),
    [
        ("100", "rising", None),
        ("400", "falling", None),
        ("300", "rising", "expected a standard below all stimuli, got 300 with the stimuli 100, 200;"),
        ("300", "falling", "expected a standard above all stimuli, got 300 with the stimulus 400;"),
        ("400", "rising", "got 400 with the stimuli 100, 200, 300; a rising function"),
    ],
)
def test_a_standard_between_the_stimuli_is_doubted(standard: str, direction: str, said: str | None) -> None:
    """Fewer than half choose a stimulus below the standard, and no function from one half up has that."""
    text = TWO.replace('standard = "100"', f'standard = "{standard}"')
    doubt = THRESHOLD.doubt(declared(text.replace("stop =", f'direction = "{direction}"\nstop =', 1)))
    assert doubt is None if said is None else doubt is not None and said in doubt


def test_two_intervals_hold_the_standard_in_either_order_and_the_same_exemplar() -> None:
    main = [trial for seed in range(4) for trial in THRESHOLD.assign(declared(TWO), seed, 0) if trial.series]
    firsts = Counter(trial.shown[0].clip.level("duration") == "100" for trial in main)
    assert min(firsts.values()) > len(main) / 4
    for trial in main:
        one, other = trial.shown
        assert (one.role, other.role) == ("first", "second")
        assert {one.clip.level("duration"), other.clip.level("duration")} - {"200", "300", "400"} == {"100"}
        assert one.clip.exemplar == other.clip.exemplar


def test_a_block_a_level_holds_the_series_of_that_level() -> None:
    experiment = parse_experiment(text_of().replace("repeats = 2", 'repeats = 2\nsplit_by = "asymmetry"'))
    assert [(block.label, block.trials) for block in block_sizes(experiment)] == [("SL", 6), ("AL", 6)] * 2
    for trial in THRESHOLD.assign(experiment, 3, 0):
        if trial.kind == "main":
            assert trial.block_label == {"s1": "SL", "s2": "AL"}[trial.series]


def test_the_plan_shows_series_stimuli_and_length() -> None:
    told = "\n".join(THRESHOLD.plan(declared()))
    assert "2 adaptive series, interleaved: s1 (SL), s2 (AL)" in told
    assert "4 stimuli from 100 to 400" in told
    assert "8 to 12 trials per series, 16 to 24 per participant: a series ends at SD 20" in told
    assert "against the standard 100" in "\n".join(THRESHOLD.plan(declared(TWO)))


def test_clips_are_an_ordinary_grid_of_cells() -> None:
    assert len(design.cells(declared())) == 8


GRID = YES_NO.replace(
    'stimulus = { factor = "duration" }',
    'stimulus = { factor = "duration", second = { factor = "asymmetry", values = { SL = 0, AL = 1 } } }',
)
GRID_OF_TWO = TWO.replace(
    'stimulus = { factor = "duration" }',
    'stimulus = { factor = "duration", second = { factor = "asymmetry", values = { SL = 0, AL = 1 } } }',
)
BETWEEN = 'levels = [{ name = "SL"'


def on_a_grid(trial: str = GRID) -> Experiment:
    return parse_experiment(
        text_of(trial).replace('split_by = "character"', "").replace("repeats = 2", "repeats = 1")
    )


def test_a_second_factor_makes_one_series_over_the_grid_of_both() -> None:
    experiment = on_a_grid()
    assert seconds(experiment) == {0.0: "SL", 1.0: "AL"}
    assert len(points(experiment)) == 8
    assert points(experiment)[Point(400.0, 1.0)] == {"duration": "400", "asymmetry": "AL"}
    assert [one.levels for one in series_of(experiment)] == [{}]
    assumed = model(experiment)
    assert (assumed.middle, assumed.tilts[0], assumed.tilts[-1], len(assumed.tilts)) == (0.5, -300, 300, 11)
    shown = {
        trial.shown[0].clip.levels for trial in THRESHOLD.assign(experiment, 1, 0) if trial.kind == "main"
    }
    assert len(shown) == 8
    assert "times 2 of asymmetry from 0 to 1, tilts from -300 to 300" in " ".join(THRESHOLD.plan(experiment))


def test_the_standard_has_the_stimulus_second_level_or_the_declared_one() -> None:
    for task, fixed in (
        (GRID_OF_TWO, False),
        (GRID_OF_TWO.replace('standard = "100"', 'standard = "100"\nstandard_second = "SL"'), True),
    ):
        seen = set()
        for trial in THRESHOLD.assign(on_a_grid(task), 2, 0):
            if trial.kind == "main":
                by = {
                    shown.clip.level("duration") == "100": shown.clip.level("asymmetry")
                    for shown in trial.shown
                }
                seen.add((by[False], by[True]))
        assert seen == ({("SL", "SL"), ("AL", "SL")} if fixed else {("SL", "SL"), ("AL", "AL")})


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (
            'second = { factor = "asymmetry"',
            'second = { factor = "asymetry"',
            "trial.stimulus.second.factor: no factor is called 'asymetry'; did you mean 'asymmetry'",
        ),
        (
            'second = { factor = "asymmetry"',
            'second = { factor = "duration"',
            "'duration' is already the first factor",
        ),
        (
            ", values = { SL = 0, AL = 1 }",
            "",
            "trial.stimulus.second: expected a number for every level of 'asymmetry', got the level 'SL'",
        ),
        ("AL = 1", "AL = 0", "levels 'SL' and 'AL' have the same number 0"),
        ("AL = 1", "AX = 1", "'asymmetry' has no level 'AX'"),
        ("[trial]", '[trial]\nfunction = "weibull"', "expected normal with a second factor"),
        (
            "[trial]",
            "[trial]\nthresholds = { lowest = 1, highest = 2, steps = 101 }\n"
            "spreads = { lowest = 1, highest = 2, steps = 101 }",
            "expected at most 500000",
        ),
        (
            "[trial]",
            '[trial]\nseries = [{ name = "a", levels = { asymmetry = "SL" } }]',
            "'asymmetry' is the stimulus factor of the series",
        ),
    ],
)
def test_faults_of_a_second_factor_are_named(old: str, new: str, said: str) -> None:
    with pytest.raises(DefinitionError, match=re.escape(said)):
        on_a_grid(GRID.replace(old, new, 1))


@pytest.mark.parametrize(
    ("trial", "said"),
    [
        (
            YES_NO + "[trial.tilts]\nlowest = 0.0\nhighest = 1.0\n",
            "trial.tilts: add trial.stimulus.second",
        ),
        (TWO + 'standard_second = "SL"\n', "trial.task.standard_second: add trial.stimulus.second"),
    ],
)
def test_what_needs_a_second_factor_is_refused_without(trial: str, said: str) -> None:
    with pytest.raises(DefinitionError, match=re.escape(said)):
        declared(trial)


def between(trial: str = YES_NO) -> Experiment:
    text = text_of(trial).replace('label = "Asymmetry"', 'label = "Asymmetry"\nbetween = true')
    return parse_experiment(text)


def test_with_a_factor_between_participants_each_runs_the_series_of_their_group() -> None:
    experiment = between()
    for slot in range(4):
        trials = [trial for trial in THRESHOLD.assign(experiment, 7, slot) if trial.shown]
        assert {trial.shown[0].clip.level("asymmetry") for trial in trials} == {["SL", "AL"][slot % 2]}
        assert {trial.series for trial in trials if trial.kind == "main"} == {["s1", "s2"][slot % 2]}
        assert sum(trial.kind == "main" for trial in trials) == 12
    assert sum(size.trials for size in block_sizes(experiment)) == 12
    plan = " ".join(THRESHOLD.plan(experiment))
    assert "group SL: s1 group AL: s2" in plan
    assert "8 to 12 per participant" in plan


def test_a_group_without_a_series_and_a_stimulus_between_people_are_refused() -> None:
    only = YES_NO.replace("[trial]", '[trial]\nseries = [{ name = "a", levels = { asymmetry = "SL" } }]')
    with pytest.raises(DefinitionError, match="the group 'AL' has no series"):
        between(only)
    text = text_of().replace('label = "Duration"', 'label = "Duration"\nbetween = true')
    with pytest.raises(
        DefinitionError, match="'duration' is between participants, but a series moves within one participant"
    ):
        parse_experiment(text)
