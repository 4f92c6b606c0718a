"""What the tables of an analysis share: titles, and the cells of a test."""

from analysis.plans.result import Analysis
from analysis.report.captions import caption
from analysis.report.numbers import fixed, p_value
from analysis.within.effects import Effect
from analysis.within.simple_effects import first_test
from analysis.within.univariate import UnivariateTest


def title_of(analysis: Analysis, what: str) -> str:
    """A table's caption."""
    return caption(what, analysis.name, analysis.synthetic)


def test_cells(effect: Effect, multivariate: bool) -> tuple[str, str, str]:
    """F, df and p of an effect: multivariate, or univariate as Greenhouse and Geisser correct it."""
    m = first_test(effect, multivariate)
    if m is not None:
        return fixed(m.f_value), f"{m.df_effect}, {m.df_error}", p_value(m.p_value)
    u = effect.univariate
    return fixed(u.f_value), corrected_df(u), p_value(u.p_gg)


def corrected_df(test: UnivariateTest) -> str:
    """Greenhouse-Geisser's df, whole numbers where nothing is corrected."""
    if not test.epsilon_gg < 1:
        return f"{test.df_effect}, {test.df_error}"
    return f"{fixed(test.df_effect_gg)}, {fixed(test.df_error_gg)}"
