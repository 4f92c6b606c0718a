"""The tables of an analysis: the paper's layout first, then everything the tests gave."""

from analysis.plans.result import Analysis
from analysis.report.effect_tables import (
    effect_size_table,
    levene_table,
    multivariate_table,
    sphericity_table,
    univariate_table,
)
from analysis.report.formats import Table
from analysis.report.margin_tables import (
    contrasts_table,
    counts_table,
    equivalence_table,
    means_table,
    pairs_table,
    simple_effects_table,
)
from analysis.report.numbers import fixed
from analysis.report.table_cells import test_cells, title_of


def all_tables(analysis: Analysis) -> tuple[Table, ...]:
    """Every table of the report, in its order."""
    tables = [paper_table(analysis), univariate_table(analysis), sphericity_table(analysis)]
    tables += [levene_table(analysis), multivariate_table(analysis), effect_size_table(analysis)]
    tables.append(means_table(analysis))
    tables += [pairs_table(analysis), simple_effects_table(analysis), contrasts_table(analysis)]
    tables += [equivalence_table(analysis), counts_table(analysis)]
    return tuple(table for table in tables if table.rows)


def paper_table(analysis: Analysis) -> Table:
    """Conditions with mean (SE), and F and p of their factor, as the paper's Tables I to III have them.

    One-factor designs also show the SD over participants, which is what the paper's Table III prints.
    """
    multivariate = uses_multivariate(analysis)
    spread = len(analysis.anova.factors) == 1 and not analysis.anova.between.terms[1:]
    rows: list[tuple[str, ...]] = []
    for factor in analysis.anova.all_factors:
        rows += _factor_rows(analysis, factor, multivariate, spread)
    rows += _interaction_rows(analysis, multivariate)
    univariate = "univariate, df and p corrected by Greenhouse-Geisser"
    kind = "multivariate, df (q, N - q)" if multivariate else univariate
    notes = [
        f"N = {analysis.n_participants}. F: {kind}. SE: standard error over participants.",
        *_pair_notes(analysis),
    ]
    header = ("Factor", "Condition", "Mean (SE)", *(("SD",) if spread else ()), "F", "df", "p")
    return Table("paper", title_of(analysis, "Ratings by condition"), header, tuple(rows), 2, tuple(notes))


def uses_multivariate(analysis: Analysis) -> bool:
    """Whether the table's tests are multivariate: where planned, if every effect has an exact one."""
    return analysis.multivariate_first


def _factor_rows(analysis: Analysis, factor: str, multivariate: bool, spread: bool) -> list[tuple[str, ...]]:
    test = test_cells(analysis.anova.effect(factor), multivariate)
    rows: list[tuple[str, ...]] = []
    for mean in (m for m in analysis.means if m.effect == factor):
        first = not rows
        name = analysis.labels.factor(factor) if first else ""
        label = analysis.labels.level(factor, mean.levels[factor])
        sd = (fixed(mean.se * analysis.n_participants**0.5),) if spread else ()
        numbers = (f"{fixed(mean.mean)} ({fixed(mean.se)})", *sd)
        rows.append((name, label, *numbers, *(test if first else ("", "", ""))))
    return rows


def _interaction_rows(analysis: Analysis, multivariate: bool) -> list[tuple[str, ...]]:
    return [
        (analysis.labels.effect(effect.factors), "", "", *test_cells(effect, multivariate))
        for effect in analysis.anova.effects
        if len(effect.factors) > 1 or effect.factors[0] not in analysis.anova.all_factors
    ]


def _pair_notes(analysis: Analysis) -> list[str]:
    planned = analysis.experiment.analysis.pairs if analysis.experiment else ()
    notes = []
    for factor in planned:
        pairs = analysis.pairs_within(factor)
        others = [
            " and ".join(analysis.labels.level(factor, level) for level in (p.level_a, p.level_b))
            for p in pairs
            if not p.p_bonferroni < 0.05
        ]
        name = analysis.labels.factor(factor)
        if not others:
            notes.append(f"{name}: all {len(pairs)} pairs differ (Bonferroni, at .05).")
        elif len(others) == len(pairs):
            notes.append(f"{name}: no pair differs (Bonferroni, at .05).")
        else:
            notes.append(f"{name}: all pairs differ (Bonferroni, at .05) but {', '.join(others)}.")
    return notes
