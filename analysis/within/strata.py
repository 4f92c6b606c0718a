"""Errors of the sets of within contrasts, and the hypotheses that are tested on each."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.within.sphericity import Mauchly, greenhouse_geisser, huynh_feldt, mauchly_test

Floats = NDArray[np.float64]

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
    if q == 1:
        return ErrorStratum(members, 1, df, ss, 1.0, 1.0, None, residual, None)
    roots = np.asarray(np.linalg.eigvalsh(residual.T @ residual), dtype=np.float64)
    gg = greenhouse_geisser(roots)
    hf = huynh_feldt(gg, q, df)
    if df < q:
        reason = f"needs more participants than contrasts: error df = {df}, contrasts = {q}"
        return ErrorStratum(members, q, df, ss, gg, hf, None, residual, reason)
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
    if (lengths <= SINGULAR_RATIO * lengths.max()).any():
        return None
    _, singular, right = np.linalg.svd(residual / lengths, full_matrices=False)
    return None if singular[-1] <= SINGULAR_RATIO * singular[0] else (lengths, singular, right)


def above_noise(squares: Floats, floor: float) -> Floats:
    """Sums of squares, exactly zero where they are no more than rounding noise."""
    return np.where(squares > floor, squares, 0.0)
