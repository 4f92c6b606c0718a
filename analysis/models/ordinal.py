"""Cumulative-link mixed model of ratings: logit link, flexible thresholds, crossed random effects."""

from collections.abc import Sequence

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]

from analysis.models.approximation import OFF_COEFFICIENT, OFF_SD, laplace_step
from analysis.models.design import ModelData, model_data
from analysis.models.laplace import LaplaceLikelihood
from analysis.models.ordinal_data import OrdinalData
from analysis.models.ordinal_maximum import Maximum, maximise, newton_step, pooled_start
from analysis.models.ordinal_result import OrdinalResult, RandomTerms, ordinal_result
from analysis.models.quadrature import QuadratureLikelihood
from analysis.models.roles import ModelTerms, Slopes, split_covariates
from analysis.models.separation import refuse_separation, separated_columns
from analysis.models.slopes import slope_groups, unmodelled_slopes
from experiments.errors import InputError

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

MAXIMUM_CATEGORIES = 20
MAX_NODES = 100

NODE_LADDER = (15, 31, 63)
"""Nodes of quadrature that are tried in turn."""

SETTLED = 1e-3
"""Standard errors by which more nodes may move an estimate that counts as converged."""

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
    quadrature: int | None = None,
) -> OrdinalResult:
    """Fit ordered ratings ~ full factorial of the factors + covariates with crossed random effects.

    Parameters are those of `analysis.models.mixed.fit_mixed`; slopes of one effect share one variance over
    its orthonormal contrasts and do not correlate. Categories are the distinct ratings met, in order; a
    rating of the scale that nobody gave has no threshold of its own. A model without items and slopes is
    fitted by adaptive Gauss-Hermite quadrature of each participant's integral, with as many nodes as more
    would change nothing; others by Laplace's approximation, with a note where it is not accurate. With
    `quadrature` there are as many nodes; 1 is Laplace's approximation, without a check.

    Raises
    ------
    InputError
        As there, for quadrature of more than one random term or over 100 nodes, for more than 20 distinct
        ratings, for correlated slopes, and for effects that so few ratings leave undetermined.
    """
    if slopes == "correlated":
        raise InputError("slopes of the ordinal model do not correlate; expected all, main or none")
    items = (item,) if isinstance(item, str) else tuple(item or ())
    _refuse_quadrature(quadrature or 1, items, slopes)
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
        nodes = quadrature or 1
        one_integral = not items and groups == ["intercept"]
        if quadrature is None and one_integral:
            maximum, nodes, said = _by_enough_nodes(ordinal, maximum)
            left_out += said
        elif nodes > 1:
            maximum = maximise(QuadratureLikelihood(ordinal, nodes), maximum.parameters, False)
        first = len(categories) - 1
        _refuse_undetermined(data, np.diag(maximum.covariance)[first : -ordinal.n_sds])
        if quadrature is None and not one_integral:
            left_out += _laplace_notes(data, ordinal, maximum, groups)
    terms = RandomTerms(slopes, tuple(groups))
    return ordinal_result(data, categories, maximum, terms, left_out, nodes)


def _by_enough_nodes(ordinal: OrdinalData, start: Maximum) -> tuple[Maximum, int, list[str]]:
    """The maximum with the fewest nodes of a ladder from which the next step would not move it."""
    maximum = start
    for nodes, more in zip(NODE_LADDER, (*NODE_LADDER[1:], MAX_NODES), strict=True):
        maximum = maximise(QuadratureLikelihood(ordinal, nodes), maximum.parameters, False)
        moved = np.abs(newton_step(QuadratureLikelihood(ordinal, more), maximum))
        errors = np.sqrt(np.maximum(np.diag(maximum.covariance), 0.0))
        if (moved <= SETTLED * errors).all():
            return maximum, nodes, []
    share = float((moved[errors > 0] / errors[errors > 0]).max())
    return (
        maximum,
        nodes,
        [
            f"quadrature is not converged: with {MAX_NODES} nodes an estimate would move by about "
            f"{share:.2g} of its standard error"
        ],
    )


def _laplace_notes(
    data: ModelData, ordinal: OrdinalData, maximum: Maximum, groups: Sequence[str]
) -> list[str]:
    """What exact integrals would move too far, of a model that only Laplace's approximation fits."""
    step = laplace_step(ordinal, maximum, data.items is not None)
    first = ordinal.n_categories - 1
    errors = np.sqrt(np.maximum(np.diag(maximum.covariance), 0.0))
    moved = []
    for name, by, error in zip(data.column_names[1:], step[first:], errors[first:], strict=False):
        if error > 0 and abs(by) > OFF_COEFFICIENT * error:
            size = f"{by:+.2g} ({abs(by) / error:.2g} of its standard error)"
            moved.append(
                f"{name} by {'about ' + size if abs(by) < error else 'more than its standard error'}"
            )
    names = [f"{data.terms.participant} {group}" for group in groups]
    names += [data.items.name] if data.items else []
    for name, by, sd in zip(names, step[-ordinal.n_sds :], maximum.parameters.sd, strict=False):
        if sd > 0 and abs(by) > OFF_SD * sd:
            size = f"about {100 * by / sd:+.0f}%" if abs(by) < sd / 2 else "more than half"
            moved.append(f"the SD of {name} by {size}")
    if not moved:
        return []
    return [
        "Laplace's approximation is not accurate for these ratings: exact integrals would move "
        f"{', '.join(moved)}; a model of participants' intercepts alone is fitted by quadrature"
    ]


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
    if undetermined and (separated := separated_columns(data)):
        raise InputError(_separated(separated))
    if undetermined:
        raise InputError(
            f"the ordinal model has too few ratings or participants to tell {', '.join(undetermined)} apart "
            "from chance; use the linear mixed model, or collect more"
        )
    errors = np.sqrt(variances) * data.x[:, 1:].std(axis=0)
    endless = [name for name, error in zip(names, errors, strict=True) if error > ENDLESS]
    if endless:
        raise InputError(_separated(endless))


def _separated(names: Sequence[str]) -> str:
    return (
        f"ratings are separated: the likelihood rises without end as {', '.join(names)} grow, and an ordinal "
        "model has no finite estimate, however many ratings there are; use analysis mixed, or leave a factor "
        "out"
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
