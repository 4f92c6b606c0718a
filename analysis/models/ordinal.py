"""Cumulative-link mixed model of ratings: logit link, flexible thresholds, crossed random effects."""

from collections.abc import Sequence

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]

from analysis.models.design import ModelData, model_data
from analysis.models.laplace import LaplaceLikelihood
from analysis.models.ordinal_data import OrdinalData
from analysis.models.ordinal_maximum import maximise, pooled_start
from analysis.models.ordinal_result import OrdinalResult, RandomTerms, ordinal_result
from analysis.models.quadrature import QuadratureLikelihood
from analysis.models.roles import ModelTerms, Slopes, split_covariates
from analysis.models.separation import refuse_separation
from analysis.models.slopes import slope_groups, unmodelled_slopes
from experiments.errors import InputError

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

MAXIMUM_CATEGORIES = 20
MAX_NODES = 100

ENDLESS = 20.0
"""A standard error, in logits a standard deviation of its column, of an estimate without a finite maximum.

Of separated cells it was 900 and more, of other data below 6.
"""


def fit_ordinal(
    rows: pd.DataFrame,
    participant: str,
    rating: str,
    within: Sequence[str],
    item: str | Sequence[str] | None = None,
    slopes: Slopes = "none",
    between: Sequence[str] = (),
    covariates: Sequence[str] = (),
    quadrature: int = 1,
) -> OrdinalResult:
    """Fit ordered ratings ~ full factorial of the factors + covariates with crossed random effects (Laplace).

    Parameters are those of `analysis.models.mixed.fit_mixed`; slopes of one effect share one variance over
    its orthonormal contrasts and do not correlate. Categories are the distinct ratings met, in order; a
    rating of the scale that nobody gave has no threshold of its own. With `quadrature` nodes (more than 1)
    the integral over each participant's intercept is adaptive Gauss-Hermite quadrature, which needs a model
    without items and slopes.

    Raises
    ------
    InputError
        As there, for quadrature of more than one random term or over 100 nodes, for more than 20 distinct
        ratings, for correlated slopes, and for effects that so few ratings leave undetermined.
    """
    if slopes == "correlated":
        raise InputError("slopes of the ordinal model do not correlate; expected all, main or none")
    items = (item,) if isinstance(item, str) else tuple(item or ())
    _refuse_quadrature(quadrature, items, slopes)
    numbers, interactions = split_covariates(covariates, (*within, *between))
    columns = ModelTerms(
        participant, rating, tuple(within), items, tuple(between), numbers, interactions=interactions
    )
    data = model_data(rows, columns)
    categories, codes = np.unique(data.rating, return_inverse=True)
    if len(categories) > MAXIMUM_CATEGORIES:
        raise InputError(
            f"expected at most {MAXIMUM_CATEGORIES} distinct ratings, got {len(categories)}; "
            "use the linear mixed model for continuous ratings"
        )
    refuse_separation(data)
    groups, left_out = slope_groups(data, slopes)
    left_out += unmodelled_slopes(data, slopes)
    ordinal = _ordinal_data(data, codes.astype(np.int64), len(categories), groups)
    # matrices this small only wait for a second thread
    with threadpool_limits(1, "blas"):
        maximum = maximise(LaplaceLikelihood(ordinal), pooled_start(ordinal, bool(items)), bool(items))
        if quadrature > 1:
            maximum = maximise(QuadratureLikelihood(ordinal, quadrature), maximum.parameters, False)
    first = len(categories) - 1
    _refuse_undetermined(data, np.diag(maximum.covariance)[first : -ordinal.n_sds])
    terms = RandomTerms(slopes, tuple(groups))
    return ordinal_result(data, categories, maximum, terms, left_out, quadrature)


def _refuse_quadrature(nodes: int, items: Sequence[str], slopes: Slopes) -> None:
    if not 1 <= nodes <= MAX_NODES:
        raise InputError(f"expected 1 to {MAX_NODES} nodes of quadrature, got {nodes}")
    if nodes > 1 and (items or slopes != "none"):
        further = f"the item {', '.join(items)}" if items else "slopes"
        raise InputError(
            f"quadrature is for participants' intercepts alone, and the model has {further} too; "
            "use Laplace's approximation (1 node), or leave these out"
        )


def _refuse_undetermined(data: ModelData, variances: Floats) -> None:
    # A flat likelihood has no curvature: the estimate is where the search stopped, and its error unknown.
    names = data.column_names[1:]
    undetermined = [name for name, v in zip(names, variances, strict=True) if not v > 0]
    if undetermined:
        raise InputError(
            f"the ordinal model has too few ratings or participants to tell {', '.join(undetermined)} apart "
            "from chance; use the linear mixed model, or collect more"
        )
    errors = np.sqrt(variances) * data.x[:, 1:].std(axis=0)
    endless = [name for name, error in zip(names, errors, strict=True) if error > ENDLESS]
    if endless:
        raise InputError(
            f"ratings are separated: the likelihood rises without end as {', '.join(endless)} grow, and an "
            "ordinal model has no finite estimate; use analysis mixed, or leave a factor out"
        )


def _ordinal_data(data: ModelData, codes: Integers, n_categories: int, groups: Sequence[str]) -> OrdinalData:
    term = np.concatenate([np.full(len(data.columns(group)), k) for k, group in enumerate(groups)])
    people, items = data.participants, data.items
    return OrdinalData(
        data.x[:, 1:],
        data.slope_columns(groups),
        term.astype(np.int64),
        codes,
        people.codes,
        np.zeros(len(codes), np.int64) if items is None else items.codes,
        n_categories,
        len(people.names),
        1 if items is None else len(items.names),
    )
