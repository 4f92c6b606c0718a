"""Abilities of items and their contrasts."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from analysis.pairs.comparisons import (
    LEFT,
    RIGHT,
    Comparisons,
    Transitivity,
    refuse_disconnected,
    separated_items,
    transitivity,
)
from analysis.pairs.crossed import RandomEffect, crossed_pairs, fit_crossed
from analysis.pairs.intervals import FittedPairs, Intervals, interval_limits, rank_limits
from analysis.pairs.likelihood import (
    TIED,
    Counts,
    Fit,
    Method,
    Model,
    count_by_rater,
    count_outcomes,
    fit,
    free_abilities,
    outcome_gradients,
    sandwich,
)
from analysis.read.text_table import names_in_order, read_text_table, texts_required
from analysis.thresholds.likelihood import fit_p
from analysis.within.adjustments import holm
from analysis.within.contrast_tests import equivalence_p
from analysis.within.level_codes import given_orders
from experiments.errors import InputError

# Abilities as a linear function of the items' factors.

Array = NDArray[np.float64]


@dataclass(frozen=True)
class FactorTest:
    """A likelihood-ratio test of one factor, and its coefficients against its first level.

    `levels` names the levels whose coefficients are in `estimates`; treatment coding, additive.
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
            Where an item is not in the table, or the factors do not distinguish the levels.
        """
        for item in items:
            if item not in self.levels:
                raise InputError(
                    f"{self.source}: there is no row for item '{item}'; every compared item needs one"
                )
        # Treatment coding: the first level of a factor is its reference, and has no column.
        columns = [
            [float(self.levels[item][self.factors.index(factor)] == level) for item in items]
            for factor in self.factors
            if factor != without
            for level in self.names(factor)[1:]
        ]
        # Without a column the array is empty and has to be given its shape.
        design = np.array(columns).T.reshape(len(items), len(columns))
        # The mean is not identified: comparisons only say something about differences.
        centred = design - design.mean(axis=0)
        if design.shape[1] and np.linalg.matrix_rank(centred) < design.shape[1]:
            raise InputError(f"{self.source}: the factors are confounded on these items; remove one")
        return design


def read_item_factors(path: Path, levels: Sequence[str] = ()) -> ItemFactors:
    """Read a CSV whose first column names the item and whose other columns are its factors.

    Parameters
    ----------
    path : Path
        The CSV.
    levels : sequence of str, optional
        Orders of levels, as for `analysis.within.level_codes.given_orders`.

    Raises
    ------
    InputError
        As `read_text_table`; an item twice; a factor with one level.
    """
    table = read_text_table(path, None, copies=False)
    if len(table.header) < 2:
        raise InputError(
            f"{path.name}: expected one column of items and one column per factor, got one column"
        )
    for name in table.header:
        texts_required(table, name, factor=name != table.header[0])
    rows = table.columns.astype(str).to_numpy()
    names = [str(row[0]) for row in rows]
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"{path.name}: item '{name}' has two rows; give each item one")
    # Every row counts here: an item without comparisons still gives its level a place.
    everywhere = np.ones(len(rows), dtype=np.bool_)
    # The order in the file first, so that an order given by --levels replaces it.
    orders = {name: names_in_order(table.columns[name], everywhere) for name in table.header[1:]}
    orders |= given_orders(orders, levels)[0]
    of_items = {str(row[0]): tuple(row[1:]) for row in rows}
    factors = ItemFactors(tuple(table.header[1:]), of_items, path.name, orders)
    for factor in factors.factors:
        if len(factors.names(factor)) < 2:
            raise InputError(f"{path.name}: factor '{factor}' has only one level; remove it")
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
        # Without that factor and otherwise the same: the two models differ in its coefficients alone.
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
    # Free abilities are the largest model of these items: what they fit better the factors miss.
    free = fit(Model(model.method, free_abilities(len(items)), model.order_effect), counts)
    # No df where the factors have as many coefficients as there are items to tell apart.
    chi2, df = 2 * (free.log_likelihood - whole.log_likelihood), len(items) - 1 - model.design.shape[1]
    p = float(stats.chi2.sf(max(0.0, chi2), df)) if df > 0 else float("nan")
    return (*tests, FactorTest("lack of fit", "", (), (), (), chi2, df, p))


# What a model of paired comparisons gives: abilities, contrasts, parameters, fit.


@dataclass(frozen=True)
class Item:
    """One item: ability against the first item in sorted order, on the method's scale.

    `rank_low` and `rank_high` are the ranks that anytime-valid intervals leave open; None of other intervals.
    """

    name: str
    ability: float
    se: float
    p: float
    ci_low: float
    ci_high: float
    se_robust: float | None
    se_centred: float
    centred: float
    rank: int
    wins: int
    losses: int
    ties: int
    rank_low: int | None = None
    rank_high: int | None = None


@dataclass(frozen=True)
class Contrast:
    """Difference of two abilities, and its Holm-corrected p.

    `se_robust` has raters as clusters, `p_robust` is its t test on as many df as raters less one,
    `p_robust_holm` corrected like the model's. `p_equivalence` is that of two one-sided tests, with raters as
    clusters where they are known; None without bounds.
    """

    first: str
    second: str
    difference: float
    se: float
    z: float
    p: float
    p_holm: float
    se_robust: float | None = None
    p_robust: float | None = None
    p_robust_holm: float | None = None
    ci_low: float = float("nan")
    ci_high: float = float("nan")
    p_equivalence: float | None = None


@dataclass(frozen=True)
class Parameter:
    """One more parameter of the model, or a test of it."""

    estimate: float
    se: float
    z: float
    p: float
    ci_low: float = float("nan")
    ci_high: float = float("nan")


@dataclass(frozen=True)
class Goodness:
    """Likelihood-ratio statistic against the saturated model of the pairs."""

    deviance: float
    df: int
    p: float
    ordered: bool


@dataclass(frozen=True)
class PairsResult:
    """Everything `analysis pairs` knows of a table; `docs/explanation/analysis.md` says what each key is."""

    method: Method
    scale: str
    reference: str
    items: tuple[Item, ...]
    contrasts: tuple[Contrast, ...]
    covariance: tuple[tuple[float, ...], ...]
    n_comparisons: int
    n_ties: int
    n_participants: int | None
    log_likelihood: float
    goodness: Goodness
    order_effect: Parameter | None
    log_nu: Parameter | None
    tie_probability_max: float | None
    factors: tuple[FactorTest, ...]
    transitivity: Transitivity
    firth: bool
    decisions: tuple[str, ...] = field(default_factory=tuple)
    log_theta: Parameter | None = None
    intervals: Intervals = "wald"
    random_effects: tuple[RandomEffect, ...] = ()


SCALES: dict[Method, str] = {
    "bradley-terry": "log odds of winning",
    "davidson": "log odds of winning, given that there is no tie",
    "rao-kupper": "log odds of winning, beyond the threshold of a tie",
    "thurstone": "standard deviations of the difference of two items (case V; x 1.414 for those of an item)",
}


# How well a model of paired comparisons fits the pairs.


def goodness_of_fit(model: Model, counts: Counts, fitted: Fit) -> Goodness:
    """Compare with the saturated model of the pairs: only this pair form allows a test of fit.

    Pairs are taken together over their two orders unless the model has an order effect.
    """
    outcomes, expected = counts.outcomes, counts.totals[:, None] * fitted.shares
    if not model.order_effect:
        outcomes, expected = _unordered(counts, outcomes), _unordered(counts, expected)
    # An outcome that never came adds 0 log 0 = 0.
    ratio = np.where(outcomes > 0, outcomes / np.where(expected > 0, expected, 1.0), 1.0)
    deviance = float(2 * np.sum(outcomes * np.log(ratio)))
    df = outcomes.shape[0] * (outcomes.shape[1] - 1) - model.names
    return Goodness(deviance, df, fit_p(deviance, df, outcomes.sum(axis=1)), model.order_effect)


def _unordered(counts: Counts, values: Array) -> Array:
    """Add up both orders of a pair (m, o): the item that comes first in the alphabet as the left one."""
    # A pair shown as b-a is the pair a-b with its winner turned round.
    swapped = counts.left > counts.right
    turned = values.copy()
    turned[swapped, LEFT], turned[swapped, RIGHT] = values[swapped, RIGHT], values[swapped, LEFT]
    # Both orders of a pair now have one key.
    low, high = np.minimum(counts.left, counts.right), np.maximum(counts.left, counts.right)
    _, index = np.unique(np.stack([low, high]), axis=1, return_inverse=True)
    total = np.zeros((int(index.max()) + 1, values.shape[1]))
    np.add.at(total, index.ravel(), turned)
    return total


def fit_abilities(
    comparisons: Comparisons,
    method: Method = "bradley-terry",
    *,
    order_effect: bool = False,
    firth: bool = False,
    factors: ItemFactors | None = None,
    intervals: Intervals = "wald",
    samples: int = 500,
    crossed: bool = False,
    equivalence: tuple[float, float] | None = None,
) -> PairsResult:
    """Fit a model of paired comparisons.

    Parameters
    ----------
    comparisons : Comparisons
    method : {"bradley-terry", "davidson", "rao-kupper", "thurstone"}
    order_effect : bool
        Whether the left (first) side has a separate advantage.
    firth : bool
        Firth's penalized likelihood (Bradley-Terry only).
    factors : ItemFactors, optional
        Abilities as a linear function of the items' factors.
    intervals : {"wald", "profile", "bootstrap", "anytime"}
        How the 95% limits of abilities, differences and parameters are found (`analysis.pairs.intervals`).
    samples : int
        Samples of the bootstrap.
    crossed : bool
        Whether raters (and contents, and items beyond their factors) have random effects
        (`analysis.pairs.crossed`); Bradley-Terry and Rao-Kupper only, Wald intervals.
    equivalence : tuple of float, optional
        Bounds of equivalence of two abilities, on the method's scale.

    Raises
    ------
    InputError
        Items that were never compared with the rest; an item that always wins (without `firth`); ties under a
        method that has none.
    """
    _refuse_unfit(comparisons, method, firth)
    if crossed and (firth or intervals != "wald" or method not in ("bradley-terry", "rao-kupper")):
        raise InputError(
            "--crossed is for --method bradley-terry or rao-kupper, without --firth and with Wald intervals"
        )
    ties = method in TIED
    counts = count_outcomes(comparisons, ties=ties)
    # Without factors every item but the first has a separate ability.
    design = free_abilities(len(comparisons.items)) if factors is None else factors.design(comparisons.items)
    model = Model(method, design, order_effect)
    fitted = fit(model, counts, firth=firth)
    effects: tuple[RandomEffect, ...] = ()
    said: tuple[str, ...] = ()
    if crossed:
        data = crossed_pairs(comparisons, model, items_vary=factors is not None)
        fitted, effects, said = fit_crossed(data, fitted)
    # Rows of all parameters, with zeros for what is not an ability (order, ties).
    full = np.zeros((len(comparisons.items), model.names))
    full[:, : design.shape[1]] = design
    # Random effects of raters already allow for their clustering.
    robust = None if crossed else _robust(comparisons, model, fitted, counts)
    pairs = FittedPairs(comparisons, model, counts, fitted, robust, firth)
    raters = len(comparisons.participants)
    k, extra = len(comparisons.items), np.eye(model.names)[design.shape[1] :]
    # Limits of differences are not those of abilities: two abilities share the reference item's error.
    differences = [full[first] - full[second] for first, second in combinations(range(k), 2)]
    limits, notes = interval_limits(pairs, np.stack([*full, *differences, *extra]), intervals, samples)
    always = separated_items(comparisons) if firth else None
    if always:
        notes.insert(0, f"{always}: only Firth's penalty keeps the ability finite")
    # Limits come in the order in which they were asked for: items, pairs, further parameters.
    of_pairs = limits[k : len(limits) - len(extra)]
    ranks = rank_limits(k, of_pairs) if intervals == "anytime" else None
    tie = _parameter(fitted, -1, limits) if ties else None
    # Davidson's nu, or Rao and Kupper's theta
    size = float(np.exp(fitted.parameters[-1]))
    tie_probability = size / (2 + size) if method == "davidson" else (size - 1) / (size + 1)
    return PairsResult(
        method,
        SCALES[method],
        comparisons.items[0],
        _items(comparisons, fitted, full, robust, limits, ranks),
        _with_equivalence(_contrasts(comparisons, full, fitted, robust, of_pairs), raters, equivalence),
        tuple(tuple(row) for row in (full @ fitted.covariance @ full.T).tolist()),
        comparisons.outcome.size,
        comparisons.ties,
        len(comparisons.participants) if comparisons.participant is not None else None,
        fitted.log_likelihood,
        Goodness(float("nan"), 0, float("nan"), order_effect)
        if crossed
        else goodness_of_fit(model, counts, fitted),
        _parameter(fitted, design.shape[1], limits) if order_effect else None,
        tie if method == "davidson" else None,
        tie_probability if ties else None,
        () if factors is None or crossed else factor_tests(comparisons.items, factors, model, counts),
        transitivity(comparisons),
        firth,
        (*comparisons.decisions, *said, *notes),
        tie if method == "rao-kupper" else None,
        intervals,
        effects,
    )


def _refuse_unfit(comparisons: Comparisons, method: Method, firth: bool) -> None:
    if len(comparisons.items) < 2:
        raise InputError(
            f"{comparisons.source}: expected two items or more, got '{comparisons.items[0]}' alone"
        )
    if comparisons.ties and method not in TIED:
        raise InputError(
            f"{comparisons.source}: {comparisons.ties} comparisons are ties, which {method} does not "
            "support; use --method davidson or rao-kupper"
        )
    if comparisons.ties == comparisons.outcome.size:
        raise InputError(
            f"{comparisons.source}: every comparison is a tie, so items do not differ and the frequency "
            "of ties has no finite estimate; there is nothing to fit"
        )
    if not comparisons.ties and method in TIED:
        raise InputError(f"{comparisons.source}: no comparison is a tie; use --method bradley-terry")
    if firth and method != "bradley-terry":
        raise InputError(f"--firth is for --method bradley-terry, got {method}")
    refuse_disconnected(comparisons)
    always = separated_items(comparisons)
    if always and not firth:
        raise InputError(
            f"{comparisons.source}: {always}, so no finite ability fits; add --firth for finite estimates "
            "(--method bradley-terry), or remove the item"
        )


def _items(
    comparisons: Comparisons,
    fitted: Fit,
    full: Array,
    robust: Array | None,
    limits: Array,
    rank_ends: list[tuple[int, int]] | None,
) -> tuple[Item, ...]:
    # The first item is 0 by definition, without a standard error.
    abilities = full @ fitted.parameters
    standard = np.sqrt(np.clip(np.diag(full @ fitted.covariance @ full.T), 0.0, None))
    # Against the mean of all items no item is special, and the first has an error, too.
    centring = full - full.mean(axis=0)
    centred = np.sqrt(np.clip(np.diag(centring @ fitted.covariance @ centring.T), 0.0, None))
    spread = None if robust is None else np.sqrt(np.clip(np.diag(full @ robust @ full.T), 0.0, None))
    # Rounded: abilities that are equal by symmetry differ in the last digits.
    ranks = stats.rankdata(-np.round(abilities, 10), method="min").astype(int)
    return tuple(
        Item(
            name,
            float(abilities[k]),
            float(standard[k]),
            _two_sided(abilities[k], standard[k]),
            float(limits[k, 0]),
            float(limits[k, 1]),
            None if spread is None else float(spread[k]),
            float(centred[k]),
            float(abilities[k] - abilities.mean()),
            int(ranks[k]),
            *_record(comparisons, k),
            *(rank_ends[k] if rank_ends is not None else ()),
        )
        for k, name in enumerate(comparisons.items)
    )


def _two_sided(estimate: float, se: float) -> float:
    return float(2 * stats.norm.sf(abs(estimate) / se)) if se > 0 else float("nan")


def _record(comparisons: Comparisons, item: int) -> tuple[int, int, int]:
    on_left, on_right = comparisons.left == item, comparisons.right == item
    for_left, for_right = comparisons.outcome == LEFT, comparisons.outcome == RIGHT
    # Counted from the comparisons, not the model: a reader can check them in the file.
    won = int(np.sum((on_left & for_left) | (on_right & for_right)))
    lost = int(np.sum((on_left & for_right) | (on_right & for_left)))
    return won, lost, int(np.sum(on_left | on_right)) - won - lost


def _robust(comparisons: Comparisons, model: Model, fitted: Fit, counts: Counts) -> Array | None:
    """The sandwich covariance, raters as clusters; None without raters to tell apart."""
    if comparisons.participant is None or len(comparisons.participants) < 2:
        return None
    # The score of a comparison depends only on its pair and outcome; raters differ in how often they gave
    # which.
    gradients = outcome_gradients(model, counts, fitted).reshape(-1, model.names)
    clusters = np.asarray(count_by_rater(comparisons, counts) @ gradients, dtype=np.float64)
    return sandwich(fitted, clusters)


def _contrasts(
    comparisons: Comparisons, full: Array, fitted: Fit, robust: Array | None, limits: Array
) -> tuple[Contrast, ...]:
    items, rows = comparisons.items, []
    clustered: list[tuple[float | None, float | None]] = []
    for first, second in combinations(range(len(items)), 2):
        contrast = full[first] - full[second]
        se = float(np.sqrt(max(0.0, contrast @ fitted.covariance @ contrast)))
        difference = float(contrast @ fitted.parameters)
        # The reference against itself, or two items that the factors do not tell apart, have no error.
        z = difference / se if se > 0 else float("nan")
        rows.append((items[first], items[second], difference, se, z, _two_sided(difference, se)))
        clustered.append(_clustered(difference, contrast, robust, len(comparisons.participants)))
    # A contrast without a standard error is not tested, and does not count among those to adjust for.
    p = _holm([row[-1] if np.isfinite(row[-1]) else None for row in rows])
    robust_p = _holm([p for _, p in clustered])
    return tuple(
        Contrast(*row, float("nan") if own is None else own, *more, of_raters, float(low), float(high))
        for row, own, more, of_raters, (low, high) in zip(rows, p, clustered, robust_p, limits, strict=True)
    )


def _with_equivalence(
    contrasts: tuple[Contrast, ...], raters: int, bounds: tuple[float, float] | None
) -> tuple[Contrast, ...]:
    if bounds is None:
        return contrasts
    tested = []
    for c in contrasts:
        # With raters known the test has them as clusters, and as many df as raters less one.
        se, df = (c.se, float("inf")) if c.se_robust is None else (c.se_robust, float(raters - 1))
        p = equivalence_p(c.difference, se, df, bounds) if se > 0 else None
        tested.append(replace(c, p_equivalence=p))
    return tuple(tested)


def _holm(p: list[float | None]) -> list[float | None]:
    """Those that there are, corrected for their number."""
    # Holm orders the p values that exist; others keep their place.
    told = [value for value in p if value is not None]
    corrected = iter(holm(np.array(told)).tolist() if told else [])
    return [None if value is None else next(corrected) for value in p]


def _clustered(
    difference: float, contrast: Array, robust: Array | None, raters: int
) -> tuple[float | None, float | None]:
    """The standard error with raters as clusters and its p; None without raters, p None without variance."""
    if robust is None:
        return None, None
    # Rounding may leave a variance slightly below zero.
    se = float(np.sqrt(max(0.0, float(contrast @ robust @ contrast))))
    return se, float(2 * stats.t.sf(abs(difference) / se, raters - 1)) if se > 0 else None


def _parameter(fitted: Fit, index: int, limits: Array) -> Parameter:
    """A parameter by its index; the last rows of the limits are those of the last parameters."""
    estimate, se = float(fitted.parameters[index]), float(np.sqrt(fitted.covariance[index, index]))
    low, high = limits[index if index < 0 else index - fitted.parameters.size]
    return Parameter(estimate, se, estimate / se, _two_sided(estimate, se), float(low), float(high))
