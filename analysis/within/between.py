"""What differs between participants: groups and covariates, as the design matrix of the linear model."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import accumulate, combinations, product

import numpy as np
from numpy.typing import NDArray

from analysis.within.strata import orthonormal_basis
from experiments.errors import InputError

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

WELL_CONDITIONED = 1e-4
"""Ratio of singular values above which a design is taken apart once for all of its terms."""

RANK_RATIO = 1e-9
"""A column whose part outside the others is smaller than this share of it adds nothing to them."""


@dataclass(frozen=True)
class Covariate:
    """A number that belongs to a participant.

    Attributes
    ----------
    name : str
    values : (N,) array
        As given, in the covariate's own unit.
    centre : float
        What is subtracted before fitting: effects without the covariate are those of a participant with
        this value.
    centred : bool
        Whether `centre` is the mean over participants.
    """

    name: str
    values: Floats = field(repr=False)
    centre: float
    centred: bool = True


@dataclass(frozen=True)
class BetweenDesign:
    """Groups and covariates of N participants, and the terms of their linear model.

    Attributes
    ----------
    factors, levels : tuple
        Between factors and the names of their levels.
    codes : (N, g) array
        Level of each participant on each of g between factors.
    covariates : tuple of Covariate
    terms : tuple of tuple of str
        Names of every term's factors and covariates; the first, the intercept, has none.
    columns : tuple of tuple of int
        Columns of `matrix` that belong to each term.
    matrix : (N, p) array
        Intercept, sum-to-zero contrasts of the factors, centered covariates in units of their SD.
    """

    factors: tuple[str, ...]
    levels: tuple[tuple[str, ...], ...]
    codes: Integers = field(repr=False)
    covariates: tuple[Covariate, ...] = ()
    terms: tuple[tuple[str, ...], ...] = ((),)
    columns: tuple[tuple[int, ...], ...] = ((0,),)
    matrix: Floats = field(repr=False, default_factory=lambda: np.ones((0, 1)))

    @property
    def n_participants(self) -> int:
        """N."""
        return len(self.matrix)

    @cached_property
    def decomposed(self) -> tuple[Floats, Floats, Floats]:
        """Singular value decomposition of the matrix, its columns scaled to length one.

        Left vectors (N, p), an orthonormal basis of the columns; singular values (p,); right vectors (p, p).
        """
        lengths = np.sqrt(np.einsum("ij,ij->j", self.matrix, self.matrix))
        # At length one, as a covariate in small units would look like a dependent column.
        scaled = self.matrix / np.where(lengths > 0, lengths, 1.0)
        # One column is its own basis: no decomposition is needed.
        if scaled.shape[1] == 1:
            return scaled, np.ones(1), np.ones((1, 1))
        left, singular, right = np.linalg.svd(scaled, full_matrices=False)
        return left, singular, right

    @property
    def basis(self) -> Floats:
        """Orthonormal basis (N, p) of the columns of the matrix."""
        return self.decomposed[0]

    @property
    def well_conditioned(self) -> bool:
        """Whether columns, scaled to length one, are so far from dependent that no digit is lost."""
        singular = self.decomposed[1]
        # Singular values come in descending order.
        return bool(singular[-1] > WELL_CONDITIONED * singular[0])

    def row(self, at: dict[str, int]) -> Floats:
        """Design row (p,) of the participant with the levels `at` and every covariate at its mean.

        Factors that `at` leaves out are averaged over their levels with equal weight: their contrasts are 0.
        """
        parts = {name: self._factor_row(name, at) for name in self.factors}
        for covariate in self.covariates:
            # The mean, not the center: the two differ where another center was asked for.
            parts[covariate.name] = np.array([_standardised(covariate, covariate.values.mean())])
        return np.concatenate([_product([parts[name][None] for name in term])[0] for term in self.terms])

    def _factor_row(self, name: str, at: dict[str, int]) -> Floats:
        size = len(self.levels[self.factors.index(name)])
        if name not in at:
            # Contrasts sum to 0 over the levels, so zeros are their equal-weight average.
            return np.zeros(size - 1)
        # The first column is constant and belongs to the intercept.
        return orthonormal_basis(size)[at[name], 1:]

    def group_sizes(self) -> dict[tuple[str, ...], int]:
        """Participants in every combination of levels."""
        sizes = dict.fromkeys(product(*self.levels), 0)
        for row in self.codes:
            sizes[tuple(self.levels[k][code] for k, code in enumerate(row))] += 1
        return sizes


def no_groups(n: int) -> BetweenDesign:
    """The design of `n` participants of one group: an intercept."""
    return BetweenDesign((), (), np.zeros((n, 0), np.int64), matrix=np.ones((n, 1)))


def between_design(
    factors: Sequence[str],
    levels: Sequence[Sequence[str]],
    codes: Integers,
    covariates: Sequence[Covariate] = (),
    covariate_by_group: bool = False,
) -> BetweenDesign:
    """Build the design of groups and covariates.

    Parameters
    ----------
    factors, levels : sequence
        Between factors and their levels.
    codes : (N, g) array of int
        Each participant's level on each factor.
    covariates : sequence of Covariate
    covariate_by_group : bool
        Whether every covariate also interacts with the between factors (slopes that differ by group).

    Raises
    ------
    InputError
        A group with nobody in it, a covariate that does not vary or that the groups already determine, or
        fewer participants than coefficients and one.
    """
    # Main effects first, then interactions, by order.
    effects = [c for order in range(1, len(factors) + 1) for c in combinations(factors, order)]
    terms: list[tuple[str, ...]] = [(), *((c.name,) for c in covariates), *effects]
    if covariate_by_group:
        terms += [(c.name, *effect) for c in covariates for effect in effects]
    _refuse_empty_groups(factors, levels, codes)
    parts: dict[str, Floats] = {
        name: orthonormal_basis(len(levels[k]))[codes[:, k], 1:] for k, name in enumerate(factors)
    }
    for covariate in covariates:
        # Before it is standardized, which would divide by 0.
        if np.ptp(covariate.values) == 0:
            raise InputError(f"the covariate '{covariate.name}' is the same for everyone; remove it")
        parts[covariate.name] = _standardised(covariate, covariate.values)[:, None]
    blocks = [_product([parts[name] for name in term], len(codes)) for term in terms]
    ends = accumulate(block.shape[1] for block in blocks)
    columns = tuple(tuple(range(end - block.shape[1], end)) for block, end in zip(blocks, ends, strict=True))
    matrix = np.concatenate(blocks, axis=1)
    names = tuple(tuple(str(level) for level in group) for group in levels)
    design = BetweenDesign(tuple(factors), names, codes, tuple(covariates), tuple(terms), columns, matrix)
    _refuse_deficient(design)
    return design


def _standardised(covariate: Covariate, values: Floats) -> Floats:
    # In SDs, so that the units of covariates do not matter for the condition of the matrix.
    return np.asarray((values - covariate.centre) / covariate.values.std(), dtype=np.float64)


def _product(parts: Sequence[Floats], n: int = 1) -> Floats:
    """Products of every column of one part with every column of the others, (n, columns)."""
    # Without parts: the intercept.
    block, *others = parts or [np.ones((n, 1))]
    for part in others:
        block = (block[:, :, None] * part[:, None, :]).reshape(len(block), -1)
    return block


def _refuse_empty_groups(factors: Sequence[str], levels: Sequence[Sequence[str]], codes: Integers) -> None:
    for name, group in zip(factors, levels, strict=True):
        if len(group) < 2:
            raise InputError(f"expected at least 2 levels of '{name}', got {len(group)}; remove the factor")
    met = set(map(tuple, codes.tolist()))
    if len(met) == math.prod(map(len, levels)):
        return
    empty = [at for at in product(*(range(len(group)) for group in levels)) if at not in met]
    said = "; ".join(
        " ".join(f"{name}={levels[k][code]}" for k, (name, code) in enumerate(zip(factors, at, strict=True)))
        # Five are enough to see which groups are missing.
        for at in empty[:5]
    )
    raise InputError(
        f"nobody with complete data is in {said}: the groups are not fully crossed; remove a factor"
    )


def _refuse_deficient(design: BetweenDesign) -> None:
    n, p = design.matrix.shape
    # Without groups and covariates (p = 1) one participant may be read, if not tested.
    if n <= p > 1:
        raise InputError(
            f"expected more participants than coefficients between participants, got {n} for {p}; "
            "the tests have no error term"
        )
    # Far from dependent: the slow check of each term is not needed.
    if design.well_conditioned:
        return
    # Start with the last term: of dependent terms, name the covariate or slope, which was added last.
    for term, own in reversed(list(zip(design.terms, design.columns, strict=True))):
        others = np.delete(design.matrix, own, axis=1)
        if term and others.shape[1] and len(outside(design.matrix[:, own], others)) < len(own):
            way_out = "leave --covariate-by-group out" if _is_slope(design, term) else "leave one out"
            raise InputError(
                f"'{':'.join(term)}' is determined by the other groups and covariates; {way_out}"
            )


def _is_slope(design: BetweenDesign, term: tuple[str, ...]) -> bool:
    """Whether a term lets the slope of a covariate differ between groups."""
    return len(term) > 1 and any(covariate.name in term for covariate in design.covariates)


def outside(own: Floats, others: Floats) -> Floats:
    """Orthonormal rows (r, N) of what the columns `own` span outside the columns `others`."""
    basis = np.linalg.qr(others)[0] if others.shape[1] else others
    rest = own - basis @ (basis.T @ own)
    # Twice: the first projection leaves rounding errors where columns nearly coincide.
    rest = rest - basis @ (basis.T @ rest)
    left, singular, _ = np.linalg.svd(rest, full_matrices=False)
    # Relative to the columns themselves: what remains below it is rounding.
    return np.asarray(left.T[singular > RANK_RATIO * np.linalg.norm(own, axis=0).max()], dtype=np.float64)


# Which directions between participants each term of a design is tested on.


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
    # One row needs only its length; most terms have one.
    if len(rows) == 1:
        return np.asarray(rows / np.sqrt(np.vdot(rows, rows)))
    return np.linalg.qr(rows.T)[0].T


def reduced_columns(design: BetweenDesign, term: tuple[str, ...], sum_of_squares: int) -> list[int]:
    """Columns of the reduced model that a term is tested against.

    Type II also leaves out terms that contain it.
    """
    return [
        column
        for other, columns in zip(design.terms, design.columns, strict=True)
        # Type II leaves out what contains the term, type III only the term.
        if other != term and (sum_of_squares == 3 or not set(term) <= set(other))
        for column in columns
    ]
