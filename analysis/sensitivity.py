"""Sensitivity analyses beside the ANOVA: Bayes factors of pairs, the mixed and the ordinal model."""

from collections.abc import Callable
from math import isfinite

from analysis.formats import Table
from analysis.numbers import DASH, fixed
from analysis.report import Section
from analysis.result import Analysis

PRIOR_SCALE = 2**0.5 / 2
"""Scale r of the Cauchy prior on effect sizes."""


def sensitivity_sections(
    analysis: Analysis, progress: Callable[[str], None] = lambda _: None
) -> tuple[Section, ...]:
    """Every sensitivity analysis the data allow, as sections of the report."""
    progress("Bayes factors")
    return (bayes_factors(analysis),)


def bayes_factors(analysis: Analysis) -> Section:
    """JZS Bayes factors of the planned pairs (all one-factor pairs where none are planned).

    Source: Rouder et al. (2009), doi:10.3758/PBR.16.2.225; computed by pingouin.
    """
    # pingouin takes seconds to import, which only the report pays
    from pingouin import bayesfactor_ttest

    planned = analysis.experiment.analysis.pairs if analysis.experiment else ()
    pairs = [p for p in analysis.pairs if p.effect in (planned or analysis.anova.factors)]
    rows = []
    for pair in pairs:
        bf = float("nan")
        if isfinite(pair.t):
            bf = float(bayesfactor_ttest(pair.t, analysis.n_participants, paired=True, r=PRIOR_SCALE))
        name = f"{pair.effect}: {pair.level_a} - {pair.level_b}"
        rows.append((name, fixed(pair.t), _factor(bf), _factor(1 / bf if bf else bf), _in_words(bf)))
    header = ("Margin: pair", "t", "BF10", "BF01", "evidence")
    table = Table("bayes", f"Bayes factors of pairs, {analysis.name}", header, tuple(rows), 1)
    text = (
        "BF10 says how much better a difference predicts the data than none, BF01 the reverse. JZS prior, "
        "Cauchy scale r = √2/2. Between 1/3 and 3 the data do not tell."
    )
    return Section("Bayes factors", text, (table,))


def _factor(value: float) -> str:
    if not isfinite(value):
        return DASH
    if value >= 1000:
        return f"{value:.1e}"
    if value < 0.001:
        return "<0.001"
    return fixed(value, 2 if value >= 0.1 else 3)


def _in_words(bf: float) -> str:
    """Jeffreys' words for the strength of evidence."""
    if not isfinite(bf):
        return DASH
    side, size = ("a difference", bf) if bf >= 1 else ("no difference", 1 / bf if bf > 0 else float("inf"))
    for limit, word in ((3, "weak"), (10, "moderate"), (30, "strong"), (100, "very strong")):
        if size < limit:
            return f"{word}, for {side}"
    return f"extreme, for {side}"
