"""Abilities, standard errors and likelihoods against R (tests/golden/r/pairs.R)."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from analysis.pairs.abilities import fit_abilities, read_item_factors
from analysis.pairs.comparisons import Comparisons, read_comparisons

FOLDER = Path(__file__).parents[2] / "golden/r/pairs"
REFERENCE: dict[str, Any] = json.loads((FOLDER / "reference.json").read_text(encoding="utf-8"))


def comparisons(name: str) -> Comparisons:
    return read_comparisons(FOLDER / f"{name}.csv", "a", "b", "choice", "same", "id")


@pytest.mark.parametrize(
    ("key", "table", "method", "order"),
    [
        ("bradley_terry", "plain", "bradley-terry", False),
        ("bradley_terry_order", "plain", "bradley-terry", True),
        ("thurstone", "plain", "thurstone", False),
        ("davidson", "ties", "davidson", False),
        ("davidson_order", "ties", "davidson", True),
    ],
)
def test_abilities_equal_r(key: str, table: str, method: Any, order: bool) -> None:
    result = fit_abilities(comparisons(table), method, order_effect=order)
    expected = REFERENCE[key]
    assert [item.name for item in result.items] == REFERENCE["items"]
    np.testing.assert_allclose([i.ability for i in result.items], expected["ability"], rtol=1e-7, atol=1e-10)
    np.testing.assert_allclose([i.se for i in result.items], expected["se"], rtol=1e-6)
    assert result.log_likelihood == pytest.approx(expected["logLik"], rel=1e-10)
    if "robust" in expected:
        np.testing.assert_allclose([i.se_robust for i in result.items], expected["robust"], rtol=1e-6)
        against_first = [c.se_robust for c in result.contrasts if c.first == REFERENCE["items"][0]]
        np.testing.assert_allclose(against_first, expected["robust"][1:], rtol=1e-6)
    if order:
        assert result.order_effect is not None
        assert result.order_effect.estimate == pytest.approx(expected["order"], rel=1e-7)
    if method == "davidson":
        assert result.log_nu is not None
        assert result.log_nu.estimate == pytest.approx(expected["logNu"], rel=1e-7)
        assert result.log_nu.se == pytest.approx(expected["logNuSe"], rel=1e-6)


def test_factors_of_the_items_equal_r() -> None:
    result = fit_abilities(comparisons("plain"), factors=read_item_factors(FOLDER / "items.csv"))
    # R's levels are sorted alike: slow against fast, b against a.
    found = [estimate for test in result.factors[:2] for estimate in test.estimates]
    errors = [error for test in result.factors[:2] for error in test.standard_errors]
    np.testing.assert_allclose(found, REFERENCE["factors"]["estimates"], rtol=1e-7)
    np.testing.assert_allclose(errors, REFERENCE["factors"]["se"], rtol=1e-6)
    assert result.log_likelihood == pytest.approx(REFERENCE["factors"]["logLik"], rel=1e-10)
    free, lack = fit_abilities(comparisons("plain")), result.factors[-1]
    assert lack.df == 2
    assert lack.chi2 == pytest.approx(2 * (free.log_likelihood - result.log_likelihood))
