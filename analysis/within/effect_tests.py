"""The tests of one effect from its contrast scores: univariate, corrected, multivariate, Mauchly."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special

from analysis.within.contrasts import effect_name
from analysis.within.eta_squared import partial_eta_squared, partial_eta_squared_ci

Floats = NDArray[np.float64]

NO_VARIANCE = "the effect and its error are both zero: nothing varies"
NO_ERROR = "the error is zero: every participant shows the same effect"
SINGULAR_RATIO = 1e-10
"""Below this ratio of smallest to largest singular value (columns scaled to one) E counts as singular."""


@dataclass(frozen=True)
class UnivariateTest:
    """Univariate F with sphericity corrections; NaN where undefined (`univariate_reason` says why).

    `epsilon_hf` is uncapped; `p_hf` uses min(1, epsilon_hf).
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


@dataclass(frozen=True)
class MultivariateTest:
    """The four multivariate statistics and their one exact F on (q, N - q) df."""

    pillai: float
    wilks: float
    hotelling_lawley: float
    roy: float
    f_value: float
    df_effect: int
    df_error: int
    p_value: float


@dataclass(frozen=True)
class Mauchly:
    """Mauchly's test of sphericity, chi-square with Box's second-order term (the textbook form)."""

    w: float
    p_value: float


@dataclass(frozen=True)
class Effect:
    """All that is known about one effect. A test that does not exist is None, and its reason is given."""

    effect: str
    factors: tuple[str, ...]
    univariate: UnivariateTest
    univariate_reason: str | None
    multivariate: MultivariateTest | None
    multivariate_reason: str | None
    mauchly: Mauchly | None
    mauchly_reason: str | None
    eta_sq_partial: float
    eta_sq_partial_ci: tuple[float, float]
    eta_sq_generalized: float


@dataclass(frozen=True)
class Scores:
    """What one effect's contrast scores (N, q) boil down to; every test is arithmetic on these.

    `hotelling` is N zbar' E^-1 zbar and `log_w` the log of Mauchly's W, NaN where they do not exist
    (`reason` says why); `epsilon` is Greenhouse-Geisser's.
    """

    members: tuple[int, ...]
    q: int
    ss: float
    ss_error: float
    epsilon: float
    hotelling: float
    log_w: float
    reason: str | None


def above_noise(value: float, floor: float) -> float:
    """`value`, or exactly zero where it is no more than rounding noise."""
    return value if value > floor else 0.0


def reduce_scores(z: Floats, members: tuple[int, ...], floor: float) -> Scores:
    """Reduce contrast scores `z` (N, q) of the factors at `members`; sums below `floor` are zero."""
    n, q = z.shape
    mean = z.mean(axis=0)
    residual = z - mean
    ss = above_noise(n * float(mean @ mean), floor)
    ss_error = above_noise(float(np.vdot(residual, residual)), floor)
    if ss_error == 0.0:
        return Scores(members, q, ss, 0.0, np.nan, np.nan, np.nan, NO_ERROR if ss else NO_VARIANCE)
    if q == 1:
        return Scores(members, 1, ss, ss_error, 1.0, ss / ss_error, 0.0, None)
    error = residual.T @ residual
    epsilon = min(1.0, ss_error**2 / (q * float(np.vdot(error, error))))
    if n <= q:
        reason = f"needs more participants than contrasts: N = {n}, contrasts = {q}"
        return Scores(members, q, ss, ss_error, epsilon, np.nan, np.nan, reason)
    hotelling, log_det = _hotelling(residual, mean)
    singular = "the error matrix is singular" if np.isnan(hotelling) else None
    return Scores(
        members, q, ss, ss_error, epsilon, hotelling, log_det - q * float(np.log(ss_error / q)), singular
    )


def _hotelling(residual: Floats, mean: Floats) -> tuple[float, float]:
    """N zbar' E^-1 zbar and log det E by the singular values of the residuals; NaN where E is singular."""
    scale = np.sqrt(np.einsum("ij,ij->j", residual, residual))
    if (scale <= SINGULAR_RATIO * scale.max()).any():
        return np.nan, np.nan
    _, singular, right = np.linalg.svd(residual / scale, full_matrices=False)
    if singular[-1] <= SINGULAR_RATIO * singular[0]:
        return np.nan, np.nan
    along = (right @ (mean / scale)) / singular
    return len(residual) * float(along @ along), 2 * float(np.log(singular).sum() + np.log(scale).sum())


def effects_of(
    scores: list[Scores], n: int, factors: list[str], ss_participants: float, confidence: float
) -> tuple[Effect, ...]:
    """Every effect from its scores; p values and intervals of all effects are computed together."""
    univariate = _univariate(scores, n)
    ss, ss_error = np.array([s.ss for s in scores]), np.array([s.ss_error for s in scores])
    f, q = np.array([u.f_value for u in univariate]), np.array([s.q for s in scores])
    eta, ci = partial_eta_squared(ss, ss_error), partial_eta_squared_ci(f, q, q * (n - 1), confidence)
    with np.errstate(invalid="ignore"):
        generalized = ss / (ss + ss_participants + ss_error.sum())
    multivariate = _multivariate(scores, n)
    return tuple(
        Effect(
            effect=effect_name([factors[m] for m in s.members]),
            factors=tuple(factors[m] for m in s.members),
            univariate=univariate[i],
            univariate_reason=s.reason if s.ss_error == 0 else None,
            multivariate=multivariate[i],
            multivariate_reason=s.reason,
            mauchly=_mauchly(s, n),
            mauchly_reason="one contrast: sphericity holds by definition" if s.q == 1 else s.reason,
            eta_sq_partial=float(eta[i]),
            eta_sq_partial_ci=(float(ci[i, 0]), float(ci[i, 1])),
            eta_sq_generalized=float(generalized[i]),
        )
        for i, s in enumerate(scores)
    )


def _univariate(scores: list[Scores], n: int) -> list[UnivariateTest]:
    columns = np.array([(s.ss, s.ss_error, s.q, s.epsilon) for s in scores])
    ss, ss_error, q, gg = columns.T
    nu = n - 1
    with np.errstate(invalid="ignore", divide="ignore"):
        f = np.where(ss_error > 0, (ss / q) / (ss_error / (q * nu)), np.nan)
        # with q eps = nu (few participants) Huynh-Feldt has no finite value; its cap, 1, is used
        room = nu - q * gg > 1e-9 * nu
        hf = np.where(q == 1, gg, np.where(room, (n * q * gg - 2) / (q * (nu - q * gg)), np.nan))
    used = np.where(np.isnan(hf), 1.0, np.minimum(1.0, hf))
    shrink = np.stack([np.ones_like(q), gg, used])
    p, p_gg, p_hf = special.fdtrc(shrink * q, shrink * q * nu, f)
    return [
        UnivariateTest(
            ss=s.ss,
            ss_error=s.ss_error,
            df_effect=s.q,
            df_error=s.q * nu,
            f_value=float(f[i]),
            p_value=float(p[i]),
            epsilon_gg=s.epsilon,
            p_gg=float(p_gg[i]),
            epsilon_hf=float(hf[i]),
            p_hf=float(p_hf[i]),
        )
        for i, s in enumerate(scores)
    ]


def _multivariate(scores: list[Scores], n: int) -> list[MultivariateTest | None]:
    q = np.array([s.q for s in scores])
    size = np.array([s.hotelling for s in scores])
    f = size * (n - q) / q
    p = special.fdtrc(q, np.maximum(n - q, 1), f)
    return [
        None
        if s.reason is not None
        else MultivariateTest(
            pillai=float(size[i] / (1 + size[i])),
            wilks=float(1 / (1 + size[i])),
            hotelling_lawley=float(size[i]),
            roy=float(size[i]),
            f_value=float(f[i]),
            df_effect=s.q,
            df_error=n - s.q,
            p_value=float(p[i]),
        )
        for i, s in enumerate(scores)
    ]


def _mauchly(s: Scores, n: int) -> Mauchly | None:
    if s.q == 1 or s.reason is not None:
        return None
    q, nu = s.q, n - 1
    rho = 1 - (2 * q**2 + q + 2) / (6 * q * nu)
    chi2, df = -nu * rho * s.log_w, q * (q + 1) / 2 - 1
    # R's mauchly.test has 3k for 3q here (k cells); this is the textbook's form, so p differs by up to .003
    omega = (q + 2) * (q - 1) * (q - 2) * (2 * q**3 + 6 * q**2 + 3 * q + 2) / (288 * (nu * q * rho) ** 2)
    first, second = special.chdtrc(df, chi2), special.chdtrc(df + 4, chi2)
    return Mauchly(float(np.exp(s.log_w)), float(np.clip(first + omega * (second - first), 0, 1)))
