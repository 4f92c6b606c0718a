"""Ratings that a mixed model repeats to the last digit: without residual variance nothing is tested."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import numpy as np
from scipy import sparse
from scipy.sparse import linalg

from analysis.models.design import ModelData
from analysis.models.terms import Term
from experiments.errors import InputError

EXACT = 1e-8
"""Residuals below this share of the ratings' spread are rounding."""


@contextmanager
def refused_where_exact(data: ModelData, terms: Sequence[Term]) -> Iterator[None]:
    """Say why a fit in this block divides by zero or a singular matrix.

    Raises
    ------
    InputError
        Where fixed effects and random terms together leave no residual; other errors pass.
    """
    try:
        yield
    except (np.linalg.LinAlgError, ZeroDivisionError) as error:
        columns = sparse.hstack([sparse.csr_matrix(data.x), *(term.matrix() for term in terms)], format="csr")
        residual = float(linalg.lsqr(columns, data.rating, atol=1e-12, btol=1e-12)[3])
        if residual > EXACT * float(np.linalg.norm(data.rating - data.rating.mean())):
            raise
        raise InputError(
            "the ratings have no residual variance: factors, people and items repeat every one exactly, "
            "as where each person gives one rating throughout; check the rating column"
        ) from error
