"""Abilities of items and their contrasts."""

from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from analysis.pairs.comparisons import LEFT, RIGHT, Comparisons
from analysis.pairs.connected import refuse_disconnected, separated
from analysis.pairs.factors import ItemFactors, factor_tests
from analysis.pairs.goodness import goodness_of_fit
from analysis.pairs.likelihood import (
    Counts,
    Fit,
    Method,
    Model,
    counted,
    fit,
    free_abilities,
    sandwich,
    scores,
)
from analysis.pairs.pairs_result import SCALES, Contrast, Item, PairsResult, Parameter
from analysis.pairs.transitivity import transitivity
from analysis.within.adjustments import holm
from experiments.errors import InputError

Array = NDArray[np.float64]
Z_95 = float(stats.norm.ppf(0.975))


def fit_abilities(
    comparisons: Comparisons,
    method: Method = "bradley-terry",
    *,
    order_effect: bool = False,
    firth: bool = False,
    factors: ItemFactors | None = None,
) -> PairsResult:
    """Fit a model of paired comparisons.

    Parameters
    ----------
    comparisons : Comparisons
    method : {"bradley-terry", "davidson", "thurstone"}
    order_effect : bool
        Whether the left (first) side has an advantage of its own.
    firth : bool
        Firth's penalised likelihood (Bradley-Terry only).
    factors : ItemFactors, optional
        Abilities as a linear function of the items' factors.

    Raises
    ------
    InputError
        Items that were never compared with the rest; an item that always wins (without `firth`); ties under a
        method that has none.
    """
    _refuse_unfit(comparisons, method, firth)
    ties = method == "davidson"
    counts = counted(comparisons, ties=ties)
    design = free_abilities(len(comparisons.items)) if factors is None else factors.design(comparisons.items)
    model = Model(method, design, order_effect)
    fitted = fit(model, counts, firth=firth)
    full = np.zeros((len(comparisons.items), model.names))
    full[:, : design.shape[1]] = design
    robust = _robust(comparisons, model, fitted, counts)
    return PairsResult(
        method,
        SCALES[method],
        comparisons.items[0],
        _items(comparisons, fitted, full, robust),
        _contrasts(comparisons, full, fitted, robust),
        tuple(tuple(row) for row in (full @ fitted.covariance @ full.T).tolist()),
        comparisons.outcome.size,
        comparisons.ties,
        len(comparisons.participants) if comparisons.participant is not None else None,
        fitted.log_likelihood,
        goodness_of_fit(model, counts, fitted),
        _parameter(fitted, design.shape[1]) if order_effect else None,
        _parameter(fitted, -1) if ties else None,
        float(np.exp(fitted.parameters[-1]) / (2 + np.exp(fitted.parameters[-1]))) if ties else None,
        () if factors is None else factor_tests(comparisons.items, factors, model, counts),
        transitivity(comparisons),
        firth,
        comparisons.decisions,
    )


def _refuse_unfit(comparisons: Comparisons, method: Method, firth: bool) -> None:
    if len(comparisons.items) < 2:
        raise InputError(
            f"{comparisons.source}: expected two items or more, got '{comparisons.items[0]}' alone"
        )
    if comparisons.ties and method != "davidson":
        raise InputError(
            f"{comparisons.source}: {comparisons.ties} comparisons are ties, which {method} does not know; "
            "use --method davidson"
        )
    if not comparisons.ties and method == "davidson":
        raise InputError(f"{comparisons.source}: no comparison is a tie; use --method bradley-terry")
    if firth and method != "bradley-terry":
        raise InputError(f"--firth is for --method bradley-terry, got {method}")
    refuse_disconnected(comparisons)
    always = separated(comparisons)
    if always and not firth:
        raise InputError(
            f"{comparisons.source}: {always}, so that no finite ability fits; add --firth for finite "
            "estimates (--method bradley-terry), or leave the item out"
        )


def _items(comparisons: Comparisons, fitted: Fit, full: Array, robust: Array | None) -> tuple[Item, ...]:
    abilities = full @ fitted.parameters
    standard = np.sqrt(np.clip(np.diag(full @ fitted.covariance @ full.T), 0.0, None))
    centring = full - full.mean(axis=0)
    centred = np.sqrt(np.clip(np.diag(centring @ fitted.covariance @ centring.T), 0.0, None))
    spread = None if robust is None else np.sqrt(np.clip(np.diag(full @ robust @ full.T), 0.0, None))
    ranks = stats.rankdata(-np.round(abilities, 10), method="min").astype(int)
    return tuple(
        Item(
            name,
            float(abilities[k]),
            float(standard[k]),
            _two_sided(abilities[k], standard[k]),
            float(abilities[k] - Z_95 * standard[k]),
            float(abilities[k] + Z_95 * standard[k]),
            None if spread is None else float(spread[k]),
            float(centred[k]),
            float(abilities[k] - abilities.mean()),
            int(ranks[k]),
            *_record(comparisons, k),
        )
        for k, name in enumerate(comparisons.items)
    )


def _two_sided(estimate: float, se: float) -> float:
    return float(2 * stats.norm.sf(abs(estimate) / se)) if se > 0 else float("nan")


def _record(comparisons: Comparisons, item: int) -> tuple[int, int, int]:
    on_left, on_right = comparisons.left == item, comparisons.right == item
    for_left, for_right = comparisons.outcome == LEFT, comparisons.outcome == RIGHT
    won = int(np.sum((on_left & for_left) | (on_right & for_right)))
    lost = int(np.sum((on_left & for_right) | (on_right & for_left)))
    return won, lost, int(np.sum(on_left | on_right)) - won - lost


def _robust(comparisons: Comparisons, model: Model, fitted: Fit, counts: Counts) -> Array | None:
    """The sandwich covariance, raters as clusters; None without raters to tell apart."""
    if comparisons.participant is None or len(comparisons.participants) < 2:
        return None
    z = scores(model, counts.left, counts.right)
    pair = {
        (int(left), int(right)): index
        for index, (left, right) in enumerate(zip(counts.left, counts.right, strict=True))
    }
    sides = zip(comparisons.left.tolist(), comparisons.right.tolist(), strict=True)
    index = np.array([pair[one] for one in sides])
    if model.method == "thurstone":
        difference = z[index, LEFT] - z[index, RIGHT]
        eta = difference @ fitted.parameters
        sign = np.where(comparisons.outcome == LEFT, 1.0, -1.0)
        rows = (sign * np.exp(stats.norm.logpdf(eta) - stats.norm.logcdf(sign * eta)))[:, None] * difference
    else:
        expected = np.einsum("mo,mop->mp", fitted.shares, z)
        rows = z[index, comparisons.outcome] - expected[index]
    count = len(comparisons.participants)
    clusters = np.zeros((count, rows.shape[1]))
    np.add.at(clusters, comparisons.participant, rows)
    return sandwich(fitted, clusters)


def _contrasts(
    comparisons: Comparisons, full: Array, fitted: Fit, robust: Array | None
) -> tuple[Contrast, ...]:
    items, rows = comparisons.items, []
    clustered: list[tuple[float | None, float | None]] = []
    for first, second in combinations(range(len(items)), 2):
        contrast = full[first] - full[second]
        se = float(np.sqrt(max(0.0, contrast @ fitted.covariance @ contrast)))
        difference = float(contrast @ fitted.parameters)
        z = difference / se if se > 0 else float("nan")
        rows.append((items[first], items[second], difference, se, z, _two_sided(difference, se)))
        clustered.append(_clustered(difference, contrast, robust, len(comparisons.participants)))
    p = _holm([row[-1] if np.isfinite(row[-1]) else None for row in rows])
    robust_p = _holm([p for _, p in clustered])
    return tuple(
        Contrast(*row, float("nan") if own is None else own, *more, of_raters)
        for row, own, more, of_raters in zip(rows, p, clustered, robust_p, strict=True)
    )


def _holm(p: list[float | None]) -> list[float | None]:
    """Those that there are, corrected for their number."""
    told = [value for value in p if value is not None]
    corrected = iter(holm(np.array(told)).tolist() if told else [])
    return [None if value is None else next(corrected) for value in p]


def _clustered(
    difference: float, contrast: Array, robust: Array | None, raters: int
) -> tuple[float | None, float | None]:
    """The standard error with raters as clusters and its p; None without raters, p None without variance."""
    if robust is None:
        return None, None
    se = float(np.sqrt(max(0.0, float(contrast @ robust @ contrast))))
    return se, float(2 * stats.t.sf(abs(difference) / se, raters - 1)) if se > 0 else None


def _parameter(fitted: Fit, index: int) -> Parameter:
    estimate, se = float(fitted.parameters[index]), float(np.sqrt(fitted.covariance[index, index]))
    return Parameter(estimate, se, estimate / se, _two_sided(estimate, se))
