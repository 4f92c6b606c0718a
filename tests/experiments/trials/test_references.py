"""The reference of degradation category rating: which clip it is, who rates it, and what does not fit."""

import re

import pytest

from experiments.declaration.experiment import Experiment
from experiments.declaration.trial import ClipSpec
from experiments.kinds import KINDS, trials_per_participant
from experiments.load import DefinitionError, parse_experiment
from tests.conftest import REPOSITORY

DEMO = (REPOSITORY / "experiments" / "dcr-demo.toml").read_text(encoding="utf-8")
RATING = KINDS["clip_rating"]
REFERENCE = 'factor = "lower_lid"\nlevel = "both"\n'


def changed(reference: str, text: str = DEMO) -> Experiment:
    assert REFERENCE in text
    return parse_experiment(text.replace(REFERENCE, reference))


@pytest.mark.parametrize("reference", [REFERENCE, 'cell = "both"\n'])
def test_the_reference_has_the_exemplar_of_the_rated_clip(reference: str) -> None:
    trials = [trial for trial in RATING.assign(changed(reference), 3, 0) if trial.kind == "main"]
    assert len(trials) == 6
    for trial in trials:
        rated, before = trial.shown
        assert (rated.role, before.role) == ("shown", "reference")
        assert before.clip == ClipSpec((("lower_lid", "both"),), rated.clip.exemplar)


def test_a_reference_that_is_not_rated_itself_is_left_out_everywhere() -> None:
    experiment = parse_experiment(DEMO.replace("rate_itself = true", "rate_itself = false"))
    trials = RATING.assign(experiment, 3, 0)
    assert {trial.clip.cell for trial in trials if trial.clip} == {"vertical", "none"}
    assert trials_per_participant(experiment) == 4
    assert "not rated itself" in RATING.plan(experiment)[-1]


SECOND = """
[[factors]]
name = "speed"
label = "S"
levels = [{ name = "a", label = "A" }, { name = "b", label = "B" }]
"""
BETWEEN = SECOND.replace('label = "S"', 'label = "S"\nbetween = true')


def with_factor(table: str) -> str:
    return DEMO.replace("[exemplars]", table + "\n[exemplars]")


def test_other_levels_are_those_of_the_rated_clip_or_of_the_group() -> None:
    for text, reference in ((with_factor(SECOND), REFERENCE), (with_factor(BETWEEN), 'cell = "both/a"\n')):
        for slot in (0, 1):
            for trial in RATING.assign(changed(reference, text), 3, slot):
                rated, before = (shown.clip for shown in trial.shown)
                assert before.level("lower_lid") == "both"
                assert before.level("speed") == rated.level("speed")


GROUPS = DEMO.replace('label = "Lower lid"', 'label = "Lower lid"\nbetween = true')
EXEMPLARS = "[exemplars]\n"
OWN_BLINKS = DEMO.replace(EXEMPLARS, EXEMPLARS + 'own_per = ["lower_lid"]\n')


def test_blinks_of_a_factor_in_which_the_two_do_not_differ_may_be_its_own() -> None:
    own = with_factor(SECOND).replace(EXEMPLARS, EXEMPLARS + 'own_per = ["speed"]\n')
    assert changed(REFERENCE, own).exemplars.own_per == ("speed",)
    with pytest.raises(DefinitionError, match="remove 'speed' from own_per"):
        changed('cell = "both/a"\n', own)


NOT_RATED = DEMO.replace("rate_itself = true\n", "")


@pytest.mark.parametrize(
    ("text", "reference", "said"),
    [
        (DEMO, 'factor = "lower_lid"\nlevel = "bth"\n', "no level 'bth'; did you mean 'both'"),
        (
            DEMO,
            'factor = "lowerlid"\nlevel = "both"\n',
            "no factor is called 'lowerlid'; did you mean 'lower_lid'",
        ),
        (DEMO, 'cell = "bot"\n', "no cell 'bot'; did you mean 'both'"),
        (DEMO, 'factor = "lower_lid"\n', "expected factor and level together, got factor without level"),
        (DEMO, "", "expected factor and level, or cell; got neither"),
        (DEMO, REFERENCE + 'cell = "both"\n', "expected factor and level, or cell; got both"),
        (DEMO, REFERENCE + "gap = 3\n", "did you mean 'gap_ms'"),
        (
            with_factor(BETWEEN),
            'factor = "speed"\nlevel = "a"\n',
            "participants see only some levels of 'speed'",
        ),
        (
            with_factor(SECOND).replace("rate_itself = true\n", ""),
            'cell = "both/a"\n',
            "are not fully crossed",
        ),
        (
            with_factor(SECOND).replace("rate_itself = true\n", ""),
            'factor = "speed"\nlevel = "a"\n',
            "two levels",
        ),
        (GROUPS, 'cell = "both"\n', "every clip would be its own reference"),
        (
            GROUPS.replace("rate_itself = true\n", ""),
            'cell = "both"\n',
            "every clip would be its own reference",
        ),
        (OWN_BLINKS, REFERENCE, "remove 'lower_lid' from own_per"),
        (OWN_BLINKS, 'cell = "both"\n', "remove 'lower_lid' from own_per"),
        (NOT_RATED + '\n[blocks]\nsplit_by = "lower_lid"\n', REFERENCE, "would be empty"),
        (DEMO.replace("expected_seconds = 9.0", "views = 2"), REFERENCE, "shows both clips once"),
        (DEMO.replace(', de = "Referenz"', ""), REFERENCE, "no text in 'de'"),
    ],
)
def test_what_does_not_fit_is_one_line(text: str, reference: str, said: str) -> None:
    with pytest.raises(DefinitionError, match=re.escape(said)) as raised:
        changed(reference, text)
    assert len(raised.value.problems) == 1
    assert "\n" not in str(raised.value)
