"""The report of means and their tests: what `analysis anova` and a study of ratings say."""

import math
from collections.abc import Callable

from analysis.plans.result import Analysis
from analysis.report.contents import Contents, Part, Picture, Progress, Section
from analysis.report.formats import Table
from analysis.report.json_output import as_data, left_out
from analysis.report.numbers import apa_p, fixed, mean_digits, share, share_interval
from analysis.report.r_script import r_files, robust_files
from analysis.report.within_tables import all_tables, corrected_df, has_sphericity, uses_multivariate
from analysis.within.anova import Effect, UnivariateTest
from analysis.within.multivariate_tests import MultivariateTest
from analysis.within.simple_effects import SIGNIFICANCE, first_p
from table_files import counted

# Sentences in APA style, one per effect.


def sentences(analysis: Analysis) -> tuple[str, ...]:
    """One sentence per effect: direction of two-level factors, test, effect size with its interval."""
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
    digits = mean_digits(m.se for m in means)
    said = [
        f"{analysis.labels.level(factor, m.levels[factor])} "
        f"(M = {fixed(m.mean, digits)}, SE = {fixed(m.se, digits)})"
        for m in means
    ]
    if not differs:
        return f" Means: {', '.join(said)}."
    if len(said) == 2:
        by = fixed(means[0].mean - means[1].mean, digits)
        return f" Ratings were {by} higher for {said[0]} than for {said[1]}."
    return f" From highest to lowest: {', '.join(said)}."


# What an analysis of means found, in a few lines for the first page.

MAX_LEVELS = 4
"""If a factor has more levels, only the highest and the lowest mean are named."""


def brief(analysis: Analysis) -> tuple[str, ...]:
    """Who was analyzed, each effect that was found with its size, and what was not shown."""
    tested = [effect for effect in analysis.anova.effects if math.isfinite(effect_p(analysis, effect))]
    shown = [effect for effect in tested if effect_p(analysis, effect) < SIGNIFICANCE]
    lines = [f"{counted(analysis.n_participants, 'participant')} had data in every cell."]
    lines += [_line(analysis, effect) for effect in shown]
    rest = [effect for effect in tested if effect not in shown]
    names = ", ".join(analysis.labels.effect(effect.factors) for effect in rest)
    if len(rest) == 1:
        lines.append(
            "This effect was not significant (which is not evidence that it is absent): "
            f"{names}, {statistics_in_brief(analysis, rest[0])}."
        )
    elif rest:
        lines.append(
            f"These effects were not significant (which is not evidence that they are absent): {names}."
        )
    return tuple(lines)


def _line(analysis: Analysis, effect: Effect) -> str:
    kind = "differed by" if len(effect.factors) == 1 else "differed by the interaction of"
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
    digits = mean_digits(mean.se for mean in means)
    named = [
        f"{analysis.labels.level(factor, mean.levels[factor])} {fixed(mean.mean, digits)}" for mean in means
    ]
    return f". Means: {', '.join(named)}"


BETWEEN_METHODS = (
    " Groups (sum-to-zero contrasts) and covariates enter the multivariate linear model of the cell means; "
    "sums of squares are type {kind}. Means weight groups equally and are evaluated at the mean of every "
    "covariate. Error df are the number of participants minus the number of coefficients."
)

METHODS = (
    "Cell means are unweighted means of a participant's trials. Participants with an empty cell are "
    "excluded and listed. Effects are tested on orthonormal contrasts of the cell means. Multivariate: "
    "Hotelling's T², exact F on (q, N − q) df. Univariate: corrected by Greenhouse-Geisser and Huynh-Feldt. "
    "The F reported first is the exact multivariate F if every effect has one and the univariate F "
    "was not requested. Otherwise it is the univariate F with Greenhouse-Geisser df, for all effects. "
    "Marginal means and their errors are computed from each participant's marginal means. Pairs are "
    "compared by t tests, paired within participants."
)

WITHIN_BARS = " Error bars in figures are 95% within-participant intervals (Cousineau, 2005; Morey, 2008)."

MODEL_BARS = " Figures show the estimated marginal means from the table and their 95% intervals."


def contents_of(
    analysis: Analysis, more: Callable[[Progress], tuple[Section, ...]] = lambda _: ()
) -> Contents:
    """What the report of one analysis says; `more` makes further sections."""
    return Contents(
        name=analysis.name,
        title=analysis.title,
        lead=(
            f"{counted(analysis.n_participants, 'participant')}, "
            f"{analysis.labels.effect(analysis.anova.factors)}"
        ),
        source=analysis.source,
        synthetic=analysis.synthetic,
        n_participants=analysis.n_participants,
        left_out=left_out(analysis.exclusions) if analysis.exclusions else (),
        decisions=analysis.decisions,
        parts=(part_of(analysis, more),),
        methods=methods_of(analysis),
        numbers=as_data(analysis),
        given="ratings",
    )


def part_of(
    analysis: Analysis,
    more: Callable[[Progress], tuple[Section, ...]] = lambda _: (),
    title: str = "",
) -> Part:
    """The tables, sentences and figures of one analysis."""
    return Part(
        tables_of(analysis),
        sentences(analysis),
        title,
        lambda: draw_all(analysis),
        more,
        lambda key: scripts_of(analysis, key),
        brief=brief(analysis),
    )


def tables_of(analysis: Analysis) -> tuple[Table, ...]:
    """Every table, those of the robust companions last where they were asked for."""
    tables = all_tables(analysis)
    if analysis.bayes is not None:
        from analysis.report.rating_tables import bayes_tables

        tables = (*tables, *bayes_tables(analysis))
    if analysis.robust is None:
        return tables
    # what only some ask for is imported when it is
    from analysis.report.rating_tables import robust_tables

    return (*tables, *robust_tables(analysis, analysis.robust))


def scripts_of(analysis: Analysis, key: str) -> dict[str, bytes]:
    """R scripts that recompute the tables, and what they read."""
    files = r_files(analysis, key)
    if analysis.robust is None:
        return files
    return {**files, **robust_files(analysis, analysis.robust, key)}


def methods_of(analysis: Analysis) -> str:
    """How the numbers came about."""
    if not analysis.anova.between.terms[1:]:
        return METHODS + WITHIN_BARS
    return (
        METHODS + MODEL_BARS + BETWEEN_METHODS.format(kind={2: "II", 3: "III"}[analysis.anova.sum_of_squares])
    )


def draw_all(analysis: Analysis) -> tuple[Picture, ...]:
    """Draw every figure of the analysis."""
    # matplotlib takes a second to import, which commands that draw nothing need not pay
    from analysis.report.figures import draw, figures_of
    from analysis.report.pictures import in_both_formats

    pictures = []
    for spec in figures_of(analysis):
        figure, bars = draw(analysis, spec)
        shown = f"{spec.title}: mean ratings and each participant's mean. {bars}"
        pictures.append(Picture(spec.key, spec.title, shown, *in_both_formats(figure)))
    return tuple(pictures)
