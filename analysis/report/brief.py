"""What an analysis of means found, in a few lines for the first page."""

import math

from analysis.plans.result import Analysis
from analysis.report.numbers import fixed
from analysis.report.sentences import effect_p, statistics_in_brief
from analysis.within.effects import Effect
from analysis.within.simple_effects import SIGNIFICANCE

MAX_LEVELS = 4
"""Of a factor with more levels the highest and the lowest mean are named."""


def brief(analysis: Analysis) -> tuple[str, ...]:
    """Who was analysed, each effect that was found with its size, and what was not shown."""
    tested = [effect for effect in analysis.anova.effects if math.isfinite(effect_p(analysis, effect))]
    shown = [effect for effect in tested if effect_p(analysis, effect) < SIGNIFICANCE]
    lines = [f"{analysis.n_participants} participants with data in every cell."]
    lines += [_line(analysis, effect) for effect in shown]
    rest = [analysis.labels.effect(effect.factors) for effect in tested if effect not in shown]
    if rest:
        lines.append(f"No effect was shown, which is no proof of none, of: {', '.join(rest)}.")
    return tuple(lines)


def _line(analysis: Analysis, effect: Effect) -> str:
    kind = "differ by" if len(effect.factors) == 1 else "differ by the interaction of"
    said = f"Ratings {kind} {analysis.labels.effect(effect.factors)}"
    return f"{said}, {statistics_in_brief(analysis, effect)}{_means(analysis, effect)}."


def _means(analysis: Analysis, effect: Effect) -> str:
    """Means of a factor's levels, highest first; nothing of an interaction or a covariate."""
    if len(effect.factors) > 1 or effect.factors[0] not in analysis.anova.all_factors:
        return ""
    factor = effect.factors[0]
    means = sorted((mean for mean in analysis.means if mean.effect == factor), key=lambda mean: -mean.mean)
    if len(means) > MAX_LEVELS:
        means = [means[0], means[-1]]
    named = [f"{analysis.labels.level(factor, mean.levels[factor])} {fixed(mean.mean)}" for mean in means]
    return f". Means: {', '.join(named)}"
