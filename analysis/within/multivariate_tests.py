"""The multivariate test of every effect, computed when the first is asked for."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from analysis.within.eta_squared import SizeIntervals
from analysis.within.multivariate import FourStatistics, exact_statistics, four_statistics
from analysis.within.strata import ErrorStratum, Hypothesis, scaled_svd

Floats = NDArray[np.float64]


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
        own = SizeIntervals(first, self._confidence)
        return [
            None if one is None else _one_test(one, h, self._univariate if h.error.q == 1 else own, at)
            for at, (one, h) in enumerate(zip(four, self._hypotheses, strict=True))
        ]


def _whitening(error: ErrorStratum) -> Floats | None:
    """A matrix (q, q) that turns scores into such with E = I; None where there is none."""
    if error.reason is not None:
        return None
    if error.q == 1:
        return np.array([[error.ss**-0.5]])
    scaled = scaled_svd(error.residual)
    if scaled is None:
        return None
    lengths, singular, right = scaled
    return (right / singular[:, None]).T / lengths[:, None]


def _eigenvalues(directed: Floats, whiten: Floats) -> Floats:
    """Eigenvalues (s,) of E^-1 H of a hypothesis."""
    whitened = directed @ whiten
    if 1 in whitened.shape:
        return np.array([np.vdot(whitened, whitened)])
    roots: Floats = np.asarray(np.linalg.svd(whitened, compute_uv=False), dtype=np.float64)
    return roots**2


def _four_statistics(hypotheses: Sequence[Hypothesis]) -> list[FourStatistics | None]:
    """The statistics of each effect that has them; those with one exact F are computed together."""
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
        eta_sq_partial=first.value / smaller,
        exact=smaller == 1,
        statistics=four,
        sizes=sizes,
        at=at,
    )
