"""Properties of the ANOVA, live comparisons with pingouin and statsmodels, and degenerate data."""

import warnings
from itertools import product

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from analysis.within.anova import within_anova
from analysis.within.estimates import marginal_means
from analysis.within.pairwise import one_factor_pairs, pairs_of
from experiments.error_bars import within_participant_errors
from experiments.errors import InputError

RELATIVE = 1e-8


def summary(result) -> dict[frozenset[str], tuple[float, float, float]]:
    """F, multivariate F and epsilon of every effect, by its set of factors."""
    return {
        frozenset(e.factors): (
            e.univariate.f_value,
            e.multivariate.f_value if e.multivariate else float("nan"),
            e.univariate.epsilon_gg,
        )
        for e in result.effects
    }


def same_tests(one, other) -> None:
    assert one.keys() == other.keys()
    for name, values in one.items():
        # 1e-9: an F this small is rounding of sums of squares near zero
        assert other[name] == pytest.approx(values, rel=1e-7, abs=1e-9, nan_ok=True), name


@st.composite
def cell_means(draw, max_factors: int = 3):
    """Cell means (N, a, b, ...) with variance in every contrast."""
    shape = tuple(draw(st.lists(st.integers(2, 4), min_size=1, max_size=max_factors)))
    n = draw(st.integers(3, 14))
    seed = draw(st.integers(0, 2**32 - 1))
    scale = draw(st.sampled_from([0.01, 1.0, 50.0]))
    return np.random.default_rng(seed).normal(4, scale, (n, *shape))


@settings(deadline=None, max_examples=40)
@given(cell_means(), st.integers(0, 2**32 - 1))
def test_a_constant_per_participant_changes_no_within_f(y, seed) -> None:
    shift = np.random.default_rng(seed).normal(0, 5, (len(y), *[1] * (y.ndim - 1)))
    names = "ABC"[: y.ndim - 1]
    same_tests(summary(within_anova(y, names)), summary(within_anova(y + shift, names)))


@settings(deadline=None, max_examples=40)
@given(cell_means(), st.randoms(use_true_random=False))
def test_the_order_of_levels_and_of_factors_changes_no_test(y, random) -> None:
    names = list("ABC"[: y.ndim - 1])
    before = summary(within_anova(y, names))
    permuted = y
    for axis in range(1, y.ndim):
        permuted = np.take(permuted, random.sample(range(y.shape[axis]), y.shape[axis]), axis=axis)
    order = random.sample(range(1, y.ndim), y.ndim - 1)
    turned = np.transpose(permuted, (0, *order))
    same_tests(before, summary(within_anova(turned, [names[axis - 1] for axis in order])))


@settings(deadline=None, max_examples=30)
@given(cell_means(max_factors=2), st.randoms(use_true_random=False))
def test_the_order_of_participants_changes_nothing(y, random) -> None:
    names = "AB"[: y.ndim - 1]
    shuffled = y[random.sample(range(len(y)), len(y))]
    same_tests(summary(within_anova(y, names)), summary(within_anova(shuffled, names)))


@settings(deadline=None, max_examples=40)
@given(hnp.arrays(float, st.tuples(st.integers(3, 12), st.just(2)), elements=st.integers(1, 7)))
def test_with_two_levels_f_is_t_squared_and_epsilon_one(y) -> None:
    result = within_anova(y, ["A"])
    effect, pair = result.effects[0], pairs_of(result, ["A"])[0]
    if np.isnan(effect.univariate.f_value):
        assert effect.univariate_reason
        assert np.isnan(pair.t)
        return
    assert effect.univariate.f_value == pytest.approx(pair.t**2, rel=RELATIVE)
    assert effect.univariate.p_value == pytest.approx(pair.p, rel=1e-7)
    assert effect.univariate.epsilon_gg == effect.univariate.epsilon_hf == 1.0
    assert effect.multivariate.f_value == pytest.approx(effect.univariate.f_value, rel=RELATIVE)
    assert effect.mauchly is None


@settings(deadline=None, max_examples=40)
@given(cell_means())
def test_statistics_keep_their_bounds(y) -> None:
    for e in within_anova(y, "ABC"[: y.ndim - 1]).effects:
        u = e.univariate
        assert 1 / u.df_effect - 1e-12 <= u.epsilon_gg <= 1
        assert 0 <= u.p_value <= 1
        low, high = e.eta_sq_partial_ci
        assert 0 <= low <= high < 1
        assert e.eta_sq_generalized <= e.eta_sq_partial + 1e-12
        if e.multivariate:
            assert e.multivariate.pillai + e.multivariate.wilks == pytest.approx(1)
        if e.mauchly:
            assert 0 < e.mauchly.w <= 1 + 1e-12
            assert 0 <= e.mauchly.p_value <= 1


@pytest.fixture(scope="module")
def data() -> np.ndarray:
    random = np.random.default_rng(7)
    return random.normal(4, 1, (14, 4, 3)) + random.normal(0, 1, (14, 1, 1)) + np.arange(4)[:, None] * 0.3


def long(y: np.ndarray, names: str) -> pd.DataFrame:
    rows = [
        (str(i), *map(str, cell), y[i][cell])
        for i in range(len(y))
        for cell in product(*map(range, y.shape[1:]))
    ]
    return pd.DataFrame(rows, columns=["id", *names, "y"])


def test_agrees_with_statsmodels_anovarm(data) -> None:
    from statsmodels.stats.anova import AnovaRM

    table = AnovaRM(long(data, "AB"), "y", "id", within=["A", "B"]).fit().anova_table
    for effect in within_anova(data, "AB").effects:
        row = table.loc[effect.effect]
        u = effect.univariate
        assert (u.df_effect, u.df_error) == (row["Num DF"], row["Den DF"])
        assert u.f_value == pytest.approx(row["F Value"], rel=RELATIVE)
        assert u.p_value == pytest.approx(row["Pr > F"], rel=1e-7)


def test_agrees_with_pingouin(data) -> None:
    import pingouin

    with warnings.catch_warnings():
        # pingouin 0.7 on pandas 3 warns about its own internals
        warnings.simplefilter("ignore")
        table = pingouin.rm_anova(long(data, "AB"), dv="y", within=["A", "B"], subject="id", effsize="ng2")
        single = pingouin.rm_anova(
            long(data[:, :, 0], "A"), dv="y", within="A", subject="id", correction=True, effsize="np2"
        )
    for effect, row in zip(within_anova(data, "AB").effects, table.to_dict("records"), strict=True):
        assert effect.univariate.f_value == pytest.approx(row["F"], rel=RELATIVE)
        assert effect.eta_sq_generalized == pytest.approx(row["ng2"], rel=RELATIVE)
        # pingouin's epsilon of an interaction follows another definition, so only main effects are compared
        if len(effect.factors) == 1:
            assert effect.univariate.epsilon_gg == pytest.approx(row["eps"], rel=RELATIVE)
    effect, row = within_anova(data[:, :, 0], "A").effects[0], single.iloc[0]
    assert effect.mauchly.w == pytest.approx(row["W_spher"], rel=RELATIVE)
    assert effect.eta_sq_partial == pytest.approx(row["np2"], rel=RELATIVE)
    assert effect.univariate.p_gg == pytest.approx(row["p_GG_corr"], rel=1e-7)


def test_multivariate_test_agrees_with_statsmodels_manova(data) -> None:
    from statsmodels.multivariate.manova import MANOVA

    y = data[:, :, 0]
    differences = y[:, 1:] - y[:, :1]
    table = MANOVA(differences, np.ones((len(y), 1))).mv_test([("mean", np.eye(1))]).results["mean"]["stat"]
    test = within_anova(y, "A").effects[0].multivariate
    assert test.f_value == pytest.approx(float(table.loc["Pillai's trace", "F Value"]), rel=RELATIVE)
    assert test.wilks == pytest.approx(float(table.loc["Wilks' lambda", "Value"]), rel=RELATIVE)
    assert (test.df_effect, test.df_error) == (3, 11)


def test_within_participant_error_of_pure_participant_differences_is_zero() -> None:
    y = np.arange(6.0)[:, None] + np.array([1.0, 2.0, 3.0])
    assert within_participant_errors(y.tolist()) == pytest.approx([0, 0, 0], abs=1e-12)


def test_marginal_means_weigh_participants_equally(data) -> None:
    mean = next(
        m for m in marginal_means(within_anova(data, "AB")) if m.effect == "A" and m.levels == {"A": "2"}
    )
    values = data[:, 1].mean(axis=1)
    assert mean.mean == pytest.approx(values.mean())
    assert mean.se == pytest.approx(values.std(ddof=1) / np.sqrt(14))
    assert (mean.ci[0] + mean.ci[1]) / 2 == pytest.approx(mean.mean)


def test_constant_ratings_give_named_reasons_not_numbers() -> None:
    result = within_anova(np.full((6, 3, 2), 4.0), "AB")
    for effect in result.effects:
        assert np.isnan(effect.univariate.f_value)
        assert effect.multivariate is None
        assert "nothing varies" in effect.univariate_reason
        assert effect.multivariate_reason == effect.univariate_reason
    assert all(np.isnan(pair.p) and pair.difference == 0 for pair in one_factor_pairs(result))


def test_the_same_effect_in_everyone_has_no_error_term() -> None:
    result = within_anova(np.arange(5.0)[:, None] + np.array([1.0, 2.0, 2.5]), "A")
    assert result.effects[0].univariate.ss > 0
    assert "every participant shows the same effect" in result.effects[0].univariate_reason


def test_few_participants_keep_the_univariate_test_and_say_why_not_the_other() -> None:
    effect = within_anova(np.random.default_rng(0).normal(size=(4, 6)), "A").effects[0]
    assert effect.multivariate is None
    assert effect.mauchly is None
    assert "error df = 3, contrasts = 5" in effect.multivariate_reason
    assert 0 < effect.univariate.p_gg < 1


def test_a_singular_error_matrix_is_named() -> None:
    y = np.random.default_rng(0).normal(size=(12, 3))
    y[:, 2] = 3 * y[:, 0] - 2 * y[:, 1]
    effect = within_anova(y, "A").effects[0]
    assert effect.multivariate is None
    assert "singular" in effect.multivariate_reason
    assert np.isfinite(effect.univariate.f_value)


def test_two_participants_are_enough_for_the_univariate_test() -> None:
    effect = within_anova(np.array([[1.0, 2.0, 4.0], [2.0, 2.0, 7.0]]), "A").effects[0]
    assert np.isfinite(effect.univariate.p_gg)
    assert np.isnan(effect.univariate.epsilon_hf)
    assert effect.univariate.p_hf == effect.univariate.p_value


@pytest.mark.parametrize(
    ("y", "names", "levels", "message"),
    [
        (np.ones((1, 2)), "A", None, "at least 2 complete participants, got 1"),
        (np.ones((4, 1)), "A", None, "at least 2 levels of 'A', got 1"),
        (np.array([[1.0, np.nan], [1.0, 2.0]]), "A", None, "finite mean in every cell"),
        (np.ones((4, 2)), "AB", None, "one axis for participants"),
        (np.ones((4, 2)), "A", [["x"]], "level names for the shape"),
    ],
)
def test_misuse_is_named(y, names, levels, message) -> None:
    with pytest.raises(InputError, match=message):
        within_anova(y, names, levels)


def test_large_grand_means_do_not_spoil_small_effects() -> None:
    y = np.random.default_rng(3).normal(0, 1, (10, 3, 2))
    same_tests(summary(within_anova(y, "AB")), summary(within_anova(y + 1e6, "AB")))


def test_an_effect_is_found_by_its_factors_in_any_order(data) -> None:
    result = within_anova(data, "AB")
    assert result.effect("B:A").effect == "A:B"
    with pytest.raises(InputError, match="no effect is called 'C'"):
        result.effect("C")


def test_a_pair_of_an_unknown_factor_is_refused(data) -> None:
    with pytest.raises(InputError, match="no factor is called 'Z'"):
        pairs_of(within_anova(data, "AB"), ["Z"])
