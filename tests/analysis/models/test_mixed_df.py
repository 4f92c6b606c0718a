"""Kenward and Roger's tests against lmerTest and pbkrtest (golden), and by what must hold."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy import optimize

from analysis.models.columns import Slopes
from analysis.models.fixed_effect_tests import _df_and_scale
from analysis.models.mixed import fit_mixed
from analysis.models.profile import _Path
from analysis.models.random_part import MixedResult
from experiments.errors import InputError

GOLDEN = Path(__file__).parents[2] / "golden" / "r"
FITS = json.loads((GOLDEN / "mixed_df.json").read_text(encoding="utf-8"))["fits"]
NAMES = [f"{Path(fit['file']).stem}-{fit['slopes']}" for fit in FITS]


def fitted(fit: dict, **more) -> MixedResult:
    rows = pd.read_csv(GOLDEN / fit["file"])
    if "crossed" in fit["file"]:
        given = {"between": ["group"], "covariates": ["age"], "random": ["face", "lab/room"]}
        return fit_mixed(rows, "participant", "rating", ["blur"], "clip", fit["slopes"], **given, **more)
    return fit_mixed(rows, "participant", "rating", ["A", "B"], "clip", fit["slopes"], **more)


@pytest.mark.parametrize("fit", FITS, ids=NAMES)
def test_kenward_roger_agrees_with_pbkrtest(fit) -> None:
    ours = fitted(fit, df_method="kenward-roger")
    theirs = {frozenset(e["effect"].split(":")): e for e in fit["effects"]}
    for effect in ours.effects:
        golden = theirs[frozenset(effect.effect.split(":"))]
        assert effect.df_effect == golden["df_effect"]
        assert effect.f_value == pytest.approx(golden["f_value"], rel=1e-4), effect.effect
        assert effect.df_error == pytest.approx(golden["df_error"], rel=1e-4), effect.effect
        assert effect.p_value == pytest.approx(golden["p_value"], rel=1e-3), effect.effect
    for row in ours.coefficients:  # R has a covariate before interactions
        golden = min(fit["coefficients"], key=lambda one: abs(one["estimate"] - row.estimate))
        assert row.se == pytest.approx(golden["se"], rel=1e-4), row.name
        assert row.df == pytest.approx(golden["df"], rel=1e-4), row.name
        assert row.t == pytest.approx(golden["t"], rel=1e-4, abs=1e-6), row.name


@pytest.mark.parametrize("fit", [f for f in FITS if f["intervals"]], ids=lambda fit: Path(fit["file"]).stem)
def test_profile_intervals_agree_with_lme4(fit) -> None:
    ours = fitted(fit, intervals=True)
    golden = {one["name"]: (one["low"], one["high"]) for one in fit["intervals"]}
    names = ["sd_(Intercept)|clip", "sigma"]
    rows = list(ours.components[-2:])
    if "xA" in fit["formula"]:  # elsewhere participants' terms are written in another way
        names = ["sd_(Intercept)|participant", "sd_xA|participant", "sd_xB|participant", *names]
        rows = list(ours.components)
    rows += ours.coefficients
    names += [name for name in golden if "|" not in name and name != "sigma"]
    for name, row in zip(names, rows, strict=True):
        low, high = golden[name]
        assert row.ci == pytest.approx((low, high), abs=1e-5 * (high - low)), name


def few(people: int = 5, clips: int = 4, seed: int = 3, between: float = 0.7) -> pd.DataFrame:
    rng = np.random.default_rng(seed)
    liking = rng.normal(0, between, people)
    rows = [
        (f"p{p}", f"c{a}{c}", f"a{a}", liking[p] + 0.4 * a + rng.normal())
        for p in range(people)
        for a in range(2)
        for c in range(clips)
    ]
    return pd.DataFrame(rows, columns=["who", "clip", "A", "y"])


def dense_deviance(rows: pd.DataFrame, sd: float, sigma: float, beta: tuple[float, float]) -> float:
    """-2 log likelihood of an intercept per participant, from the covariance of all ratings."""
    same = rows["who"].to_numpy()[:, None] == rows["who"].to_numpy()[None, :]
    v = sd**2 * same + sigma**2 * np.eye(len(rows))
    residual = rows["y"].to_numpy() - beta[0] - beta[1] * np.where(rows["A"] == "a0", 1.0, -1.0)
    log_det = float(np.linalg.slogdet(v)[1])
    return len(rows) * np.log(2 * np.pi) + log_det + float(residual @ np.linalg.solve(v, residual))


def least(rows: pd.DataFrame, **held: float) -> float:
    """The smallest dense deviance with some parameters held."""
    free = [name for name in ("sd", "sigma", "mean", "a") if name not in held]

    def of(packed: np.ndarray) -> float:
        at = dict(zip(free, packed, strict=True)) | held
        return dense_deviance(rows, at["sd"], at["sigma"], (at["mean"], at["a"]))

    start = {"sd": 0.5, "sigma": 1.0, "mean": float(rows["y"].mean()), "a": 0.0}
    best = optimize.minimize(of, [start[name] for name in free], method="BFGS", options={"gtol": 1e-8})
    return float(best.fun)


@pytest.mark.parametrize(("parameter", "at"), [("sd", 0), ("sigma", 1), ("mean", 0), ("a", 1)])
def test_at_both_ends_the_deviance_has_risen_by_chi_squared(parameter, at) -> None:
    rows = few()
    result = fit_mixed(rows, "who", "y", ["A"], slopes="none", intervals=True)
    row = (result.components if parameter in ("sd", "sigma") else result.coefficients)[at]
    assert row.ci is not None
    lowest = least(rows)
    for end in row.ci:
        assert least(rows, **{parameter: end}) - lowest == pytest.approx(3.841458820694124, abs=1e-4)


def test_a_variance_that_may_be_zero_begins_at_zero() -> None:
    result = fit_mixed(few(between=0.0, seed=8), "who", "y", ["A"], slopes="none", intervals=True)
    low, high = result.components[0].ci or (np.nan, np.nan)
    assert low == 0.0
    assert 0 < high < 1.5


def test_every_interval_is_reported_before_it_is_computed() -> None:
    told: list[str] = []
    fit_mixed(few(8), "who", "y", ["A"], slopes="none", intervals=True, progress=told.append)
    assert told == [
        "interval 1 of 4, SD of who intercept",
        "interval 3 of 4, intercept",
        "interval 4 of 4, A[a0]",
    ]


def test_an_end_in_another_minimum_is_fitted_again(monkeypatch) -> None:
    """Fits that go on from one another may follow a minimum that is not the least."""
    rows = few()
    right = fit_mixed(rows, "who", "y", ["A"], slopes="none", intervals=True)
    monkeypatch.setattr(_Path, "least", lambda self, value: self._fit(value, [])[1])
    monkeypatch.setattr("analysis.models.profile._least_of", _misled)
    misled = fit_mixed(rows, "who", "y", ["A"], slopes="none", intervals=True)
    for one, other in zip(right.coefficients, misled.coefficients, strict=True):
        assert one.ci == pytest.approx(other.ci, rel=1e-6)


def _misled(fits):
    """The least of the fits; of none a deviance far too high, as a minimum that is not the least has."""
    return min(fits, key=lambda fit: fit[1], default=(np.zeros(1), 1e6))


def test_correlated_slopes_have_no_interval_of_their_sd() -> None:
    result = fit_mixed(few(8), "who", "y", ["A"], slopes="correlated", intervals=True)
    assert [component.ci is None for component in result.components] == [True, True, False]


def test_balanced_data_have_exact_df() -> None:
    """In balanced data Kenward and Roger's F and df are those of the ANOVA: people x A is the error of A."""
    rows = few(7).rename(columns={"clip": "_"})
    rows["y"] += 0.5 * np.where(rows["A"] == "a0", 1, -1) * rows["who"].str[1:].astype(int)
    ours = fit_mixed(rows, "who", "y", ["A"], slopes="main", df_method="kenward-roger")
    means = rows.groupby(["who", "A"])["y"].mean().unstack()
    difference = (means["a0"] - means["a1"]).to_numpy()
    t = difference.mean() / (difference.std(ddof=1) / np.sqrt(len(difference)))
    assert ours.effects[0].f_value == pytest.approx(t**2, rel=1e-6)
    assert ours.effects[0].df_error == pytest.approx(len(difference) - 1, rel=1e-6)


def test_too_many_coefficients_are_refused_in_one_line() -> None:
    rows = few(2100, 1)
    with pytest.raises(InputError, match="at most 4000 random coefficients, but this model has 4200"):
        fit_mixed(rows, "who", "y", ["A"], slopes="main", df_method="kenward-roger")


HARD = json.loads((GOLDEN / "hard_cases.json").read_text(encoding="utf-8"))


def test_three_people_have_two_df_in_kenward_roger() -> None:
    rows = pd.read_csv(GOLDEN / "hard_three_people.csv")
    effect = fit_mixed(rows, "participant", "score", ["A"], "item", "all", df_method="kenward-roger").effects[
        0
    ]
    golden = HARD["three_people"]
    assert effect.f_value == pytest.approx(golden["f_value"], rel=1e-4)
    assert effect.df_error == pytest.approx(golden["df_error"], rel=1e-6)
    assert effect.p_value == pytest.approx(golden["p_value"], rel=1e-4)


@pytest.mark.parametrize("q", [1, 2, 3, 5])
@pytest.mark.parametrize("df", [2.0, 4.0, 7.0])
@pytest.mark.parametrize("noise", [-1e-8, 0.0, 1e-8])
def test_df_of_one_error_variance_are_its_own_however_rounded(q, df, noise) -> None:
    """An exact F test has A1 = 2 q^2 / df and A2 = 2 q / df, and needs no scaling."""
    ours, scale = _df_and_scale(q, 2 * q**2 / df, 2 * q / df * (1 + noise))
    assert ours == pytest.approx(df, rel=1e-5)
    assert scale == pytest.approx(1, rel=1e-5)


def test_intervals_of_a_flat_profile_agree_with_lme4() -> None:
    """Residual SDs held high have a second stationary point, a variance of zero. It is not a minimum."""
    rows = pd.read_csv(GOLDEN / "hard_flat_profile.csv")
    ours = fit_mixed(rows, "participant", "score", ["A"], "item", "all", intervals=True)
    golden = {one["name"]: (one["low"], one["high"]) for one in HARD["intervals"]}
    names = ["sd_(Intercept)|item", "sigma", "(Intercept)", "A1", "A2"]
    for name, row in zip(names, [*ours.components[-2:], *ours.coefficients], strict=True):
        low, high = golden[name]
        assert row.ci == pytest.approx((low, high), abs=1e-5 * (high - low)), name
    assert not ours.notes


def test_an_end_that_the_likelihood_lacks_is_said(monkeypatch) -> None:
    monkeypatch.setattr("analysis.models.profile.MAX_DOUBLINGS", 0)
    result = fit_mixed(few(), "who", "y", ["A"], slopes="none", intervals=True)
    assert np.isnan(result.components[-1].ci).all()
    assert "the profile interval of intercept, A[a0], who intercept, residual is open" in result.notes[-1]


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("slopes", ["none", "all"])
def test_people_who_all_differ_by_the_same_are_refused_in_one_line(slopes: Slopes) -> None:
    """The search ends here, and the degrees of freedom would divide by a residual of 0."""
    rows = pd.DataFrame(
        [{"who": f"p{i}", "A": level, "y": i + step} for i in range(8) for step, level in enumerate("ab")]
    )
    with pytest.raises(InputError, match="no residual variance"):
        fit_mixed(rows, "who", "y", ["A"], slopes=slopes)


def test_ratings_without_residual_variance_are_refused_in_one_line() -> None:
    rows = few(8)
    rows["y"] = rows["who"].str[1:].astype(int) % 5 + 1
    with pytest.raises(InputError, match="no residual variance"):
        fit_mixed(rows, "who", "y", ["A"], slopes="none")
