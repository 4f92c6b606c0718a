"""The four multivariate statistics of a general linear hypothesis and their F."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special

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
    p, r, nu = responses, df_hypothesis, df_error
    s, m, n = min(p, r), (abs(p - r) - 1) / 2, (df_error - responses - 1) / 2
    width, depth = 2 * m + s + 1, 2 * n + s + 1
    shares = eigenvalues / (1 + eigenvalues)
    pillai, trace = float(shares.sum()), float(eigenvalues.sum())
    lamb, root = float(np.exp(-np.log1p(eigenvalues).sum())), float(eigenvalues.max())
    # s - V summed as 1 / (1 + lambda): no digits are lost where V is close to s
    rest = float((1 / (1 + eigenvalues)).sum()) + (s - len(eigenvalues))
    square = p * p + r * r - 5
    power = float(np.sqrt((p * p * r * r - 4) / square)) if square > 0 else 1.0
    wilks_df = (nu - (p - r + 1) / 2) * power - (p * r - 2) / 2
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
    known = df_error > 0
    p_value = float(special.fdtrc(df_effect, df_error, f_value)) if known else float("nan")
    return Statistic(value, f_value if known else float("nan"), float(df_effect), float(df_error), p_value)
