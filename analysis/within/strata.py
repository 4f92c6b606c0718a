"""Orthonormal contrasts of a factorial within-participant design, their errors, and sizes of effects."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import special

Floats = NDArray[np.float64]

# Contrasts of the cell means, and the names of effects.


@lru_cache(maxsize=64)
def orthonormal_basis(levels: int) -> Floats:
    """Orthogonal (levels, levels) matrix: first column 1/sqrt(levels), the others Helmert contrasts."""
    basis = np.zeros((levels, levels))
    # The mean comes first, so that index 0 of each turned axis averages the factor away.
    basis[:, 0] = 1.0 / np.sqrt(levels)
    for j in range(1, levels):
        basis[:j, j] = 1.0 / np.sqrt(j * (j + 1))
        basis[j, j] = -j / np.sqrt(j * (j + 1))
    # Shared by every caller through the cache: nobody may write into it.
    basis.setflags(write=False)
    return basis


def effect_members(n_factors: int) -> list[tuple[int, ...]]:
    """Factor positions of every effect: main effects first, then interactions by order."""
    positions = range(n_factors)
    return [members for order in range(1, n_factors + 1) for members in combinations(positions, order)]


def effect_name(factors: Sequence[str]) -> str:
    """Name of an effect: its factors joined with ':'."""
    return ":".join(factors)


def contrast_scores(y: Floats) -> tuple[Floats, dict[tuple[int, ...], slice]]:
    """Scores (N, K) of cell means (N, a, b, ...) on the contrasts of every effect, side by side.

    Also returns the columns of each set of within factors. The single column of `()` holds the scores between
    participants.
    """
    n, k = len(y), y[0].size
    cells = y.reshape(n, k)
    # Participants' means are taken out first: contrasts of large ratings would lose their last digits.
    people = cells.sum(axis=1) / k
    scores = cells - people[:, None]
    for size in y.shape[1:]:
        # takes the first axis and puts it last: after all of them their order is as before
        scores = np.swapaxes(scores.reshape(n, size, k // size), 1, 2) @ orthonormal_basis(size)
    order, columns = _by_effect(y.shape[1:])
    scores = scores.reshape(n, k)[:, order]
    # In units of one cell, so that its sum of squares is comparable with those of the contrasts.
    scores[:, 0] = math.sqrt(k) * (people - people.sum() / n)
    return scores, columns


@lru_cache(maxsize=64)
def _by_effect(shape: tuple[int, ...]) -> tuple[NDArray[np.int64], dict[tuple[int, ...], slice]]:
    """Where contrasts lie among the turned cells: index 0 of an axis is its mean, the rest its contrasts."""
    position = np.arange(math.prod(shape)).reshape(shape)
    every = [(), *effect_members(len(shape))]
    parts = [
        position[tuple(slice(1, None) if axis in members else 0 for axis in range(len(shape)))].ravel()
        for members in every
    ]
    ends = np.cumsum([len(part) for part in parts]).tolist()
    columns = {m: slice(end - len(part), end) for m, part, end in zip(every, parts, ends, strict=True)}
    return np.concatenate(parts), columns


# How far from spherical a set of within contrasts is.


@dataclass(frozen=True)
class Mauchly:
    """Mauchly's test of sphericity, chi-square with Box's second-order term (the textbook form)."""

    w: float
    p_value: float


def greenhouse_geisser(eigenvalues: Floats) -> float:
    r"""Greenhouse and Geisser's :math:`\hat\epsilon = (\mathrm{tr} E)^2 / (q \, \mathrm{tr} E^2)`.

    Parameters
    ----------
    eigenvalues : (q,) array
        Those of E, sums of squares and products of the residuals of q orthonormal contrasts.
    """
    return min(1.0, float(eigenvalues.sum()) ** 2 / (len(eigenvalues) * float(eigenvalues @ eigenvalues)))


def huynh_feldt(epsilon: float, contrasts: int, df_error: int) -> float:
    r"""Huynh and Feldt's epsilon, uncapped, with Lecoutre's (1991) correction for groups.

    Notes
    -----
    .. math:: \tilde\epsilon = \frac{(\nu + 1) q \hat\epsilon - 2}{q (\nu - q \hat\epsilon)} \tag{1}

    q contrasts, :math:`\nu` error df of participants, :math:`\hat\epsilon` Greenhouse and Geisser's. With
    :math:`q \hat\epsilon = \nu` (few participants) there is no finite value: NaN.
    """
    q, nu = contrasts, df_error
    room = nu - q * epsilon
    return ((nu + 1) * q * epsilon - 2) / (q * room) if room > 1e-9 * nu else math.nan


def mauchly_test(log_w: float, contrasts: int, df_error: int) -> Mauchly:
    """Mauchly's test of log W of q contrasts on the error df of participants."""
    q, nu = contrasts, df_error
    # Box's correction of the degrees of freedom for small samples.
    rho = 1 - (2 * q**2 + q + 2) / (6 * q * nu)
    # q (q + 1) / 2 variances and covariances, less the one scale that sphericity leaves free.
    chi2, df = -nu * rho * log_w, q * (q + 1) / 2 - 1
    # R's mauchly.test has 3k for 3q here (k cells); this is the textbook's form, so p differs by up to .003
    omega = (q + 2) * (q - 1) * (q - 2) * (2 * q**3 + 6 * q**2 + 3 * q + 2) / (288 * (nu * q * rho) ** 2)
    first, second = float(special.chdtrc(df, chi2)), float(special.chdtrc(df + 4, chi2))
    # The second-order term may pass 0 or 1 in the tails, a probability may not.
    return Mauchly(math.exp(log_w), min(max(first + omega * (second - first), 0.0), 1.0))


# Errors of the sets of within contrasts, and the hypotheses that are tested on each.

NO_VARIANCE = "the effect and its error are both zero: nothing varies"
NO_ERROR = "the error is zero: every participant shows the same effect"
SINGULAR_RATIO = 1e-10
"""Below this ratio of smallest to largest singular value (columns scaled to one) E counts as singular."""
WELL_CONDITIONED = 1e-4
"""Above this ratio of smallest to largest eigenvalue those of E lose no digit that counts."""


class ErrorStratum(NamedTuple):
    """The error of one set of within contrasts, shared by every effect between participants tested on it.

    Attributes
    ----------
    members : tuple of int
        Positions of the within factors.
    q, df : int
        Contrasts; error df of participants, N - p.
    ss : float
        Trace of E.
    epsilon_gg, epsilon_hf : float
        Greenhouse-Geisser's and Huynh-Feldt's, uncapped; NaN without an error.
    mauchly : Mauchly or None
        None with one contrast, and where it does not exist.
    residual : (N, q) array
        E is R'R.
    reason : str or None
        Why there are no multivariate tests: no error, E singular or df < q; None where there are.
    """

    members: tuple[int, ...]
    q: int
    df: int
    ss: float
    epsilon_gg: float
    epsilon_hf: float
    mauchly: Mauchly | None
    residual: Floats
    reason: str | None


class Hypothesis(NamedTuple):
    """One effect: its term between participants tested on the error of its within contrasts.

    `directed` (r, q) are the contrasts along the term's directions, `ss` their sum of squares.
    """

    between: tuple[str, ...]
    error: ErrorStratum
    ss: float
    directed: Floats

    @property
    def rank(self) -> int:
        """r, directions between participants."""
        return len(self.directed)

    @property
    def reason(self) -> str | None:
        """Why there is no multivariate test; None where there is one."""
        if self.error.ss == 0:
            return NO_ERROR if self.ss else NO_VARIANCE
        return self.error.reason


def error_stratum(residual: Floats, members: tuple[int, ...], df: int, ss: float) -> ErrorStratum:
    """Reduce residuals (N, q) of the within contrasts at `members`; `ss` is their sum of squares."""
    q = residual.shape[1]
    if ss == 0.0:
        return ErrorStratum(members, q, df, 0.0, math.nan, math.nan, None, residual, NO_ERROR)
    # One contrast is spherical by definition, and its E is a number.
    if q == 1:
        return ErrorStratum(members, 1, df, ss, 1.0, 1.0, None, residual, None)
    # eigvalsh: E is symmetric, and its eigenvalues must not come out complex.
    roots = np.asarray(np.linalg.eigvalsh(residual.T @ residual), dtype=np.float64)
    gg = greenhouse_geisser(roots)
    hf = huynh_feldt(gg, q, df)
    # E has rank df at most: it is singular with certainty, whatever its rounded eigenvalues say.
    if df < q:
        reason = f"needs more participants than contrasts: error df = {df}, contrasts = {q}"
        return ErrorStratum(members, q, df, ss, gg, hf, None, residual, reason)
    # Squaring the residuals loses half of the digits; they are only missed where E is near singular.
    if roots[0] > WELL_CONDITIONED * roots[-1]:
        log_det = float(np.log(roots).sum())
    elif (scaled := scaled_svd(residual)) is None:
        return ErrorStratum(members, q, df, ss, gg, hf, None, residual, "the error matrix is singular")
    else:
        log_det = 2 * float(np.log(scaled[0] * scaled[1]).sum())
    mauchly = mauchly_test(log_det - q * math.log(ss / q), q, df)
    return ErrorStratum(members, q, df, ss, gg, hf, mauchly, residual, None)


def scaled_svd(residual: Floats) -> tuple[Floats, Floats, Floats] | None:
    """Lengths of the residuals' columns and, these scaled to one, singular values and right vectors.

    None where E is singular. Their squares are those of E without the digits that squaring loses.
    """
    lengths = np.sqrt(np.einsum("ij,ij->j", residual, residual))
    # A contrast in which nobody differs: dividing by its length would make noise of it.
    if (lengths <= SINGULAR_RATIO * lengths.max()).any():
        return None
    _, singular, right = np.linalg.svd(residual / lengths, full_matrices=False)
    return None if singular[-1] <= SINGULAR_RATIO * singular[0] else (lengths, singular, right)


def above_noise(squares: Floats, floor: float) -> Floats:
    """Sums of squares, exactly zero where they are no more than rounding noise."""
    return np.where(squares > floor, squares, 0.0)


# Effect sizes of tests and their confidence intervals.

_STEPS = 80
_RELATIVE_CHANGE = 1e-13


def noncentrality(f_value: Floats, df_effect: Floats, df_error: Floats, tail: Floats) -> Floats:
    """Solve P(F'(df_effect, df_error, L) <= f_value) = tail for L; 0 where no L >= 0 does.

    All arguments broadcast. Newton steps on the exact derivative, kept inside a bracket.
    """
    f, d1, d2, p = (
        np.array(a, dtype=np.float64) for a in np.broadcast_arrays(f_value, df_effect, df_error, tail)
    )
    solved = np.zeros_like(f)
    # The distribution falls as L grows: below the target at L = 0, there is no root.
    rooted = special.ncfdtr(d1, d2, 0.0, f) > p
    if rooted.any():
        solved[rooted] = _newton(f[rooted], d1[rooted], d2[rooted], p[rooted])
    return solved


def _newton(f: Floats, d1: Floats, d2: Floats, p: Floats) -> Floats:
    r"""The root of :math:`G(L) = P(F'_{d_1, d_2}(L) \le f) - p`.

    Notes
    -----
    A noncentral F is a mixture over a Poisson count with mean L/2, each one more adding two df:

    .. math::

        G'(L) = \tfrac{1}{2} \{P(F'_{d_1 + 2, d_2}(L) \le f d_1 / (d_1 + 2))
            - P(F'_{d_1, d_2}(L) \le f)\} \tag{1}

    d1, d2 are the df of effect and error, L the noncentrality. A step that leaves the bracket halves it.
    """
    # The mean of F' is near (d1 + L) / d1, so L is of the order of d1 F.
    low, high = np.zeros_like(f), d1 * f + 10.0
    while (short := special.ncfdtr(d1, d2, high, f) > p).any():
        high[short] *= 2.0
    # A normal approximation to begin with, kept inside the bracket.
    guess = np.clip(d1 * f - special.ndtri(p) * np.sqrt(4.0 * d1 * f), 0.05 * high, 0.9 * high)
    for _ in range(_STEPS):
        cdf = special.ncfdtr(d1, d2, guess, f)
        above = cdf > p
        low, high = np.where(above, guess, low), np.where(above, high, guess)
        # eq. 1
        slope = 0.5 * (special.ncfdtr(d1 + 2.0, d2, guess, f * d1 / (d1 + 2.0)) - cdf)
        with np.errstate(divide="ignore", invalid="ignore"):
            step = guess - (cdf - p) / slope
        # Also true where the slope is 0 or NaN: comparisons with NaN are false.
        bad = ~((step > low) & (step < high))
        following = np.where(bad, 0.5 * (low + high), step)
        done = np.abs(following - guess) <= _RELATIVE_CHANGE * following
        guess = following
        if done.all():
            break
    return guess


def partial_eta_squared_ci(
    f_value: Floats, df_effect: Floats, df_error: Floats, confidence: float = 0.95
) -> Floats:
    """Confidence interval of partial eta squared from its F.

    Parameters
    ----------
    f_value, df_effect, df_error : float64 array (m,)
        Univariate F with its uncorrected df; NaN gives NaN.
    confidence : float, optional
        Coverage of the two-sided interval.

    Returns
    -------
    (m, 2) lower and upper bound, L / (L + df_effect + df_error + 1) with L the noncentrality that puts F
    at the upper and lower tail. Source: Steiger (2004), doi:10.1037/1082-989X.9.2.164.
    """
    f, d1, d2 = (np.atleast_1d(np.asarray(a, dtype=np.float64)) for a in (f_value, df_effect, df_error))
    interval = np.full((f.size, 2), np.nan)
    # No F where the error is zero: its interval stays NaN.
    known = np.isfinite(f)
    tails = np.array([0.5 + confidence / 2, 0.5 - confidence / 2])
    size = noncentrality(f[known, None], d1[known, None], d2[known, None], tails)
    interval[known] = size / (size + (d1 + d2 + 1.0)[known, None])
    return interval


class SizeIntervals:
    """Intervals of partial eta squared of several F, computed together when the first is asked for.

    Parameters
    ----------
    tests : sequence of (float, float, float)
        F and its df of effect and error, as in `partial_eta_squared_ci`.
    confidence : float
        Coverage.
    """

    def __init__(self, tests: Sequence[tuple[float, float, float]], confidence: float) -> None:
        self._tests = tests
        self._confidence = confidence

    def interval(self, at: int) -> tuple[float, float]:
        """Lower and upper bound of the F at a position."""
        return self._all_intervals[at]

    @cached_property
    def _all_intervals(self) -> list[tuple[float, float]]:
        f_value, df_effect, df_error = np.array(self._tests, dtype=np.float64).T
        bounds = partial_eta_squared_ci(f_value, df_effect, df_error, self._confidence)
        return [(low, high) for low, high in bounds.tolist()]
