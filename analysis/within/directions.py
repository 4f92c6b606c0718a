"""Which directions between participants each term of a design is tested on."""

import numpy as np
from numpy.typing import NDArray

from analysis.within.between import BetweenDesign, outside

Floats = NDArray[np.float64]


def term_directions(design: BetweenDesign, sum_of_squares: int) -> list[Floats]:
    """Orthonormal directions (r, N) in participant space that each term of the design is tested on.

    Type III: what the term adds to all other terms. Type II: what it adds to all terms that do not contain
    it, so that the intercept adds to nothing. For scores z the hypothesis matrix is (U z)' (U z).
    """
    left, singular, right = design.decomposed
    if len(design.terms) == 1:
        return [left.T]
    if sum_of_squares == 3 and design.well_conditioned:
        # the rows of X^+ that belong to a term are what it adds to all others
        inverse = (right.T / singular) @ left.T
        return [_orthonormal(inverse[own[0] : own[-1] + 1]) for own in design.columns]
    return [
        outside(design.matrix[:, own], design.matrix[:, reduced_columns(design, term, sum_of_squares)])
        for term, own in zip(design.terms, design.columns, strict=True)
    ]


def _orthonormal(rows: Floats) -> Floats:
    """Orthonormal rows that span the same."""
    if len(rows) == 1:
        return np.asarray(rows / np.sqrt(np.vdot(rows, rows)))
    return np.linalg.qr(rows.T)[0].T


def reduced_columns(design: BetweenDesign, term: tuple[str, ...], sum_of_squares: int) -> list[int]:
    """Columns of the model without a term that it is tested against; of type II without what contains it."""
    return [
        column
        for other, columns in zip(design.terms, design.columns, strict=True)
        if other != term and (sum_of_squares == 3 or not set(term) <= set(other))
        for column in columns
    ]
