"""Ratings that a factor separates: no finite coefficient has the highest likelihood."""

import numpy as np

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
