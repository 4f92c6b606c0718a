"""Ratings that a factor separates: no finite coefficient has the highest likelihood."""

import numpy as np
from scipy import optimize

from analysis.models.design import ModelData
from experiments.errors import InputError


def refuse_separation(data: ModelData) -> None:
    """Refuse a factor some of whose levels have no rating above the lowest of all its others.

    The likelihood of an ordinal model then grows without end as the levels are drawn apart.
    """
    shape = [len(names) for names in data.levels]
    codes = np.unravel_index(data.cell, shape) if shape else ()
    for name, levels, code in zip(data.factors, data.levels, codes, strict=True):
        ratings = [data.rating[code == k] for k in range(len(levels))]
        order = np.argsort([values.mean() for values in ratings])
        for cut in range(1, len(order)):
            top = max(ratings[k].max() for k in order[:cut])
            if top <= min(ratings[k].min() for k in order[cut:]):
                low = ", ".join(levels[k] for k in sorted(order[:cut]))
                raise InputError(
                    f"no rating at {name}={low} lies above any other of {name}: they are separated, and "
                    "an ordinal model has no finite estimate; use analysis mixed, or leave the factor out"
                )


def separated_columns(data: ModelData) -> list[str]:
    """Coefficients along which the likelihood of an ordinal model never falls: without a finite estimate.

    Along a direction of thresholds a and coefficients b the likelihood of no rating falls where
    a[k] >= x'b for each rating of category k, and a[k - 1] <= x'b. A linear program looks for one that raises
    some likelihood. Random effects change nothing: it holds for each of their values.
    """
    categories, codes = np.unique(data.rating, return_inverse=True)
    k, x = len(categories) - 1, data.x[:, 1:]
    distinct = np.unique(np.column_stack([codes, x / np.abs(x).max(axis=0)]), axis=0)
    code, rows = distinct[:, 0].astype(np.int64), distinct[:, 1:]
    of_threshold = np.eye(k)
    below, above = code < k, code > 0
    slack = np.vstack(
        [
            np.hstack([of_threshold[code[below]], -rows[below]]),
            np.hstack([-of_threshold[code[above] - 1], rows[above]]),
            np.hstack([np.diff(of_threshold, axis=0), np.zeros((k - 1, rows.shape[1]))]),
        ]
    )
    # thresholds alone cannot raise a likelihood: every category was given
    solution = optimize.linprog(-slack.sum(axis=0), A_ub=-slack, b_ub=np.zeros(len(slack)), bounds=(-1, 1))
    if solution.x is None or solution.fun is None or solution.fun > -1e-6:
        return []
    names = data.column_names[1:]
    return [name for name, b in zip(names, solution.x[k:], strict=True) if abs(b) > 1e-6]
