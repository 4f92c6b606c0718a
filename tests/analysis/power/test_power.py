"""Power by simulation against exact power, and its bad input."""

import numpy as np
import pytest
from scipy import stats

from analysis.power.simulate import sample_sizes, simulate_power
from analysis.report.pictures import save_power_figure
from analysis.synthetic.synthesise import make_plan
from experiments.errors import InputError


@pytest.fixture(scope="module")
def plan():
    return make_plan("exp1")


def test_one_df_effects_have_the_power_of_the_noncentral_f(plan):
    """Exp 1's amplitude: F(1, 31) = 15.55 fixes dz, hence the exact power at any n."""
    result = simulate_power(plan, [12, 24], 1500, seed=3)
    row = result.effects.index("amplitude")
    for column, n in enumerate(result.n):
        noncentral = n * 15.55 / 32
        exact = stats.ncf.sf(stats.f.isf(0.05, 1, n - 1), 1, n - 1, noncentral)
        assert result.power[row, column] == pytest.approx(exact, abs=0.05)


def test_only_effects_of_known_size_are_simulated(plan):
    result = simulate_power(plan, [10], 20)
    assert result.effects == (
        "character",
        "profile",
        "blur",
        "amplitude",
        "blur:amplitude",
        "character:blur:amplitude",
    )


def test_no_effect_is_found_as_often_as_alpha():
    null = make_plan("exp3", effects=["lower_lid=0"], means=[f"lower_lid.{x}=4.40" for x in LEVELS])
    for statistic in ("multivariate", "greenhouse-geisser"):
        result = simulate_power(null, [20], 2000, statistic=statistic, seed=2)
        assert result.power[0, 0] == pytest.approx(0.05, abs=0.025)


LEVELS = ("both", "vertical", "horizontal", "none")


def test_too_few_participants_have_no_multivariate_test():
    result = simulate_power(make_plan("exp2"), [10], 20)
    row = result.effects.index("profile:duration")
    assert np.isnan(result.power[row, 0])
    assert result.smallest_n(0.8)["profile:duration"] is None


def test_same_seed_same_power_and_progress_adds_up(plan):
    seen = []
    first = simulate_power(plan, [10, 15], 50, seed=7, progress=seen.append)
    second = simulate_power(plan, [10, 15], 50, seed=7)
    assert np.array_equal(first.power, second.power)
    assert sum(seen) == 100


@pytest.mark.parametrize(
    ("text", "sizes"),
    [("10:20:5", (10, 15, 20)), ("10:12", (10, 11, 12)), ("30,20", (20, 30)), ("25", (25,))],
)
def test_sample_sizes(text, sizes):
    assert sample_sizes(text) == sizes


@pytest.mark.parametrize("text", ["", "a:b", "20:10", "10:20:0", "1:5", "5:10:2,7", "10:20:30:40"])
def test_bad_sample_sizes(text):
    with pytest.raises(InputError, match="expected"):
        sample_sizes(text)


def test_bad_settings(plan):
    with pytest.raises(InputError, match="alpha"):
        simulate_power(plan, [10], 20, alpha=1.5)
    with pytest.raises(InputError, match="at least 10 simulations"):
        simulate_power(plan, [10], 2)


def test_the_figure_is_byte_stable(plan, tmp_path):
    result = simulate_power(plan, [10, 20], 20)
    for kind in ("svg", "png"):
        for name in ("a", "b"):
            save_power_figure(result, tmp_path / f"{name}.{kind}")
        assert (tmp_path / f"a.{kind}").read_bytes() == (tmp_path / f"b.{kind}").read_bytes()
    with pytest.raises(InputError, match="ending"):
        save_power_figure(result, tmp_path / "power.gif")


def test_a_study_of_several_scales_has_the_power_of_the_expected_f():
    """F(1, 11) = 9 of 12 participants fixes dz; ratings of 1 to 5 are coarse, which costs some."""
    power = {}
    for scale in (None, "eeriness"):
        own = make_plan("sliders-demo", effects=["character=9"], scale=scale)
        result = simulate_power(own, [12, 30], 1500, seed=4)
        assert result.effects == ("character",)
        power[scale] = result.power[0]
    exact = [stats.ncf.sf(stats.f.isf(0.05, 1, n - 1), 1, n - 1, n * 9 / 12) for n in (12, 30)]
    assert power["eeriness"] == pytest.approx(exact, abs=0.05)
    assert (power[None] > 0.3).all()
    assert (power[None] < power["eeriness"]).all()


@pytest.mark.parametrize(
    ("study", "options", "said"),
    [
        ("sliders-demo", {"effects": ["character=9"], "scale": "eerines"}, "did you mean 'eeriness'"),
        ("sliders-demo", {}, "name the effects that you expect, for example --effect character=6.5"),
        ("pairs-demo", {"effects": ["character=9"]}, "expected trials with a scale"),
    ],
)
def test_what_a_study_without_published_figures_needs_is_said(study, options, said):
    with pytest.raises(InputError, match=said):
        make_plan(study, **options)
