"""The tests of one effect from its contrast scores: univariate, corrected, multivariate, Mauchly."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy import special

from analysis.within.contrasts import effect_name
from analysis.within.eta_squared import SizeIntervals
from analysis.within.multivariate import FourStatistics, exact_statistics, four_statistics

Floats = NDArray[np.float64]

NO_VARIANCE = "the effect and its error are both zero: nothing varies"
NO_ERROR = "the error is zero: every participant shows the same effect"
SINGULAR_RATIO = 1e-10
"""Below this ratio of smallest to largest singular value (columns scaled to one) E counts as singular."""


@dataclass(frozen=True)
class UnivariateTest:
    """Univariate F with sphericity corrections; NaN where undefined (`univariate_reason` says why).

    `epsilon_hf` is uncapped; `p_hf` and the df of Huynh-Feldt use min(1, epsilon_hf).
    """

    ss: float
    ss_error: float
    df_effect: int
    df_error: int
    f_value: float
    p_value: float
    epsilon_gg: float
    p_gg: float
    epsilon_hf: float
    p_hf: float
    df_effect_gg: float
    df_error_gg: float
    df_effect_hf: float
    df_error_hf: float


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


@dataclass(frozen=True)
class Mauchly:
    """Mauchly's test of sphericity, chi-square with Box's second-order term (the textbook form)."""

    w: float
    p_value: float


@dataclass(frozen=True)
class Effect:
    """All that is known about one effect. A test that does not exist is None, and its reason is given.

    `eta_sq_partial` and its interval belong to the univariate F; the interval uses Greenhouse-Geisser's df.
    `factors` are those between participants and covariates first, then those within.
    """

    effect: str
    factors: tuple[str, ...]
    between: tuple[str, ...]
    within: tuple[str, ...]
    univariate: UnivariateTest
    univariate_reason: str | None
    multivariate: MultivariateTest | None
    multivariate_reason: str | None
    mauchly: Mauchly | None
    mauchly_reason: str | None
    eta_sq_partial: float
    eta_sq_generalized: float
    omega_sq_partial: float
    sizes: SizeIntervals = field(repr=False, compare=False)
    at: int = field(repr=False, compare=False)

    @property
    def eta_sq_partial_ci(self) -> tuple[float, float]:
        """Interval of `eta_sq_partial`."""
        return self.sizes.interval(self.at)


@dataclass(frozen=True)
class ErrorScores:
    """The error of one set of within contrasts, shared by every effect between participants tested on it.

    `residual` is (N, q) with `df` = N - p error df; `epsilon` is Greenhouse-Geisser's, `log_w` the log of
    Mauchly's W, NaN where it does not exist. `whiten` (q, q) gives scores with E = I; None where E is
    singular or df < q, and `reason` says which.
    """

    members: tuple[int, ...]
    q: int
    df: int
    ss: float
    epsilon: float
    log_w: float
    whiten: Floats | None = field(repr=False)
    reason: str | None


@dataclass(frozen=True)
class Scores:
    """One effect: its term between participants, its within contrasts, its sum of squares.

    `eigenvalues` are those of E^-1 H (empty where they do not exist).
    """

    between: tuple[str, ...]
    error: ErrorScores
    rank: int
    ss: float
    eigenvalues: Floats = field(repr=False)
    reason: str | None


def above_noise(value: float, floor: float) -> float:
    """`value`, or exactly zero where it is no more than rounding noise."""
    return value if value > floor else 0.0


def error_scores(residual: Floats, members: tuple[int, ...], df: int, floor: float) -> ErrorScores:
    """Reduce residuals (N, q) of the within contrasts at `members`; a sum below `floor` is zero."""
    q = residual.shape[1]
    ss = above_noise(float(np.vdot(residual, residual)), floor)
    if ss == 0.0:
        return ErrorScores(members, q, df, 0.0, np.nan, np.nan, None, NO_ERROR)
    if q == 1:
        return ErrorScores(members, 1, df, ss, 1.0, 0.0, np.array([[1 / np.sqrt(ss)]]), None)
    error = residual.T @ residual
    epsilon = min(1.0, ss**2 / (q * float(np.vdot(error, error))))
    if df < q:
        reason = f"needs more participants than contrasts: error df = {df}, contrasts = {q}"
        return ErrorScores(members, q, df, ss, epsilon, np.nan, None, reason)
    whiten, log_det = _whitening(residual)
    reason_singular = "the error matrix is singular" if whiten is None else None
    log_w = log_det - q * float(np.log(ss / q))
    return ErrorScores(members, q, df, ss, epsilon, log_w, whiten, reason_singular)


def _whitening(residual: Floats) -> tuple[Floats | None, float]:
    """A matrix W with W' E W = I by the singular values of the residuals, and log det E."""
    scale = np.sqrt(np.einsum("ij,ij->j", residual, residual))
    if (scale <= SINGULAR_RATIO * scale.max()).any():
        return None, np.nan
    _, singular, right = np.linalg.svd(residual / scale, full_matrices=False)
    if singular[-1] <= SINGULAR_RATIO * singular[0]:
        return None, np.nan
    log_det = 2 * float(np.log(singular).sum() + np.log(scale).sum())
    return (right / singular[:, None]).T / scale[:, None], log_det


def hypothesis_scores(directed: Floats, between: tuple[str, ...], error: ErrorScores, floor: float) -> Scores:
    """Scores of one effect from `directed` (r, q), the within contrasts along the term's directions."""
    ss = above_noise(float(np.vdot(directed, directed)), floor)
    rank = len(directed)
    if error.ss == 0.0:
        return Scores(between, error, rank, ss, np.empty(0), NO_ERROR if ss else NO_VARIANCE)
    if error.whiten is None:
        return Scores(between, error, rank, ss, np.empty(0), error.reason)
    whitened = directed @ error.whiten
    if 1 in whitened.shape:
        return Scores(between, error, rank, ss, np.array([np.vdot(whitened, whitened)]), None)
    roots: Floats = np.asarray(np.linalg.svd(whitened, compute_uv=False), dtype=np.float64)
    return Scores(between, error, rank, ss, roots**2, None)


def effects_of(
    scores: Sequence[Scores], factors: Sequence[str], ss_error_total: float, confidence: float
) -> tuple[Effect, ...]:
    """Every effect from its scores; p values and intervals of all effects are computed together.

    `factors` are the within factors; `ss_error_total` is the sum of the errors of all strata.
    """
    columns = np.array([(s.ss, s.error.ss, s.rank, s.error.q, s.error.df, s.error.epsilon) for s in scores])
    univariate = _univariate(scores, columns)
    f, d1, d2 = np.array([(u.f_value, u.df_effect, u.df_error) for u in univariate], dtype=np.float64).T
    ss, ss_error, shrink = columns[:, 0], columns[:, 1], np.nan_to_num(columns[:, 5], nan=1.0)
    four = _four_statistics(scores)
    first = np.array(
        [
            (np.nan,) * 3 if one is None else (one.pillai.f_value, one.pillai.df_effect, one.pillai.df_error)
            for one in four
        ]
    )
    sizes = SizeIntervals(
        np.concatenate([f, first[:, 0]]),
        np.concatenate([d1 * shrink, first[:, 1]]),
        np.concatenate([d2 * shrink, first[:, 2]]),
        confidence,
    )
    with np.errstate(invalid="ignore", divide="ignore"):
        eta = (ss / (ss + ss_error)).tolist()
        generalized = (ss / (ss + ss_error_total)).tolist()
        omega = ((f - 1) * d1 / (f * d1 + d2 + 1)).tolist()
    effects = []
    for i, (s, u) in enumerate(zip(scores, univariate, strict=True)):
        within = tuple(factors[m] for m in s.error.members)
        named, statistics = (*s.between, *within), four[i]
        effects.append(
            Effect(
                effect=effect_name(named),
                factors=named,
                between=s.between,
                within=within,
                univariate=u,
                univariate_reason=s.reason if s.error.ss == 0 else None,
                multivariate=None if statistics is None else _one_test(statistics, s, sizes, len(scores) + i),
                multivariate_reason=s.reason,
                mauchly=_mauchly(s.error),
                mauchly_reason="one contrast: sphericity holds by definition" if s.error.q == 1 else s.reason,
                eta_sq_partial=eta[i],
                eta_sq_generalized=generalized[i],
                omega_sq_partial=omega[i],
                sizes=sizes,
                at=i,
            )
        )
    return tuple(effects)


def _univariate(scores: Sequence[Scores], columns: Floats) -> list[UnivariateTest]:
    r"""The univariate tests, uncorrected and by the two corrections for sphericity.

    Notes
    -----
    .. math::

        F &= \frac{SS / (r q)}{SS_e / (q \nu)}
            \quad\text{on } \epsilon r q \text{ and } \epsilon q \nu \text{ df} \tag{1} \\
        \tilde\epsilon &= \frac{(\nu + 1) q \hat\epsilon - 2}{q (\nu - q \hat\epsilon)} \tag{2}

    q contrasts within people, r between them, nu the df of people within groups; epsilon is 1, Greenhouse and
    Geisser's, or (2), Huynh and Feldt's with Lecoutre's (1991) correction for groups, at most 1.
    """
    ss, ss_error, r, q, nu, gg = columns.T
    with np.errstate(invalid="ignore", divide="ignore"):
        f = np.where(ss_error > 0, (ss / (r * q)) / (ss_error / (q * nu)), np.nan)
        # with q eps = nu (few participants) Huynh-Feldt has no finite value; its cap, 1, is used
        room = nu - q * gg > 1e-9 * nu
        hf = np.where(q == 1, gg, np.where(room, ((nu + 1) * q * gg - 2) / (q * (nu - q * gg)), np.nan))
    used = np.where(np.isnan(hf), 1.0, np.minimum(1.0, hf))
    shrink = np.stack([np.ones_like(q), gg, used])
    df1, df2 = shrink * r * q, shrink * q * nu
    p, p_gg, p_hf = special.fdtrc(df1, df2, f).tolist()
    (_, d1_gg, d1_hf), (_, d2_gg, d2_hf) = df1.tolist(), df2.tolist()
    f_values, hf_values = f.tolist(), hf.tolist()
    return [
        UnivariateTest(
            ss=s.ss,
            ss_error=s.error.ss,
            df_effect=s.rank * s.error.q,
            df_error=s.error.q * s.error.df,
            f_value=f_values[i],
            p_value=p[i],
            epsilon_gg=s.error.epsilon,
            p_gg=p_gg[i],
            epsilon_hf=hf_values[i],
            p_hf=p_hf[i],
            df_effect_gg=d1_gg[i],
            df_error_gg=d2_gg[i],
            df_effect_hf=d1_hf[i],
            df_error_hf=d2_hf[i],
        )
        for i, s in enumerate(scores)
    ]


def _four_statistics(scores: Sequence[Scores]) -> list[FourStatistics | None]:
    """The statistics of each effect that has them; those with one exact F are computed together."""
    exact = [i for i, s in enumerate(scores) if s.reason is None and 1 in (s.rank, s.error.q)]
    dimensions = np.array(
        [(scores[i].eigenvalues[0], scores[i].error.q, scores[i].rank, scores[i].error.df) for i in exact]
    ).reshape(-1, 4)
    together = dict(zip(exact, exact_statistics(*dimensions.T), strict=True))
    return [
        None
        if s.reason is not None
        else together[i]
        if i in together
        else four_statistics(s.eigenvalues, s.error.q, s.rank, s.error.df)
        for i, s in enumerate(scores)
    ]


def _one_test(four: FourStatistics, scores: Scores, sizes: SizeIntervals, at: int) -> MultivariateTest:
    first, smaller = four.pillai, min(scores.rank, scores.error.q)
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


def _mauchly(error: ErrorScores) -> Mauchly | None:
    if error.q == 1 or error.whiten is None:
        return None
    q, nu = error.q, error.df
    rho = 1 - (2 * q**2 + q + 2) / (6 * q * nu)
    chi2, df = -nu * rho * error.log_w, q * (q + 1) / 2 - 1
    # R's mauchly.test has 3k for 3q here (k cells); this is the textbook's form, so p differs by up to .003
    omega = (q + 2) * (q - 1) * (q - 2) * (2 * q**3 + 6 * q**2 + 3 * q + 2) / (288 * (nu * q * rho) ** 2)
    first, second = special.chdtrc(df, chi2), special.chdtrc(df + 4, chi2)
    return Mauchly(float(np.exp(error.log_w)), float(np.clip(first + omega * (second - first), 0, 1)))
