"""The n-way within-participant ANOVA: univariate and multivariate tests of every effect."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import special

from analysis.contrasts import effect_members, effect_name, effect_scores, rotate
from analysis.effects import partial_eta_squared, partial_eta_squared_ci
from experiments.errors import InputError

Floats = NDArray[np.float64]

NO_VARIANCE = "the effect and its error are both zero: nothing varies"
NO_ERROR = "the error is zero: every participant shows the same effect"
SINGULAR_RATIO = 1e-10
"""Below this ratio of smallest to largest singular value (columns scaled to one) E counts as singular."""


@dataclass(frozen=True)
class UnivariateTest:
    """Univariate F with sphericity corrections; NaN where undefined (the effect's `univariate_reason` says why).

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
class AnovaResult:
    """Every effect of a within-participant design, and the cell means (N, a, b, ...) it came from."""

    effects: tuple[Effect, ...]
    factors: tuple[str, ...]
    levels: tuple[tuple[str, ...], ...]
    n_participants: int
    ss_participants: float
    confidence: float
    y: Floats = field(repr=False, compare=False)

    def effect(self, name: str) -> Effect:
        """Return the effect called `name`, its factors in any order."""
        wanted = frozenset(name.split(":"))
        for effect in self.effects:
            if effect.effect == name or frozenset(effect.factors) == wanted:
                return effect
        raise InputError(
            f"no effect is called '{name}'; effects: {', '.join(e.effect for e in self.effects)}"
        )


@dataclass(frozen=True)
class _Scores:
    """What one effect's contrast scores (N, q) boil down to; everything later is arithmetic on these."""

    members: tuple[int, ...]
    q: int
    ss: float
    ss_error: float
    epsilon: float
    hotelling: float
    log_w: float
    multivariate_reason: str | None


def within_anova(
    y: ArrayLike,
    factors: Sequence[str],
    levels: Sequence[Sequence[str]] | None = None,
    confidence: float = 0.95,
) -> AnovaResult:
    """Repeated-measures ANOVA with any number of within factors and no between factor.

    Parameters
    ----------
    y : (N, a, b, ...) participants' cell means, one axis a factor; complete, finite, N >= 2.
    factors : names of the factors, in axis order.
    levels : level names of each factor, in index order; numbers from 1 where None.
    confidence : coverage of the intervals of partial eta squared.

    Raises
    ------
    InputError
        One participant, a factor with one level, missing values, or names that do not fit the shape.

    Notes
    -----
    Univariate, Greenhouse-Geisser, Huynh-Feldt (Lecoutre's correction equals it here), Mauchly, and the
    multivariate test Hotelling-Lawley on (q, N - q) df that the paper prints.
    Source: Maxwell & Delaney (2004), chapters 11-14; Olejnik & Algina (2003) for generalised eta squared.
    """
    cells = _checked(y, factors, levels)
    n, k = cells.shape[0], cells[0].size
    floor = n * k * (8 * np.finfo(float).eps * float(np.abs(cells).max())) ** 2
    participant_means = cells.reshape(n, -1).mean(axis=1)
    spread = participant_means - participant_means.mean()
    ss_participants = _above(k * float(spread @ spread), floor)
    centred = cells - participant_means.reshape(-1, *[1] * len(factors))
    rotated = rotate(centred)
    scores = [_reduce(effect_scores(rotated, m), m, floor) for m in effect_members(len(factors))]
    names = levels or [[str(i + 1) for i in range(size)] for size in cells.shape[1:]]
    return AnovaResult(
        effects=_effects(scores, n, list(factors), ss_participants, confidence),
        factors=tuple(factors),
        levels=tuple(tuple(str(level) for level in group) for group in names),
        n_participants=n,
        ss_participants=ss_participants,
        confidence=confidence,
        y=cells,
    )


def _checked(y: ArrayLike, factors: Sequence[str], levels: Sequence[Sequence[str]] | None) -> Floats:
    cells = np.asarray(y, dtype=np.float64)
    if cells.ndim != len(factors) + 1 or not factors:
        raise InputError(
            f"expected one axis for participants and one for each of {list(factors)}, got {cells.shape}"
        )
    if cells.shape[0] < 2:
        raise InputError(
            f"expected at least 2 complete participants, got {cells.shape[0]}; the test has no error term"
        )
    for factor, size in zip(factors, cells.shape[1:], strict=True):
        if size < 2:
            raise InputError(f"expected at least 2 levels of '{factor}', got {size}; leave the factor out")
    if levels is not None and tuple(len(group) for group in levels) != cells.shape[1:]:
        raise InputError(
            f"expected level names for the shape {cells.shape[1:]}, got {[len(g) for g in levels]}"
        )
    if not np.isfinite(cells).all():
        raise InputError("expected a finite mean in every cell; drop participants with empty cells first")
    return cells


def _above(value: float, floor: float) -> float:
    """`value`, or exactly zero where it is no more than rounding noise."""
    return value if value > floor else 0.0


def _reduce(z: Floats, members: tuple[int, ...], floor: float) -> _Scores:
    n, q = z.shape
    mean = z.mean(axis=0)
    residual = z - mean
    ss, ss_error = _above(n * float(mean @ mean), floor), _above(float(np.vdot(residual, residual)), floor)
    if ss_error == 0.0:
        return _Scores(members, q, ss, 0.0, np.nan, np.nan, np.nan, NO_ERROR if ss else NO_VARIANCE)
    if q == 1:
        return _Scores(
            members, 1, ss, ss_error, 1.0, n * float(mean @ mean) / ss_error if ss else 0.0, 0.0, None
        )
    error = residual.T @ residual
    epsilon = min(1.0, ss_error**2 / (q * float(np.vdot(error, error))))
    if n <= q:
        reason = f"needs more participants than contrasts: N = {n}, contrasts = {q}"
        return _Scores(members, q, ss, ss_error, epsilon, np.nan, np.nan, reason)
    hotelling, log_det = _hotelling(residual, mean)
    reason = "the error matrix is singular" if np.isnan(hotelling) else None
    return _Scores(members, q, ss, ss_error, epsilon, hotelling, log_det - q * np.log(ss_error / q), reason)


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


def _effects(
    scores: list[_Scores], n: int, factors: list[str], ss_participants: float, confidence: float
) -> tuple[Effect, ...]:
    ss, sse, q, epsilon = (
        np.array([getattr(s, name) for s in scores], dtype=float)
        for name in ("ss", "ss_error", "q", "epsilon")
    )
    nu = n - 1
    with np.errstate(invalid="ignore", divide="ignore"):
        f = np.where(sse > 0, (ss / q) / (sse / (q * nu)), np.nan)
        hf = np.where(q == 1, epsilon, (n * q * epsilon - 2) / (q * (nu - q * epsilon)))
    hf[~np.isfinite(hf) | (nu - q * epsilon <= 1e-9 * nu) & (q > 1)] = np.nan
    capped = np.where(np.isnan(hf) & (sse > 0), 1.0, np.minimum(1.0, hf))
    factor = np.stack([np.ones_like(q), epsilon, capped])
    p, p_gg, p_hf = special.fdtrc(factor * q, factor * q * nu, f)
    eta = partial_eta_squared(ss, sse)
    ci = partial_eta_squared_ci(f, q, q * nu, confidence)
    with np.errstate(invalid="ignore"):
        general = ss / (ss + ss_participants + sse.sum())
    univariate = [
        UnivariateTest(*map(float, row[:2]), int(row[2]), int(row[2]) * nu, *map(float, row[3:]))
        for row in np.stack([ss, sse, q, f, p, epsilon, p_gg, hf, p_hf], axis=1)
    ]
    multivariate, mauchly = _multivariate(scores, n), _mauchly(scores, n)
    return tuple(
        Effect(
            effect=effect_name([factors[m] for m in s.members]),
            factors=tuple(factors[m] for m in s.members),
            univariate=univariate[i],
            univariate_reason=s.multivariate_reason if s.ss_error == 0 else None,
            multivariate=multivariate[i],
            multivariate_reason=s.multivariate_reason,
            mauchly=mauchly[i][0],
            mauchly_reason=mauchly[i][1],
            eta_sq_partial=float(eta[i]),
            eta_sq_partial_ci=(float(ci[i, 0]), float(ci[i, 1])),
            eta_sq_generalized=float(general[i]),
        )
        for i, s in enumerate(scores)
    )


def _multivariate(scores: list[_Scores], n: int) -> list[MultivariateTest | None]:
    q = np.array([s.q for s in scores], dtype=float)
    size = np.array([s.hotelling for s in scores])
    f = size * (n - q) / q
    p = special.fdtrc(q, np.maximum(n - q, 1), f)
    return [
        None
        if np.isnan(size[i])
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


def _mauchly(scores: list[_Scores], n: int) -> list[tuple[Mauchly | None, str | None]]:
    return [_mauchly_of(s, n) for s in scores]


def _mauchly_of(s: _Scores, n: int) -> tuple[Mauchly | None, str | None]:
    if s.q == 1:
        return None, "one contrast: sphericity holds by definition"
    if np.isnan(s.log_w):
        return None, s.multivariate_reason
    q, nu = s.q, n - 1
    rho = 1 - (2 * q**2 + q + 2) / (6 * q * nu)
    chi2 = -nu * rho * s.log_w
    df = q * (q + 1) / 2 - 1
    # R's mauchly.test has 3k for 3q here (k cells); this is the textbook's form, so p differs by up to .003
    omega = (q + 2) * (q - 1) * (q - 2) * (2 * q**3 + 6 * q**2 + 3 * q + 2) / (288 * (nu * q * rho) ** 2)
    first, second = special.chdtrc(df, chi2), special.chdtrc(df + 4, chi2)
    return Mauchly(float(np.exp(s.log_w)), float(np.clip(first + omega * (second - first), 0, 1))), None
