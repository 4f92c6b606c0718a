"""Abilities as a linear function of the items' factors."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from analysis.pairs.likelihood import Counts, Model, fit, free_abilities
from analysis.read.text_table import names_in_order, read_text_table, texts_required
from experiments.errors import InputError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class FactorTest:
    """A likelihood-ratio test of one factor, and its coefficients against its first level.

    `levels` names the levels whose coefficients stand in `estimates`; treatment coding, additive.
    """

    factor: str
    reference: str
    levels: tuple[str, ...]
    estimates: tuple[float, ...]
    standard_errors: tuple[float, ...]
    chi2: float
    df: int
    p: float


@dataclass(frozen=True)
class ItemFactors:
    """The level of each item in each factor; `orders` has the levels of a factor, the first the reference.

    A factor without an order has its levels sorted as text.
    """

    factors: tuple[str, ...]
    levels: dict[str, tuple[str, ...]]
    source: str
    orders: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    def names(self, factor: str) -> tuple[str, ...]:
        """Levels of a factor that items have, in order."""
        index = self.factors.index(factor)
        there = {levels[index] for levels in self.levels.values()}
        return tuple(name for name in self.orders.get(factor, sorted(there)) if name in there)

    def design(self, items: tuple[str, ...], without: str | None = None) -> Array:
        """Return the treatment-coded design (k, p) of the items, without one factor if asked.

        Raises
        ------
        InputError
            Where an item is not in the table, or the factors do not tell the levels apart.
        """
        for item in items:
            if item not in self.levels:
                raise InputError(f"{self.source}: no row for item '{item}'; every compared item needs one")
        columns = [
            [float(self.levels[item][self.factors.index(factor)] == level) for item in items]
            for factor in self.factors
            if factor != without
            for level in self.names(factor)[1:]
        ]
        design = np.array(columns).T.reshape(len(items), len(columns))
        centred = design - design.mean(axis=0)
        if design.shape[1] and np.linalg.matrix_rank(centred) < design.shape[1]:
            raise InputError(f"{self.source}: the factors cannot be told apart on these items; leave one out")
        return design


def read_item_factors(path: Path) -> ItemFactors:
    """Read a CSV whose first column names the item and whose other columns are its factors.

    Raises
    ------
    InputError
        As `read_text_table`; an item twice; a factor with one level.
    """
    table = read_text_table(path, None, copies=False)
    if len(table.header) < 2:
        raise InputError(f"{path.name}: expected a column of items and a column a factor, got one column")
    for name in table.header:
        texts_required(table, name, factor=name != table.header[0])
    rows = table.columns.astype(str).to_numpy()
    names = [str(row[0]) for row in rows]
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"{path.name}: item '{name}' has two rows; give each item one")
    everywhere = np.ones(len(rows), dtype=np.bool_)
    orders = {name: names_in_order(table.columns[name], everywhere) for name in table.header[1:]}
    levels = {str(row[0]): tuple(row[1:]) for row in rows}
    factors = ItemFactors(tuple(table.header[1:]), levels, path.name, orders)
    for factor in factors.factors:
        if len(factors.names(factor)) < 2:
            raise InputError(f"{path.name}: factor '{factor}' has one level only; leave it out")
    return factors


def factor_tests(
    items: tuple[str, ...], factors: ItemFactors, model: Model, counts: Counts
) -> tuple[FactorTest, ...]:
    """Test each factor by leaving it out, and last all of them against free abilities (lack of fit)."""
    whole = fit(model, counts)
    tests, column = [], 0
    for factor in factors.factors:
        names = factors.names(factor)
        own = slice(column, column + len(names) - 1)
        column += len(names) - 1
        smaller = fit(Model(model.method, factors.design(items, factor), model.order_effect), counts)
        chi2 = 2 * (whole.log_likelihood - smaller.log_likelihood)
        errors = np.sqrt(np.diag(whole.covariance)[own])
        tests.append(
            FactorTest(
                factor,
                names[0],
                names[1:],
                tuple(whole.parameters[own].tolist()),
                tuple(errors.tolist()),
                chi2,
                len(names) - 1,
                float(stats.chi2.sf(max(0.0, chi2), len(names) - 1)),
            )
        )
    free = fit(Model(model.method, free_abilities(len(items)), model.order_effect), counts)
    chi2, df = 2 * (free.log_likelihood - whole.log_likelihood), len(items) - 1 - model.design.shape[1]
    p = float(stats.chi2.sf(max(0.0, chi2), df)) if df > 0 else float("nan")
    return (*tests, FactorTest("lack of fit", "", (), (), (), chi2, df, p))
