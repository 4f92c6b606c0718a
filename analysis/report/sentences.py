"""Sentences in APA style, one an effect."""

import math

from analysis.plans.result import Analysis
from analysis.report.effect_tables import has_sphericity
from analysis.report.numbers import apa_p, fixed, share, share_interval
from analysis.report.table_cells import corrected_df
from analysis.report.tables import uses_multivariate
from analysis.within.effects import Effect
from analysis.within.multivariate_tests import MultivariateTest
from analysis.within.simple_effects import SIGNIFICANCE, first_p
from analysis.within.univariate import UnivariateTest


def sentences(analysis: Analysis) -> tuple[str, ...]:
    """One sentence an effect: direction of two-level factors, test, effect size with its interval."""
    multivariate = uses_multivariate(analysis)
    return tuple(_sentence(analysis, effect, multivariate) for effect in analysis.anova.effects)


def _sentence(analysis: Analysis, effect: Effect, multivariate: bool) -> str:
    kind = "main effect of" if len(effect.factors) == 1 else "interaction of"
    name = analysis.labels.effect(effect.factors)
    p = _p(effect, multivariate)
    if not math.isfinite(p):
        return f"The {kind} {name} could not be tested: {effect.univariate_reason}."
    verdict = "was significant" if p < SIGNIFICANCE else "was not significant"
    sentence = f"The {kind} {name} {verdict}, {_statistics(effect, multivariate)}."
    return sentence + (
        _direction(analysis, effect, p < SIGNIFICANCE)
        if len(effect.factors) == 1 and effect.factors[0] in analysis.anova.all_factors
        else ""
    )


def effect_p(analysis: Analysis, effect: Effect) -> float:
    """The p that the effect's sentence gives."""
    return _p(effect, uses_multivariate(analysis))


def statistics_in_brief(analysis: Analysis, effect: Effect) -> str:
    """F, p and size of the effect as its sentence begins with them, without intervals."""
    m = effect.multivariate
    if uses_multivariate(analysis) and m is not None and has_sphericity(effect):
        return f"{_multivariate_f(m)}, {_share_explained(m.eta_sq_partial)}"
    return f"{_univariate_f(effect.univariate)}, {_share_explained(effect.eta_sq_partial)}"


def _p(effect: Effect, multivariate: bool) -> float:
    return first_p(effect, multivariate)


def _statistics(effect: Effect, multivariate: bool) -> str:
    m = effect.multivariate
    if multivariate and m is not None and has_sphericity(effect):
        test = f"{_multivariate_f(m)}, Pillai's trace = {share(m.pillai, 2)}"
        return f"{test}, {_size(m.eta_sq_partial, m.eta_sq_partial_ci)} (univariate {_univariate(effect)})"
    return _univariate(effect)


def _univariate(effect: Effect) -> str:
    """The univariate F with its own df, p and size, corrected where sphericity may fail."""
    u = effect.univariate
    correction = f", Greenhouse-Geisser ε = {share(u.epsilon_gg, 2)}" if has_sphericity(effect) else ""
    return f"{_univariate_f(u)}{correction}, {_size(effect.eta_sq_partial, effect.eta_sq_partial_ci)}"


def _multivariate_f(test: MultivariateTest) -> str:
    return f"F({test.df_effect}, {test.df_error}) = {fixed(test.f_value)}, {apa_p(test.p_value)}"


def _univariate_f(test: UnivariateTest) -> str:
    return f"F({corrected_df(test)}) = {fixed(test.f_value)}, {apa_p(test.p_gg)}"


def _size(eta: float, interval: tuple[float, float]) -> str:
    return f"{_share_explained(eta)}, 95% CI {share_interval(interval)}"


def _share_explained(eta: float) -> str:
    return f"partial η² = {share(eta, 2)}"


def _direction(analysis: Analysis, effect: Effect, differs: bool) -> str:
    factor = effect.factors[0]
    means = sorted((m for m in analysis.means if m.effect == factor), key=lambda m: -m.mean)
    said = [
        f"{analysis.labels.level(factor, m.levels[factor])} (M = {fixed(m.mean)}, SE = {fixed(m.se)})"
        for m in means
    ]
    if not differs:
        return f" Means: {', '.join(said)}."
    if len(said) == 2:
        return (
            f" Ratings were {fixed(means[0].mean - means[1].mean)} higher for {said[0]} than for {said[1]}."
        )
    return f" From highest to lowest: {', '.join(said)}."
