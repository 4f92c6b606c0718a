"""The four multivariate statistics of a general linear hypothesis, and the test of every effect by them."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import special

from analysis.within.strata import ErrorStratum, Hypothesis, SizeIntervals, scaled_svd

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Statistic:
    """One multivariate statistic with its F (exact with one eigenvalue, else an approximation)."""

    value: float
    f_value: float
    df_effect: float
    df_error: float
    p_value: float


@dataclass(frozen=True)
class FourStatistics:
    """Pillai's trace, Wilks' lambda, the Hotelling-Lawley trace and Roy's largest root."""

    pillai: Statistic
    wilks: Statistic
    hotelling_lawley: Statistic
    roy: Statistic


def four_statistics(eigenvalues: Floats, responses: int, df_hypothesis: int, df_error: int) -> FourStatistics:
    r"""Statistics from the eigenvalues of :math:`E^{-1} H`.

    Parameters
    ----------
    eigenvalues : (s,) array
        The non-zero ones; s = min(p, r).
    responses : int
        p, contrasts within a participant.
    df_hypothesis : int
        r, contrasts between participants.
    df_error : int
        :math:`\nu`, participants less coefficients.

    Notes
    -----
    With :math:`m = (|p - r| - 1) / 2` and :math:`n = (\nu - p - 1) / 2`:

    1. Pillai :math:`V = \sum \lambda / (1 + \lambda)`,
       :math:`F = \frac{2n + s + 1}{2m + s + 1} \frac{V}{s - V}` on :math:`s(2m + s + 1), s(2n + s + 1)`.
    2. Hotelling-Lawley :math:`T = \sum \lambda`, :math:`F = \frac{2 (s n + 1) T}{s^2 (2m + s + 1)}` on
       :math:`s(2m + s + 1), 2(s n + 1)`.
    3. Wilks :math:`\Lambda = \prod 1 / (1 + \lambda)`, Rao's F.
    4. Roy :math:`\lambda_1`, :math:`F = \lambda_1 (\nu - d + r) / d` on :math:`d = \max(p, r)` and
       :math:`\nu - d + r`, an upper bound where s > 1.

    Source: Rencher & Christensen (2012), chapter 6; the forms are those of R's `summary.manova`.
    """
    # The letters are those of the notes above and of the textbook, so that each line can be compared.
    p, r, nu = responses, df_hypothesis, df_error
    s, m, n = min(p, r), (abs(p - r) - 1) / 2, (df_error - responses - 1) / 2
    width, depth = 2 * m + s + 1, 2 * n + s + 1
    # A direction with eigenvalue lambda explains lambda / (1 + lambda) of what varies along it.
    shares = eigenvalues / (1 + eigenvalues)
    pillai, trace = float(shares.sum()), float(eigenvalues.sum())
    # A product of many factors near 0 would underflow: the logarithms are added instead.
    lamb, root = float(np.exp(-np.log1p(eigenvalues).sum())), float(eigenvalues.max())
    # s - V summed as 1 / (1 + lambda): no digits are lost where V is close to s
    rest = float((1 / (1 + eigenvalues)).sum()) + (s - len(eigenvalues))
    # For p = r = 1 or a 2 x 1 table the root of Rao's formula is 0 / 0; its power is 1 then.
    square = p * p + r * r - 5
    power = float(np.sqrt((p * p * r * r - 4) / square)) if square > 0 else 1.0
    # Rao's second df; it need not be a whole number.
    wilks_df = (nu - (p - r + 1) / 2) * power - (p * r - 2) / 2
    # Roy's root has no exact F with several eigenvalues: this one is too large, and p too small.
    larger = max(p, r)
    return FourStatistics(
        pillai=_with_p(pillai, depth / width * pillai / rest, s * width, s * depth),
        wilks=_with_p(
            lamb,
            float(np.expm1(np.log1p(eigenvalues).sum() / power)) * wilks_df / (p * r),
            p * r,
            wilks_df,
        ),
        hotelling_lawley=_with_p(
            trace, 2 * (s * n + 1) * trace / (s * s * width), s * width, 2 * (s * n + 1)
        ),
        roy=_with_p(root, root * (nu - larger + r) / larger, larger, nu - larger + r),
    )


def exact_statistics(
    eigenvalues: Floats, responses: Floats, df_hypothesis: Floats, df_error: Floats
) -> list[FourStatistics]:
    r"""Statistics of hypotheses with one eigenvalue each, where all four have one exact F.

    Parameters
    ----------
    eigenvalues, responses, df_hypothesis, df_error : (m,) array
        As in `four_statistics`; min(p, r) = 1.

    Notes
    -----
    :math:`F = \lambda (\nu - p + 1) / \max(p, r)` on :math:`\max(p, r), \nu - p + 1`: every form of
    `four_statistics` with s = 1.
    """
    # With one eigenvalue the four statistics are functions of each other, and so is their F.
    df1, df2 = np.maximum(responses, df_hypothesis), df_error - responses + 1
    f_value = eigenvalues * df2 / df1
    columns = (
        eigenvalues / (1 + eigenvalues),
        1 / (1 + eigenvalues),
        eigenvalues,
        f_value,
        df1,
        df2,
        special.fdtrc(df1, df2, f_value),
    )
    every = []
    for pillai, wilks, root, *test in zip(*(column.tolist() for column in columns), strict=True):
        largest = Statistic(root, *test)
        every.append(FourStatistics(Statistic(pillai, *test), Statistic(wilks, *test), largest, largest))
    return every


def _with_p(value: float, f_value: float, df_effect: float, df_error: float) -> Statistic:
    # Fewer participants than contrasts leave no df: only the statistic is known.
    known = df_error > 0
    p_value = float(special.fdtrc(df_effect, df_error, f_value)) if known else float("nan")
    return Statistic(value, f_value if known else float("nan"), float(df_effect), float(df_error), p_value)


@dataclass(frozen=True)
class MultivariateTest:
    """The four multivariate statistics and one F.

    F, its df and p are exact and the same for all four where the effect has one direction between
    participants or one contrast within; else they are Pillai's, and `statistics` has those of each.
    `eta_sq_partial` is V / s = F df1 / (F df1 + df2), the size that belongs to this F; `sizes` and `at` know
    its interval.
    """

    pillai: float
    wilks: float
    hotelling_lawley: float
    roy: float
    f_value: float
    df_effect: int
    df_error: int
    p_value: float
    eta_sq_partial: float
    exact: bool
    statistics: FourStatistics
    sizes: SizeIntervals = field(repr=False, compare=False)
    at: int = field(repr=False, compare=False)

    @property
    def eta_sq_partial_ci(self) -> tuple[float, float]:
        """Interval of `eta_sq_partial`."""
        return self.sizes.interval(self.at)


class MultivariateTests:
    """Multivariate tests of several hypotheses.

    Parameters
    ----------
    hypotheses : sequence of Hypothesis
    univariate : SizeIntervals
        Intervals of their univariate F: with one contrast the two tests are one.
    confidence : float
        Coverage of the intervals of partial eta squared.
    """

    def __init__(
        self, hypotheses: Sequence[Hypothesis], univariate: SizeIntervals, confidence: float
    ) -> None:
        self._hypotheses = hypotheses
        self._univariate = univariate
        self._confidence = confidence

    def test(self, at: int) -> MultivariateTest | None:
        """The test of the hypothesis at a position; None where there is none."""
        return self._all_tests[at]

    @cached_property
    def _all_tests(self) -> list[MultivariateTest | None]:
        four = _four_statistics(self._hypotheses)
        first = [
            (np.nan, np.nan, np.nan)
            if one is None
            else (one.pillai.f_value, one.pillai.df_effect, one.pillai.df_error)
            for one in four
        ]
        # All intervals are searched at once: one after another takes most of the time of an ANOVA.
        own = SizeIntervals(first, self._confidence)
        return [
            None if one is None else _one_test(one, h, self._univariate if h.error.q == 1 else own, at)
            for at, (one, h) in enumerate(zip(four, self._hypotheses, strict=True))
        ]


def _whitening(error: ErrorStratum) -> Floats | None:
    """A matrix (q, q) that turns scores into such with E = I; None where there is none."""
    if error.reason is not None:
        return None
    # One contrast needs no decomposition.
    if error.q == 1:
        return np.array([[error.ss**-0.5]])
    # None where scores are collinear within rounding: E has no inverse, and there is no test.
    scaled = scaled_svd(error.residual)
    if scaled is None:
        return None
    lengths, singular, right = scaled
    return (right / singular[:, None]).T / lengths[:, None]


def _eigenvalues(directed: Floats, whiten: Floats) -> Floats:
    """Eigenvalues (s,) of E^-1 H of a hypothesis."""
    # With E = I the eigenvalues of E^-1 H are the squared singular values of the directions of H.
    whitened = directed @ whiten
    # A single row or column has one eigenvalue: its squared length.
    if 1 in whitened.shape:
        return np.array([np.vdot(whitened, whitened)])
    roots: Floats = np.asarray(np.linalg.svd(whitened, compute_uv=False), dtype=np.float64)
    return roots**2


def _four_statistics(hypotheses: Sequence[Hypothesis]) -> list[FourStatistics | None]:
    """The statistics of each effect that has them; those with one exact F are computed together."""
    # Effects that share an error term share its decomposition.
    whiten = {
        error.members: _whitening(error) for error in {h.error.members: h.error for h in hypotheses}.values()
    }
    roots = {
        i: _eigenvalues(h.directed, turn)
        for i, h in enumerate(hypotheses)
        if (turn := whiten[h.error.members]) is not None
    }
    sizes = {i: (hypotheses[i].error.q, hypotheses[i].rank, hypotheses[i].error.df) for i in roots}
    exact = [i for i, (q, rank, _) in sizes.items() if 1 in (q, rank)]
    together = np.array([(roots[i][0], *sizes[i]) for i in exact], dtype=np.float64).reshape(-1, 4)
    statistics = dict(zip(exact, exact_statistics(*together.T), strict=True))
    statistics |= {i: four_statistics(roots[i], *sizes[i]) for i in roots if i not in statistics}
    return [statistics.get(i) for i in range(len(hypotheses))]


def _one_test(
    four: FourStatistics, hypothesis: Hypothesis, sizes: SizeIntervals, at: int
) -> MultivariateTest:
    first, smaller = four.pillai, min(hypothesis.rank, hypothesis.error.q)
    return MultivariateTest(
        pillai=first.value,
        wilks=four.wilks.value,
        hotelling_lawley=four.hotelling_lawley.value,
        roy=four.roy.value,
        f_value=first.f_value,
        df_effect=round(first.df_effect),
        df_error=round(first.df_error),
        p_value=first.p_value,
        # Pillai's V is at most s, the number of eigenvalues: V / s lies between 0 and 1.
        eta_sq_partial=first.value / smaller,
        exact=smaller == 1,
        statistics=four,
        sizes=sizes,
        at=at,
    )
