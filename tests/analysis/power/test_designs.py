"""Power of designs against exact power, the data they draw against what they say, and bad input."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import special, stats

from analysis.cli import app
from analysis.power import choices
from analysis.power.choices import PairsDesign, ThresholdDesign
from analysis.power.factorial import FactorialDesign
from analysis.power.models import MixedDesign, OrdinalDesign, Spreads
from analysis.power.simulate import sample_size_text, simulate_design
from experiments.command_line import run_command_line
from experiments.errors import InputError


def test_mixed_designs_have_the_power_of_the_noncentral_f() -> None:
    """Cohen's noncentralities: N k f^2 / (1 - rho) within, N k f^2 / (1 + (k - 1) rho) between."""
    sizes = {"blur": 0.15, "group": 0.35, "blur:group": 0.12}
    design = FactorialDesign({"face": 3, "blur": 2}, {"group": 2}, sizes, 0.4)
    n, k = 30, 6
    result = simulate_design(design, "x", [n], 400, seed=2)
    lambdas = (n * k * 0.15**2 / 0.6, n * k * 0.35**2 / (1 + 5 * 0.4), n * k * 0.12**2 / 0.6)
    for power, size in zip(result.power[:, 0], lambdas, strict=True):
        exact = stats.ncf.sf(stats.f.isf(0.05, 1, n - 2), 1, n - 2, size)
        assert power == pytest.approx(exact, abs=0.07)


@given(st.floats(0.05, 1.0), st.floats(-0.3, 0.9), st.sampled_from(["a", "b", "g", "a:b", "a:g", "a:b:g"]))
@settings(max_examples=20, deadline=None)
def test_the_means_have_the_size_asked_for(size, correlation, effect) -> None:
    design = FactorialDesign({"a": 2, "b": 2}, {"g": 3}, {effect: size}, correlation)
    assert np.sqrt(np.mean(design.means**2)) == pytest.approx(size)
    assert design.means.mean() == pytest.approx(0, abs=1e-12)


def test_a_covariate_has_the_power_of_the_noncentral_f() -> None:
    """What is left between people is 1 - r^2 of it, on one df less; effects within stay as they are."""
    sizes, n, k, r = {"blur": 0.15, "group": 0.3}, 40, 2, 0.7
    design = FactorialDesign({"blur": 2}, {"group": 2}, sizes, 0.5, covariate=r)
    result = simulate_design(design, "x", [n], 400, seed=3)
    lambdas = (n * k * 0.15**2 / 0.5, n * k * 0.3**2 / (1 + (k - 1) * 0.5) / (1 - r**2))
    for power, size in zip(result.power[:, 0], lambdas, strict=True):
        exact = stats.ncf.sf(stats.f.isf(0.05, 1, n - 3), 1, n - 3, size)
        assert power == pytest.approx(exact, abs=0.07)
    without = simulate_design(FactorialDesign({"blur": 2}, {"group": 2}, sizes, 0.5), "x", [n], 200, seed=3)
    assert result.power[1, 0] > without.power[1, 0] + 0.15
    assert "a covariate correlates 0.7" in design.population


def test_groups_alone_have_no_correlation() -> None:
    design = FactorialDesign({}, {"group": 2}, {"group": 0.3}, 0.5)
    assert "correlate" not in design.population
    assert "each participant gives one mean" in design.population
    assert design.test == "F tests"
    same = FactorialDesign({}, {"group": 2}, {"group": 0.3}, 0.1)
    first, second = (simulate_design(one, "x", [20], 50, seed=1).power for one in (design, same))
    assert (first == second).all()


def test_ties_come_as_often_as_asked_and_cost_power() -> None:
    """Only decided comparisons of two items count: power by the normal approximation of their log odds."""
    design = PairsDesign((0.0, 0.5), 4, tie=0.3)
    drawn = design._outcomes(5000, np.random.default_rng(1)).sum(axis=(0, 1))
    odds = 2 * 0.3 / 0.7 / (2 * np.cosh(0.25))  # nu over what either side has
    assert drawn[2] / drawn.sum() == pytest.approx(odds / (1 + odds), abs=0.01)
    assert drawn[1] / drawn[:2].sum() == pytest.approx(1 / (1 + np.exp(-0.5)), abs=0.01)
    n = 20
    decided, share = 4 * n / (1 + odds), 1 / (1 + np.exp(-0.5))
    shift = 0.5 * np.sqrt(decided * share * (1 - share))
    approximate = stats.norm.sf(1.96 - shift) + stats.norm.cdf(-1.96 - shift)
    result = simulate_design(design, "x", [n], 300, seed=2)
    assert result.power[:, 0] == pytest.approx([approximate] * 2, abs=0.1)
    robust = simulate_design(PairsDesign((0.0, 0.0), 2, 0.8, 0.2), "x", [24], 300, seed=2)
    assert robust.power[0, 0] == pytest.approx(0.05, abs=0.045)


def test_ordinal_ratings_have_their_shares_and_their_odds() -> None:
    shares = (0.1, 0.2, 0.3, 0.25, 0.15)
    design = OrdinalDesign((0.7,), shares, 10, sd_participant=0, sd_slope=0, sd_clip=0)
    rows = design.drawn(4000, np.random.default_rng(1))
    first, second = (rows.loc[rows["condition"] == side, "rating"] for side in (0, 1))
    given = first.value_counts(normalize=True).sort_index()
    assert given.to_numpy() == pytest.approx(np.array(shares), abs=0.01)
    for category in range(1, 5):
        log_odds = [np.log((y > category).mean() / (y <= category).mean()) for y in (first, second)]
        assert log_odds[1] - log_odds[0] == pytest.approx(0.7, abs=0.06)


def test_an_ordinal_model_has_the_power_of_whiteheads_formula() -> None:
    """Of independent ratings the variance of the log odds ratio is 12 / (N (1 - sum of mean shares^3))."""
    shares, theta, n, clips = np.array([0.25, 0.25, 0.25, 0.25]), 0.8, 12, 10
    design = OrdinalDesign((theta,), tuple(shares), clips, sd_participant=0, sd_slope=0, sd_clip=0)
    lower = special.expit(special.logit(np.cumsum(shares)[:-1]) - theta)
    mean = (shares + np.diff([0, *lower, 1])) / 2
    shift = theta / np.sqrt(12 / (n * clips * (1 - (mean**3).sum())))
    result = simulate_design(design, "x", [n], 60, seed=5)
    assert result.power[0, 0] == pytest.approx(stats.norm.sf(1.96 - shift), abs=0.2)


@pytest.mark.parametrize(
    ("shares", "clips", "message"),
    [((1.0,), 4, "shares of 2 to 20"), ((1.0, 0.0), 4, "all above 0"), ((1.0, 1.0), 5, "divided evenly")],
)
def test_an_ordinal_design_that_cannot_be_is_refused(shares, clips, message) -> None:
    with pytest.raises(InputError, match=message):
        OrdinalDesign((0.5,), shares, clips)


def test_crossed_clips_are_not_asked_for_where_they_are_declared() -> None:
    with pytest.raises(InputError, match=r"^expected at least 2 clips, got 1$"):
        OrdinalDesign((0.5, 0.2), (1.0, 1.0), 1, crossed=True)


def test_cells_correlate_as_asked(monkeypatch) -> None:
    drawn = []
    monkeypatch.setattr("analysis.power.factorial.linear_anova", lambda y, *_: drawn.append(y) or _Nothing())
    for correlation in (-0.2, 0.0, 0.7):
        FactorialDesign({"a": 4}, {}, {"a": 0.0}, correlation).p_values(20_000, np.random.default_rng(1))
        covariance = np.cov(drawn[-1], rowvar=False)
        assert np.diag(covariance) == pytest.approx(np.ones(4), abs=0.04)
        assert covariance[np.triu_indices(4, 1)] == pytest.approx(np.full(6, correlation), abs=0.04)


class _Nothing:
    def effect(self, _: str) -> "_Nothing":
        return self

    univariate = type("U", (), {"p_gg": 1.0})


def test_ratings_of_a_mixed_model_spread_as_they_say() -> None:
    """Variance of the difference: of people / N, of clips 4 / clips, of the rest 4 / ratings."""
    spreads = Spreads(0.5, 0.6, 0.4, 0.0, 0.0, 0.8)
    design = MixedDesign((0.5,), (8,), spreads=spreads)
    data, _ = design._coded(10, 8, 1)
    side = data.fixed[data.cell, 1]
    rng = np.random.default_rng(5)
    draws = [design._ratings(data, rng) for _ in range(3000)]
    differences = np.array([y[side < 0].mean() - y[side > 0].mean() for y in draws])
    assert differences.mean() == pytest.approx(0.5, abs=0.03)
    assert differences.var() == pytest.approx(0.6**2 / 10 + 4 * 0.4**2 / 8 + 4 * 0.8**2 / 80, rel=0.08)


def test_three_conditions_have_the_power_of_the_noncentral_f() -> None:
    """Crossed clips and no repeats: F of the person by condition interaction on 2, 2 (N - 1) df."""
    n, clips, means = 12, 4, np.array([0.0, 0.3, 0.6])
    design = MixedDesign((0.3, 0.6), (clips,), crossed=True, spreads=Spreads(0.5, 0.8, 0.0, 0.0, 0.0, 0.5))
    data, _ = design._coded(n, clips, 1)
    rng = np.random.default_rng(2)
    draws = [design._ratings(data, rng) for _ in range(1000)]
    cells = np.array([[y[data.cell == k].mean() for k in range(3)] for y in draws])
    assert (cells - cells[:, :1]).mean(axis=0) == pytest.approx(means, abs=0.03)
    # the variance of a person's cell mean that is not the person's: 0.8^2 / 2, and the rest over the clips
    error = 0.8**2 / 2 + 0.5**2 / clips
    for a, b in ((0, 1), (0, 2), (1, 2)):
        assert (cells[:, a] - cells[:, b]).var() == pytest.approx(2 * error / n, rel=0.12)
    size = n * ((means - means.mean()) ** 2).sum() / error
    exact = stats.ncf.sf(stats.f.isf(0.05, 2, 2 * (n - 1)), 2, 2 * (n - 1), size)
    assert simulate_design(design, "x", [n], 200, seed=4).power[0, 0] == pytest.approx(exact, abs=0.09)


def test_three_conditions_of_an_ordinal_model_have_their_odds() -> None:
    design = OrdinalDesign((0.5, -0.4), (1.0, 1.0, 1.0), 6, sd_participant=0, sd_slope=0, sd_clip=0)
    rows = design.drawn(6000, np.random.default_rng(1))
    odds = [np.log((y > 2).mean() / (y <= 2).mean()) for _, y in rows.groupby("condition")["rating"]]
    assert np.array(odds) - odds[0] == pytest.approx([0, 0.5, -0.4], abs=0.07)


def test_more_clips_and_faces_find_more() -> None:
    design = MixedDesign((0.5,), (8, 16), (2, 4), spreads=Spreads(face=0.2, face_difference=0.3))
    assert design.effects == (
        "8 clips of 2 faces",
        "8 clips of 4 faces",
        "16 clips of 2 faces",
        "16 clips of 4 faces",
    )
    p = design.p_values(6, np.random.default_rng(1))
    assert len(p) == 4
    assert all(0 <= one <= 1 for one in p)
    clips = MixedDesign((0.6,), (4, 24), spreads=Spreads(clip=0.6, participant_difference=0.0))
    few, many = simulate_design(clips, "x", [10], 25, seed=3).power[:, 0]
    assert many > few + 0.2


def test_two_items_have_the_power_of_the_binomial_test() -> None:
    design = PairsDesign((0.0, 0.5), repeats=3)
    result = simulate_design(design, "x", [20], 800, seed=4)
    chosen, chance = np.arange(61), 1 / (1 + np.exp(0.5))
    with np.errstate(divide="ignore", invalid="ignore"):
        of_each = np.where(chosen > 0, chosen * np.log(chosen / 30), 0)
    chi2 = 2 * (of_each + of_each[::-1])
    exact = stats.binom.pmf(chosen, 60, chance)[chi2 > stats.chi2.isf(0.05, 1)].sum()
    assert result.power[0, 0] == pytest.approx(exact, abs=0.05)
    assert result.effects == ("all items", "item 2 or 1")


@pytest.mark.parametrize("abilities", [(0.0, 0.0), (0.0, 0.0, 0.0)])
def test_items_that_do_not_differ_are_distinguished_at_the_rate_of_alpha(abilities) -> None:
    """Raters' own preferences, compared five times each, are not evidence about the population."""
    design = PairsDesign(abilities, repeats=5, rater_sd=1.0)
    result = simulate_design(design, "x", [10, 25], 800, seed=3)
    assert np.all(result.power[0] < 0.05 + 3 * np.sqrt(0.05 * 0.95 / 800))
    assert np.all(result.power[0] > 0.02)


def test_fewer_raters_than_items_allow_no_robust_test() -> None:
    p = PairsDesign((0.0, 0.1, 0.2, 0.3), 4, rater_sd=0.5).p_values(3, np.random.default_rng(1))
    assert np.isnan(p).all()


def test_rare_ties_that_nobody_gave_are_still_tested_by_raters() -> None:
    design = PairsDesign((0.0, 0.3), repeats=1, rater_sd=0.5, tie=0.01)
    p = np.array([design.p_values(4, np.random.default_rng(seed)) for seed in range(20)])
    assert np.isfinite(p).any()
    assert ((p >= 0) & (p <= 1) | np.isnan(p)).all()


def test_an_item_that_always_wins_is_still_tested() -> None:
    p = PairsDesign((0.0, 12.0)).p_values(8, np.random.default_rng(1))
    assert p[0] < 0.01


def test_differences_of_thresholds_come_back_from_their_trials(monkeypatch) -> None:
    monkeypatch.setattr(choices, "POOL", 60)
    design = ThresholdDesign((100, 120, 140, 160, 180), 10, 140, 5, 5, 2, 12)
    assert np.isfinite(design.differences).all()
    error = design.differences.std(ddof=1) / np.sqrt(60)
    assert design.differences.mean() == pytest.approx(5, abs=3 * error)
    result = simulate_design(design, "x", [4, 12], 200, seed=1)
    standard = design.differences.mean() / design.differences.std(ddof=1)
    exact = [
        1 - np.diff(stats.nct.cdf([-t, t], n - 1, standard * np.sqrt(n)))[0]
        for n in (4, 12)
        if (t := stats.t.isf(0.025, n - 1))
    ]
    assert result.power[0] == pytest.approx(exact, abs=0.09)


def test_the_text_names_population_seed_and_numbers() -> None:
    design = FactorialDesign({"face": 2}, {}, {"face": 0.4})
    result = simulate_design(design, "x", [4, 30], 40, seed=9)
    text = sample_size_text(result, design, 0.8, "1.2")
    assert "face (2 levels, within)" in text
    assert "40 data sets were simulated (seed 9)" in text
    assert "face: N = 30" in text
    assert "not reached" in sample_size_text(simulate_design(design, "x", [4], 40), design, 0.99, "1.2")


@pytest.mark.parametrize("covariate", [0.0, 0.5])
def test_sizes_that_leave_no_error_have_no_power(covariate) -> None:
    design = FactorialDesign({}, {"group": 4}, {"group": 0.4}, covariate=covariate)
    least = 6 if covariate else 5
    result = simulate_design(design, "x", [3, least - 1, least], 20)
    assert np.isnan(result.power[0]).tolist() == [True, True, False]
    text = sample_size_text(simulate_design(design, "x", [4], 20), design, 0.8, "1.2")
    assert "not reached with up to 4 participants (no data set allowed the test)" in text


def test_the_text_says_how_many_people_have_no_threshold(monkeypatch) -> None:
    monkeypatch.setattr(choices, "POOL", 100)
    inside = ThresholdDesign((100, 120, 140, 160, 180), 10, 140, 5, 5, 2, 12)
    assert "left out" not in inside.population
    above = ThresholdDesign((100, 120, 140), 10, 170, 5, 15, 10, 12)
    share = 1 - np.isfinite(above.differences).mean()
    assert 0.2 < share < 1
    assert (
        f"100 simulated people, of whom {share:.0%} are left out because a threshold cannot be fitted"
        in above.population
    )


def test_the_same_seed_gives_the_same_numbers_whatever_the_other_sizes() -> None:
    design = PairsDesign((0.0, 0.4, 0.8))
    alone = simulate_design(design, "x", [12], 30, seed=6)
    beside = simulate_design(design, "x", [5, 12], 30, seed=6)
    assert alone.power[:, 0].tolist() == beside.power[:, 1].tolist()


@pytest.fixture
def call(capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)

    def run(arguments: str) -> tuple[int, str, str]:
        monkeypatch.setattr("sys.argv", ["analysis", "plan", *arguments.split()])
        with pytest.raises(SystemExit) as ended:
            run_command_line(app)
        said = capsys.readouterr()
        return int(ended.value.code or 0), said.out, said.err

    return run


@pytest.mark.parametrize(
    "arguments",
    [
        "anova --within face:3 --between group:2 --effect face:group=0.3",
        "mixed --difference 0.5 --clips 4 --faces 2",
        "ordinal --difference 0.5 --shares 1,2,1 --clips 2 --crossed",
        "mixed --difference 0.3,0.6 --clips 6",
        "ordinal --difference 0.3,0.6 --shares 1,2,1 --clips 6",
        "pairs --abilities 0,0.3,0.6 --sd-rater 0.4 --tie 0.2",
        "thresholds --levels 100,120,140 --threshold 120 --difference 10 --spread 10 --sd-difference 4",
    ],
)
def test_the_commands_write_table_text_figure_and_json(call, tmp_path, monkeypatch, arguments) -> None:
    monkeypatch.setattr(choices, "POOL", 20)
    code, out, err = call(f"{arguments} --n 8,12 --simulations 10 --plot power.svg --json power.json")
    assert (code, err) == (0, "")
    assert "Sample size was planned by simulation" in " ".join(out.split())
    assert max(map(len, out.splitlines())) <= 80
    assert (tmp_path / "power.svg").read_text(encoding="utf-8").startswith("<?xml")
    written = json.loads((tmp_path / "power.json").read_text(encoding="utf-8"))
    assert len(written["power"]) == len(written["effects"])
    assert "planned by simulation" in written["text"]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ("anova --within face", "should be like face:3,blur:2"),
        ("anova --within face:3", "no effect has a size"),
        ("anova --within face:3 --effect fase=0.2", "no factor 'fase'; did you mean 'face'?"),
        ("anova --within face:3 --effect face=big", "--effect should be like"),
        ("anova --within face:3 --effect face=0.2 --correlation 1.5", "cannot all correlate 1.5"),
        ("mixed --difference 0.5 --clips 2", "2 clips are one per condition"),
        ("mixed --difference 0.5 --clips 5", "expected a multiple of 2"),
        ("mixed --difference 0.5 --faces 1", "at least two faces"),
        ("mixed --difference 0.2,0.4 --clips 8", "between 3 conditions; expected a multiple of 3"),
        ("ordinal --difference 0.2,0.4 --shares 1,1 --clips 8", "between 3 conditions; use a multiple of 3"),
        ("mixed --difference ,", "power cannot be computed: no condition is compared; add --difference"),
        ("mixed --difference nan", "--difference should be numbers separated by commas, got 'nan'"),
        ("mixed --difference 0.5 --sd-slope inf", "--sd-slope: expected a number, got 'inf'"),
        ("ordinal --difference 0.5 --shares 1,nan", "--shares should be numbers separated by commas"),
        ("ordinal --difference 0.5 --shares 1,1 --clips 2", "2 clips are one per condition"),
        ("pairs --abilities 0,inf", "--abilities should be numbers separated by commas, got '0,inf'"),
        (
            "thresholds --levels 1,2 --threshold nan --difference 1 --spread 1",
            "--threshold: expected a number, got 'nan'",
        ),
        (
            "anova --within face:2,blur:2 --effect face:blur=0.2 --effect blur:face=0.3",
            "'face:blur' and 'blur:face' are the same effect; give it once",
        ),
        ("anova --within face:2 --effect face=0.2 --effect face=0.3", "face has two sizes; give it once"),
        ("anova --within face:2 --effect face:face=0.2", "'face:face' names a factor twice"),
        ("ordinal --difference 0.5 --shares 1,a", "numbers separated by commas"),
        ("anova --within face:3 --effect face=0.2 --covariate 1", "between -1 and 1"),
        ("pairs --abilities 0,1 --tie 1", "probability of ties"),
        ("pairs --abilities 0", "at least two items"),
        ("pairs --abilities a,b", "numbers separated by commas"),
        ("thresholds --levels 1 --threshold 1 --difference 1 --spread 1", "at least two stimuli"),
        ("pairs --abilities 0,1 --simulations 2", "at least 10 simulations"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(call, arguments, said) -> None:
    code, _, err = call(arguments)
    assert code == 2
    assert said in err
    assert err.count("\n") == 1


def test_a_factor_in_two_roles_is_refused() -> None:
    with pytest.raises(InputError, match="both within and between"):
        FactorialDesign({"a": 2}, {"a": 2}, {"a": 0.2})


@pytest.mark.parametrize(
    ("arguments", "option"),
    [
        ("pairs --abilities 0,1", "--sd-rater"),
        ("thresholds --levels 1,2,3 --threshold 2 --difference 1 --spread 1", "--sd-difference"),
    ],
)
def test_a_plan_for_people_who_are_all_alike_warns(call, monkeypatch, arguments, option) -> None:
    monkeypatch.setattr(choices, "POOL", 20)
    code, _, err = call(f"{arguments} --n 8,12 --simulations 10")
    assert code == 0
    assert f"warning: {option} is 0" in err
