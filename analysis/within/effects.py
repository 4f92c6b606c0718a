"""All that is known about each effect of a design."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from analysis.within.contrasts import effect_name
from analysis.within.multivariate_tests import MultivariateTest, MultivariateTests
from analysis.within.strata import Hypothesis, Mauchly, SizeIntervals, UnivariateTest, univariate_tests


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
