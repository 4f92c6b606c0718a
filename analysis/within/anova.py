"""The n-way ANOVA of cell means within and between participants, by the multivariate linear model."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import special

from analysis.within.between import BetweenDesign, no_groups, term_directions
from analysis.within.multivariate_tests import MultivariateTest, MultivariateTests
from analysis.within.strata import (
    Hypothesis,
    Mauchly,
    SizeIntervals,
    above_noise,
    contrast_scores,
    effect_name,
    error_stratum,
)
from experiments.errors import InputError

Floats = NDArray[np.float64]
SumOfSquares = Literal[2, 3]


# Univariate F tests, uncorrected and corrected for lack of sphericity.


class UnivariateTest(NamedTuple):
    """Univariate F with sphericity corrections; NaN where undefined (the effect's reason says why).

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


def univariate_tests(hypotheses: Sequence[Hypothesis]) -> list[UnivariateTest]:
    r"""The univariate test of each hypothesis; p values of all are computed together.

    Notes
    -----
    .. math:: F = \frac{SS / (r q)}{SS_e / (q \nu)}
        \quad\text{on } \epsilon r q \text{ and } \epsilon q \nu \text{ df} \tag{1}

    q contrasts within people, r between them, nu the df of people within groups; epsilon is 1, Greenhouse and
    Geisser's, or Huynh and Feldt's (`huynh_feldt`), at most 1.
    """
    everything = [_f_and_df(h) for h in hypotheses]
    errors = [h.error for h in hypotheses]
    columns = np.array(everything, dtype=np.float64).T
    # Three p values per effect in one call: each call of scipy costs more than the values.
    p_values = special.fdtrc(columns[1::2], columns[2::2], columns[0]).T.tolist()
    return [
        UnivariateTest(h.ss, e.ss, df1, df2, f, p, e.epsilon_gg, p_gg, e.epsilon_hf, p_hf, *corrected)
        for h, e, (f, df1, df2, *corrected), (p, p_gg, p_hf) in zip(
            hypotheses, errors, everything, p_values, strict=True
        )
    ]


def _f_and_df(hypothesis: Hypothesis) -> tuple[float, int, int, float, float, float, float]:
    """F and its df of effect and error: uncorrected, Greenhouse-Geisser's, Huynh-Feldt's."""
    error = hypothesis.error
    df1, df2 = hypothesis.rank * error.q, error.q * error.df
    f_value = (hypothesis.ss / df1) / (error.ss / df2) if error.ss else math.nan
    # With few participants there is no Huynh-Feldt epsilon: its df stay uncorrected.
    gg, hf = error.epsilon_gg, 1.0 if math.isnan(error.epsilon_hf) else min(1.0, error.epsilon_hf)
    return f_value, df1, df2, gg * df1, gg * df2, hf * df1, hf * df2


# All that is known about each effect of a design.


@dataclass(frozen=True)
class Effect:
    """All that is known about one effect. A test that does not exist is None, and its reason is given.

    `eta_sq_partial` and its interval belong to the univariate F; the interval uses Greenhouse-Geisser's df.
    `between` are factors between participants and covariates, `within` those within.
    """

    effect: str
    between: tuple[str, ...]
    within: tuple[str, ...]
    univariate: UnivariateTest
    eta_sq_generalized: float
    hypothesis: Hypothesis = field(repr=False, compare=False)
    sizes: SizeIntervals = field(repr=False, compare=False)
    several: MultivariateTests = field(repr=False, compare=False)
    at: int = field(repr=False, compare=False)

    @property
    def factors(self) -> tuple[str, ...]:
        """Those between participants and covariates, then those within."""
        return (*self.between, *self.within)

    @property
    def univariate_reason(self) -> str | None:
        """Why there is no univariate F."""
        return None if self.univariate.ss_error else self.hypothesis.reason

    @property
    def multivariate(self) -> MultivariateTest | None:
        """The multivariate test, computed when it is asked for."""
        return self.several.test(self.at)

    @property
    def multivariate_reason(self) -> str | None:
        """Why there is no multivariate test."""
        return self.hypothesis.reason

    @property
    def mauchly(self) -> Mauchly | None:
        """Mauchly's test of the contrasts within."""
        return self.hypothesis.error.mauchly

    @property
    def mauchly_reason(self) -> str | None:
        """Why there is no test of Mauchly's."""
        # A single contrast has nothing to be spherical with.
        one = self.hypothesis.error.q == 1
        return "one contrast: sphericity holds by definition" if one else self.hypothesis.reason

    @property
    def eta_sq_partial(self) -> float:
        """SS / (SS + error SS)."""
        return _share(self.univariate.ss, self.univariate.ss_error)

    @property
    def eta_sq_partial_ci(self) -> tuple[float, float]:
        """Interval of `eta_sq_partial`."""
        return self.sizes.interval(self.at)

    @property
    def omega_sq_partial(self) -> float:
        """(F - 1) df1 / (F df1 + df2 + 1)."""
        f, df1, df2 = self.univariate.f_value, self.univariate.df_effect, self.univariate.df_error
        return (f - 1) * df1 / (f * df1 + df2 + 1)


def _share(ss: float, ss_error: float) -> float:
    """The share of the effect in two sums of squares; NaN where nothing varies."""
    return ss / (ss + ss_error) if ss + ss_error else math.nan


def effects_of(
    hypotheses: Sequence[Hypothesis], factors: Sequence[str], ss_error_total: float, confidence: float
) -> tuple[Effect, ...]:
    """Every effect from its hypothesis; what several effects need is computed together.

    Parameters
    ----------
    hypotheses : sequence of Hypothesis
    factors : sequence of str
        The within factors.
    ss_error_total : float
        Sum of the errors of all strata.
    confidence : float
        Coverage of the intervals of partial eta squared.
    """
    univariate = univariate_tests(hypotheses)
    corrected = [(u.f_value, u.df_effect_gg, u.df_error_gg) for u in univariate]
    # Shared by all effects: intervals take Newton steps, which are as fast for twenty effects as for one.
    sizes = SizeIntervals(corrected, confidence)
    several = MultivariateTests(hypotheses, sizes, confidence)
    effects = []
    for at, (h, u) in enumerate(zip(hypotheses, univariate, strict=True)):
        within = tuple([factors[m] for m in h.error.members])
        name, general = effect_name((*h.between, *within)), _share(h.ss, ss_error_total)
        effects.append(Effect(name, h.between, within, u, general, h, sizes, several, at))
    return tuple(effects)


# The effects of a design together, from the cell means.


@dataclass(frozen=True)
class AnovaResult:
    """Every effect of a design, and the cell means (N, a, b, ...) it came from.

    `factors` and `levels` are those within participants, in axis order; `between` holds groups and
    covariates. `ss_participants` is the error between participants: what groups and covariates leave.
    """

    effects: tuple[Effect, ...]
    factors: tuple[str, ...]
    levels: tuple[tuple[str, ...], ...]
    n_participants: int
    ss_participants: float
    confidence: float
    y: Floats = field(repr=False, compare=False)
    between: BetweenDesign = field(repr=False, compare=False)
    sum_of_squares: SumOfSquares = 3

    @property
    def all_factors(self) -> tuple[str, ...]:
        """Factors between participants, then those within."""
        return (*self.between.factors, *self.factors)

    @property
    def all_levels(self) -> tuple[tuple[str, ...], ...]:
        """Levels of `all_factors`."""
        return (*self.between.levels, *self.levels)

    @property
    def df_error(self) -> int:
        """Participants less coefficients between them: N - 1 where all are of one group."""
        return self.n_participants - int(self.between.matrix.shape[1])

    def effect(self, name: str) -> Effect:
        """Return the effect called `name`, its factors in any order."""
        factors = frozenset(name.split(":"))
        for effect in self.effects:
            if effect.effect == name or frozenset(effect.factors) == factors:
                return effect
        raise InputError(
            f"no effect is called '{name}'; effects: {', '.join(e.effect for e in self.effects)}"
        )


def within_anova(
    y: ArrayLike,
    factors: Sequence[str],
    levels: Sequence[Sequence[str]] | None = None,
    confidence: float = 0.95,
) -> AnovaResult:
    """Repeated-measures ANOVA with any number of within factors and no between factor.

    Parameters
    ----------
    y : (N, a, b, ...) array
        Participants' cell means, one axis per factor; complete, finite, N >= 2.
    factors : sequence of str
        Names of the factors, in axis order.
    levels : sequence of sequences of str, optional
        Level names of each factor, in index order; numbers from 1 if not given.
    confidence : float
        Coverage of the intervals of partial eta squared.

    Returns
    -------
    AnovaResult

    Raises
    ------
    InputError
        One participant, a factor with one level, missing values, or names that do not fit the shape.
    """
    if not factors:
        raise InputError("expected at least one factor")
    cells = np.asarray(y, dtype=np.float64)
    return linear_anova(cells, factors, levels, no_groups(len(cells)), 3, confidence)


# Decision 0360: One multivariate linear model for within, between and covariates.
def linear_anova(
    y: ArrayLike,
    factors: Sequence[str],
    levels: Sequence[Sequence[str]] | None,
    between: BetweenDesign,
    sum_of_squares: SumOfSquares = 3,
    confidence: float = 0.95,
) -> AnovaResult:
    r"""Analysis of variance of any within x between x covariate design, groups of any sizes.

    Parameters
    ----------
    y : (N, a, b, ...) array
        Participants' cell means, one axis per within factor; (N,) where there is none.
    factors : sequence of str
        Names of the within factors, in axis order.
    levels : sequence of sequences of str, optional
        Level names of each within factor.
    between : BetweenDesign
        Groups and covariates of the same N participants.
    sum_of_squares : {2, 3}
        Type II or III.
    confidence : float
        Coverage of the intervals of partial eta squared.

    Returns
    -------
    AnovaResult

    Raises
    ------
    InputError
        As `within_anova`; no effect at all.

    Notes
    -----
    :math:`Y M = X B + R` with Y (N, K) cell means, M orthonormal contrasts (K, q) of the within part of an
    effect, X (N, p) the design between participants. For a term with orthonormal directions U (r, N)
    (see `term_directions`)

    1. :math:`H = (U Y M)' (U Y M)`, :math:`E = R'R`, error df :math:`\nu = N - p`;
    2. univariate :math:`F = \frac{\mathrm{tr} H / (r q)}{\mathrm{tr} E / (q \nu)}` on
       :math:`r q, q \nu`, both times :math:`\epsilon` where corrected: Greenhouse-Geisser
       :math:`\epsilon = (\mathrm{tr} E)^2 / (q \, \mathrm{tr} E^2)`, Huynh-Feldt with Lecoutre's df
       :math:`((\nu + 1) q \epsilon - 2) / (q (\nu - q \epsilon))`;
    3. multivariate statistics from the eigenvalues of :math:`E^{-1} H` (see `four_statistics`).

    Sources: Maxwell & Delaney (2004), chapters 11-14; Fox & Weisberg (2019), appendix on multivariate linear
    models; Olejnik & Algina (2003) for generalized eta squared, all factors manipulated.
    """
    cells = _checked(y, factors, levels)
    hypotheses, total = _hypotheses(cells, between, sum_of_squares)
    if not hypotheses:
        raise InputError("expected a factor or a covariate; add --within, --between or --covariate")
    # Level names default to numbers from 1, as people count.
    names = levels or [[str(i + 1) for i in range(size)] for size in cells.shape[1:]]
    return AnovaResult(
        effects=effects_of(hypotheses, factors, sum(total.values()), confidence),
        factors=tuple(factors),
        levels=tuple(tuple(str(level) for level in group) for group in names),
        n_participants=len(cells),
        ss_participants=total[()],
        confidence=confidence,
        y=cells,
        between=between,
        sum_of_squares=sum_of_squares,
    )


def _hypotheses(
    cells: Floats, between: BetweenDesign, sum_of_squares: int
) -> tuple[list[Hypothesis], dict[tuple[int, ...], float]]:
    """Every effect, those of fewer factors first, and the error sum of squares of every stratum."""
    # Cells are rounded to eps of the largest; a sum of squares below what that rounding adds up to is noise,
    # and an F from it would be a test of nothing.
    floor = cells.size * (8 * np.finfo(float).eps * float(np.abs(cells).max())) ** 2
    z, columns = contrast_scores(cells)
    basis, df = between.basis, len(z) - between.matrix.shape[1]
    residual = z - basis @ (basis.T @ z)
    # Once more: the first projection leaves rounding of the size of the scores, the second removes it.
    residual -= basis @ (basis.T @ residual)
    # Each term's scores along its directions are shared by every set of within contrasts: projected once.
    directed = [rows @ z for rows in term_directions(between, sum_of_squares)]
    squares = np.stack([np.einsum("ij,ij->j", one, one) for one in (residual, *directed)])
    # Columns lie side by side, one stretch per set of contrasts: the sums of all strata in one pass.
    summed = np.add.reduceat(squares, [own.start for own in columns.values()], axis=1)
    hypotheses, total = [], {}
    for (members, own), (ss_error, *of_terms) in zip(
        columns.items(), above_noise(summed, floor).T.tolist(), strict=True
    ):
        error = error_stratum(residual[:, own], members, df, ss_error)
        total[members] = ss_error
        for term, along, ss in zip(between.terms, directed, of_terms, strict=True):
            # The grand mean against zero, without factors, is not an effect of the design.
            if term or members:
                hypotheses.append(Hypothesis(term, error, ss, along[:, own]))
    # Stable: effects of one order stay as the design has them.
    hypotheses.sort(key=lambda h: len(h.between) + len(h.error.members))
    return hypotheses, total


def _checked(y: ArrayLike, factors: Sequence[str], levels: Sequence[Sequence[str]] | None) -> Floats:
    cells = np.asarray(y, dtype=np.float64)
    if cells.ndim != len(factors) + 1:
        raise InputError(
            f"expected one axis for participants and one for each of {list(factors)}, got {cells.shape}"
        )
    if cells.shape[0] < 2:
        raise InputError(
            f"expected at least 2 complete participants, got {cells.shape[0]}; the test has no error term"
        )
    for factor, size in zip(factors, cells.shape[1:], strict=True):
        if size < 2:
            raise InputError(f"expected at least 2 levels of '{factor}', got {size}; remove the factor")
    if levels is not None and tuple(len(group) for group in levels) != cells.shape[1:]:
        raise InputError(
            f"expected level names for the shape {cells.shape[1:]}, got {[len(g) for g in levels]}"
        )
    if not np.isfinite(cells).all():
        raise InputError("expected a finite mean in every cell; drop participants with empty cells first")
    return cells
