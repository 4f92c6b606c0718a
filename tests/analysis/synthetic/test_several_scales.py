"""Synthetic ratings of a study with several scales: every scale has its own figures, in one file."""

import csv

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from analysis.cli import app
from analysis.synthetic.repair import value_of
from analysis.synthetic.synthesise import make_plan, make_plans, synthesise
from analysis.synthetic.targets import Steps
from analysis.synthetic.trials import write_ratings
from analysis.within.anova import within_anova
from analysis.within.cell_means import cell_table
from experiments.declaration.trial import RatedScale
from experiments.errors import InputError
from tests.analysis.synthetic.test_synthetic import read_rows

EFFECTS = ["character=9", "eeriness/blink=4", "tiredness/character:blink=0"]
MEANS = ["eeriness/character.cartoon=60.00", "naturalness/character.cartoon=3.5"]


@pytest.fixture(scope="module")
def made():
    return [synthesise(plan, 1) for plan in make_plans("sliders-demo", 20, MEANS, EFFECTS)]


@pytest.fixture(scope="module")
def rows(made, tmp_path_factory):
    out = tmp_path_factory.mktemp("scales") / "ratings.csv"
    count = write_ratings(made, out)
    rows = read_rows(out)
    assert count == len(rows) == 20 * 8 * 3
    return rows


def anova_of(rows, made):
    factors = list(made.space.factors)
    levels = dict(zip(made.space.factors, made.space.levels, strict=True))
    table = cell_table(rows[rows["scale"] == made.scale.name], "participant", "response", factors, levels)
    return within_anova(table.y, table.factors, table.levels)


def test_the_file_has_the_wished_figures_of_every_scale(made, rows):
    """From the written file alone, with the ANOVA of the package."""
    assert [one.scale.name for one in made] == ["naturalness", "eeriness", "tiredness"]
    assert not any(one.missed for one in made)
    for one in made:
        anova = anova_of(rows, one)
        assert f"{anova.effect('character').multivariate.f_value:.2f}" == "9.00"
        np.testing.assert_allclose(anova.y, one.y)
    assert f"{anova_of(rows, made[1]).effect('blink').multivariate.f_value:.2f}" == "4.00"
    assert anova_of(rows, made[2]).effect("character:blink").multivariate.f_value < 0.005
    cartoon = rows[rows["character"] == "cartoon"].groupby("scale")["response"].mean()
    assert f"{cartoon['eeriness']:.2f}" == "60.00"
    assert f"{cartoon['naturalness']:.2f}" == "3.50"


def test_every_answer_is_one_that_its_scale_takes(made, rows):
    for one in made:
        given = rows[rows["scale"] == one.scale.name]["response"]
        assert all(one.scale.admits(value) for value in given)
    assert rows[rows["scale"] == "eeriness"]["response"].nunique() > 20


def test_a_trial_has_a_row_a_scale_and_its_answers_follow_one_another(rows):
    trials = rows.groupby(["participant", "trial_index"])
    assert set(trials.size()) == {3}
    times = rows["scale_rt"].astype(float)
    assert (times.groupby([rows["participant"], rows["trial_index"]]).diff().dropna() > 0).all()
    assert (rows["rt"].astype(float) >= times).all()
    assert (rows["rt"].astype(float) == times)[rows["scale"] == "tiredness"].all()


def test_scales_are_answered_independently(made):
    first, second, third = (one.y.mean(axis=(1, 2)) for one in made)
    correlations = np.corrcoef([first, second, third])[np.triu_indices(3, 1)]
    assert (np.abs(correlations) < 0.999).all()


def test_the_command_names_every_scale_and_those_left_to_chance(tmp_path):
    out = tmp_path / "ratings.csv"
    told = CliRunner().invoke(
        app, ["synthesise", "sliders-demo", "--effect", "eeriness/character=9", "--out", str(out)]
    )
    assert told.exit_code == 0, told.output
    assert "scale eeriness, seed 1: 1 of 1 figures reached" in told.output
    assert told.output.count("no effect was specified for this scale; differences are due to chance") == 2
    with out.open(newline="", encoding="utf-8") as handle:
        assert {row["scale"] for row in csv.DictReader(handle)} == {"naturalness", "eeriness", "tiredness"}


@pytest.mark.parametrize(
    ("means", "effects", "said"),
    [
        ([], ["eerines/blink=4"], "no scale 'eerines'; did you mean 'eeriness'"),
        (
            ["character.cartoon=60"],
            ["blink=4"],
            "means from 1 to 5 on the scale 'naturalness', got 60.00; name",
        ),
        (["eeriness/character.cartoon=160"], ["blink=4"], "means from 0 to 100 on the scale 'eeriness'"),
        ([], ["eeriness/blnk=4"], "did you mean 'blink'"),
    ],
)
def test_wishes_for_no_scale_or_off_it_are_one_clear_line(means, effects, said):
    with pytest.raises(InputError, match=said):
        make_plans("sliders-demo", None, means, effects)


def test_a_mean_off_the_only_scale_is_refused_without_a_word_of_others():
    with pytest.raises(InputError, match=r"means from 1 to 7 on the scale 'rating', got 9\.00$"):
        make_plan("exp3", None, ["lower_lid.both=9"])


def scale_of(minimum: float, step: float, count: int) -> RatedScale:
    words = {"en": "?"}
    maximum = minimum + step * count
    return RatedScale("s", "slider", minimum, maximum, step, False, False, words, words, words, "response")


@given(
    st.sampled_from([0.0, 1.0, -3.0, 0.25, 2.5, -50.0]),
    st.sampled_from([0.5, 1.0, 0.1, 5.0]),
    st.integers(2, 200),
)
@settings(max_examples=40, deadline=None)
def test_every_step_of_a_scale_is_an_answer(minimum, step, count):
    scale = scale_of(minimum, step, count)
    steps = Steps.of(scale)
    assert steps.rating(steps.low) == pytest.approx(scale.minimum)
    assert steps.rating(steps.high) == pytest.approx(scale.maximum)
    assert all(scale.admits(steps.rating(k)) for k in range(steps.low, steps.high + 1))


def test_targets_in_steps_are_the_same_targets():
    plan = make_plan("exp3")
    for scale in (scale_of(1, 0.5, 12), scale_of(0.75, 0.5, 12)):
        steps = Steps.of(scale)
        y = np.random.default_rng(5).uniform(scale.minimum, scale.maximum, (40, plan.space.n_cells))
        counted = steps.targets(plan.targets)
        for plain, stepped in zip(plan.targets.everything, counted.everything, strict=True):
            value, in_steps = value_of(y, plain), value_of((y - steps.offset) / steps.size, stepped)
            assert (value - plain.low) / plain.scale == pytest.approx(
                (in_steps - stepped.low) / stepped.scale, abs=1e-6
            )
