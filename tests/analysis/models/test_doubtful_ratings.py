"""Ratings on which a mixed model could be silently wrong: far origins, variances that are not identified."""

import numpy as np
import pandas as pd
import pytest

from analysis.models.mixed import fit_mixed
from experiments.errors import InputError

# R's `sleep` (Cushny and Peebles 1905): ten people under two drugs
EXTRA = [
    0.7,
    -1.6,
    -0.2,
    -1.2,
    -0.1,
    3.4,
    3.7,
    0.8,
    0.0,
    2.0,
    1.9,
    0.8,
    1.1,
    0.1,
    -0.1,
    4.4,
    5.5,
    1.6,
    4.6,
    3.4,
]
SLEEP = pd.DataFrame({"who": [*range(10), *range(10)], "drug": ["1"] * 10 + ["2"] * 10, "extra": EXTRA})

# yield of R's `npk` (Venables and Ripley): six blocks of four plots, half of all combinations in each
NPK = {
    "block": np.repeat(np.arange(1, 7), 4),
    "N": list("010111000110110010101100"),
    "P": list("110001011100010110010110"),
    "K": list("100101100101011000111010"),
    "y": [
        *(49.5, 62.8, 46.8, 57, 59.8, 58.5, 55.5, 56, 62.8, 55.8, 69.5, 55),
        *(62, 48.8, 45.5, 44.2, 52, 51.5, 49.8, 48.8, 57.2, 59, 53.2, 56),
    ],
}


def fitted(rows: pd.DataFrame, **options):
    return fit_mixed(rows, "who", "extra", ["drug"], options.pop("item", None), "none", **options)


@pytest.mark.parametrize(
    ("origin", "unit"), [(0.0, 1.0), (0.0, 1e-9), (0.0, 1e9), (1e9, 1.0), (-1.7e12, 1.0), (1e9, 1e9)]
)
def test_neither_origin_nor_unit_changes_a_test(origin, unit) -> None:
    rows = SLEEP.assign(extra=SLEEP["extra"] * unit + origin)
    result = fitted(rows, intervals=True)
    # lmerTest: REML criterion 71.34217711, F(1, 9) = 16.50088131, sigma 0.8697381471
    rel = 1e-7 if origin == 0 or unit > 1 else 1e-3
    assert result.effects[0].f_value == pytest.approx(16.50088131, rel=rel)
    assert result.effects[0].df_error == pytest.approx(9, rel=1e-4)
    assert result.sigma == pytest.approx(0.8697381471 * unit, rel=rel)
    assert result.reml_criterion == pytest.approx(71.34217711 + 36 * np.log(unit), abs=1e-2)
    intercept, drug = result.coefficients
    assert intercept.estimate == pytest.approx(1.54 * unit + origin, rel=1e-9)
    assert drug.estimate == pytest.approx(-0.79 * unit, rel=rel)
    assert intercept.ci is not None
    assert drug.ci is not None
    assert intercept.ci[0] < intercept.estimate < intercept.ci[1]
    assert (drug.ci[0] / unit, drug.ci[1] / unit) == pytest.approx((-1.19, -0.39), abs=0.02)


def test_an_item_of_one_condition_each_is_refused() -> None:
    # lme4 answers F(1, 9) = 0.35, p = .57, by the variance it happens to start from; without items F = 16.5
    with pytest.raises(InputError, match=r"determine the variance of clip intercept, and the tests depend"):
        fitted(SLEEP.assign(clip="c" + SLEEP["drug"]), item="clip")


def test_one_person_with_two_ratings_shows_no_variance_of_people() -> None:
    # lme4 answers F(1, 9) = 28.4, p = .0005
    with pytest.raises(InputError, match=r"determine the variance of who intercept"):
        fitted(SLEEP.iloc[:11])


def test_variances_that_are_shared_freely_are_named_where_tests_hold() -> None:
    result = fit_mixed(pd.DataFrame(NPK), "block", "y", ["N", "P", "K"], None, "main")
    assert "cannot separate the variances of block intercept, block N, block P, block K" in result.notes[0]
    # lmerTest: the same for every share
    assert result.reml_criterion == pytest.approx(120.0334541, abs=1e-6)


def test_correlated_slopes_of_one_rating_a_cell_are_refused() -> None:
    with pytest.raises(
        InputError, match=r"more than 20 ratings for 2 correlated .* got 20\. .* --slopes none"
    ):
        fit_mixed(SLEEP, "who", "extra", ["drug"], None, "correlated")


@pytest.mark.parametrize("categories", [2, 4])
@pytest.mark.parametrize("n", [5, 60])
def test_separation_is_named_and_not_blamed_on_few_ratings(categories: int, n: int) -> None:
    from analysis.models.columns import ModelTerms
    from analysis.models.design import model_data
    from analysis.models.ordinal import _refuse_undetermined, separated_columns

    rng = np.random.default_rng(n)
    rows = pd.DataFrame(
        {"who": np.repeat(np.arange(n), 12), "a": np.tile(["u", "v"], 6 * n), "x": rng.normal(size=12 * n)}
    )
    noise = rng.integers(0, categories, 12 * n)
    edges = np.linspace(-1, 1, categories + 1)[1:-1]
    terms = ModelTerms("who", "y", ("a",), covariates=("x",))
    free = model_data(rows.assign(y=noise), terms)
    assert separated_columns(free) == []
    with pytest.raises(InputError, match="too few ratings"):
        _refuse_undetermined(free, np.zeros(2))
    split = model_data(rows.assign(y=np.searchsorted(edges, rows["x"])), terms)
    assert "x" in separated_columns(split)
    with pytest.raises(InputError, match=r"separated.*however many ratings"):
        _refuse_undetermined(split, np.zeros(2))
