"""The tables of an analysis: the paper's layout first, then everything the tests gave."""

from collections.abc import Sequence

from analysis.plans.result import Analysis
from analysis.report.formats import Table
from analysis.report.numbers import (
    DASH,
    f_text,
    fixed,
    interval,
    p_value,
    paper_p,
    share,
    share_interval,
    sum_text,
)
from analysis.within.effect_tests import Effect

TIMES = " × "


def all_tables(analysis: Analysis) -> tuple[Table, ...]:
    """Every table of the report, in its order."""
    tables = [paper_table(analysis), univariate_table(analysis), sphericity_table(analysis)]
    tables += [multivariate_table(analysis), effect_size_table(analysis), means_table(analysis)]
    tables += [pairs_table(analysis), counts_table(analysis)]
    return tuple(table for table in tables if table.rows)


def paper_table(analysis: Analysis) -> Table:
    """Conditions with mean (SE), and F and p of their factor, as the paper's Tables I to III have them.

    One-factor designs also show the SD over participants, which is what the paper's Table III prints.
    """
    multivariate = uses_multivariate(analysis)
    spread = len(analysis.anova.factors) == 1
    rows: list[tuple[str, ...]] = []
    for factor in analysis.anova.factors:
        rows += _factor_rows(analysis, factor, multivariate, spread)
    rows += _interaction_rows(analysis, multivariate)
    univariate = "univariate, df (q, q (N - 1)), p by Greenhouse-Geisser"
    kind = "multivariate, df (q, N - q)" if multivariate else univariate
    notes = [
        f"N = {analysis.n_participants}. F: {kind}. SE: standard error over participants.",
        *_pair_notes(analysis),
    ]
    header = ("Factor", "Condition", "Mean (SE)", *(("SD",) if spread else ()), "F", "df", "p")
    return Table("paper", _title(analysis, "Ratings by condition"), header, tuple(rows), 2, tuple(notes))


def uses_multivariate(analysis: Analysis) -> bool:
    """Whether the table's tests are the multivariate ones: where planned, and where every effect has one."""
    planned = analysis.experiment is None or analysis.experiment.analysis.statistic == "multivariate"
    return planned and all(e.multivariate is not None for e in analysis.anova.effects)


def _title(analysis: Analysis, what: str) -> str:
    mark = " [SYNTHETIC DATA]" if analysis.synthetic else ""
    return f"{what}, {analysis.name}{mark}"


def _test_cells(effect: Effect, multivariate: bool) -> tuple[str, str, str]:
    if multivariate and effect.multivariate is not None:
        m = effect.multivariate
        return fixed(m.f_value), f"{m.df_effect}, {m.df_error}", paper_p(m.p_value)
    u = effect.univariate
    return fixed(u.f_value), f"{u.df_effect}, {u.df_error}", paper_p(u.p_gg)


def _factor_rows(analysis: Analysis, factor: str, multivariate: bool, spread: bool) -> list[tuple[str, ...]]:
    test = _test_cells(analysis.anova.effect(factor), multivariate)
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
        (effect_label(analysis, effect.factors), "", "", *_test_cells(effect, multivariate))
        for effect in analysis.anova.effects
        if len(effect.factors) > 1
    ]


def effect_label(analysis: Analysis, factors: Sequence[str]) -> str:
    """An effect by its factors' labels."""
    return TIMES.join(analysis.labels.factor(name) for name in factors)


def _pair_notes(analysis: Analysis) -> list[str]:
    planned = analysis.experiment.analysis.pairs if analysis.experiment else ()
    notes = []
    for factor in planned:
        pairs = analysis.pairs_within(factor)
        clear = [f"{p.level_a}-{p.level_b}" for p in pairs if p.p_bonferroni < 0.05]
        others = [f"{p.level_a}-{p.level_b}" for p in pairs if not p.p_bonferroni < 0.05]
        name = analysis.labels.factor(factor)
        if not others:
            notes.append(f"{name}: all {len(pairs)} pairs differ (Bonferroni p < .05).")
        elif not clear:
            notes.append(f"{name}: no pair differs (Bonferroni p < .05).")
        else:
            notes.append(f"{name}: all pairs differ (Bonferroni p < .05) but {', '.join(others)}.")
    return notes


def univariate_table(analysis: Analysis) -> Table:
    """Univariate tests with uncorrected df."""
    rows = tuple(
        (
            e.effect,
            sum_text(e.univariate.ss),
            sum_text(e.univariate.ss_error),
            f"{e.univariate.df_effect}, {e.univariate.df_error}",
            f_text(e.univariate.f_value),
            p_value(e.univariate.p_value),
        )
        for e in analysis.anova.effects
    )
    header = ("Effect", "SS", "SS error", "df", "F", "p")
    notes = _reasons(analysis, "univariate_reason")
    return Table("univariate", _title(analysis, "Univariate tests"), header, rows, 1, notes)


def sphericity_table(analysis: Analysis) -> Table:
    """Mauchly's test, both epsilons, and p with corrected df; effects with one contrast are left out."""
    rows = tuple(
        (
            e.effect,
            share(e.mauchly.w) if e.mauchly else DASH,
            p_value(e.mauchly.p_value) if e.mauchly else DASH,
            share(e.univariate.epsilon_gg),
            p_value(e.univariate.p_gg),
            fixed(e.univariate.epsilon_hf, 3),
            p_value(e.univariate.p_hf),
        )
        for e in analysis.anova.effects
        if e.univariate.df_effect > 1
    )
    header = ("Effect", "W", "p(W)", "ε GG", "p GG", "ε HF", "p HF")
    notes = (
        "W: Mauchly's test, textbook form. GG: Greenhouse-Geisser, HF: Huynh-Feldt (printed uncapped, used "
        "as min(1, ε)). Effects with one contrast cannot violate sphericity and are left out.",
        *_reasons(analysis, "mauchly_reason", skip="one contrast"),
    )
    return Table("sphericity", _title(analysis, "Sphericity and corrections"), header, rows, 1, notes)


def multivariate_table(analysis: Analysis) -> Table:
    """The four multivariate statistics and their exact F."""
    rows = tuple(
        (
            e.effect,
            share(e.multivariate.pillai),
            share(e.multivariate.wilks),
            fixed(e.multivariate.hotelling_lawley, 3),
            fixed(e.multivariate.roy, 3),
            f_text(e.multivariate.f_value),
            f"{e.multivariate.df_effect}, {e.multivariate.df_error}",
            p_value(e.multivariate.p_value),
        )
        if e.multivariate
        else (e.effect, *[DASH] * 7)
        for e in analysis.anova.effects
    )
    header = ("Effect", "Pillai", "Wilks", "H-L", "Roy", "F", "df", "p")
    notes = (
        "H-L: Hotelling-Lawley trace. All four give this one exact F.",
        *_reasons(analysis, "multivariate_reason"),
    )
    return Table("multivariate", _title(analysis, "Multivariate tests"), header, rows, 1, notes)


def effect_size_table(analysis: Analysis) -> Table:
    """Partial and generalised eta squared."""
    rows = tuple(
        (
            e.effect,
            share(e.eta_sq_partial),
            share_interval(e.eta_sq_partial_ci),
            share(e.eta_sq_generalized),
        )
        for e in analysis.anova.effects
    )
    notes = ("Interval: 95%, noncentral F of the univariate test (Steiger 2004).",)
    header = ("Effect", "partial η²", "95% CI", "generalised η²")
    return Table("effects", _title(analysis, "Effect sizes"), header, rows, 1, notes)


def means_table(analysis: Analysis) -> Table:
    """Estimated marginal means of one and two factors, and the cells."""
    rows = tuple(
        (
            f"{m.effect}: {', '.join(m.levels.values())}",
            fixed(m.mean, 3),
            fixed(m.se, 3),
            interval(m.ci),
        )
        for m in analysis.means
    )
    header = ("Margin: levels", "Mean", "SE", "95% CI")
    title = _title(analysis, "Marginal and cell means")
    return Table("means", title, header, rows, 1, folded=len(rows) > 12)


def pairs_table(analysis: Analysis) -> Table:
    """Paired comparisons of every margin of one factor (and of two where asked for)."""
    rows = tuple(
        (
            f"{p.effect}: {p.level_a} - {p.level_b}",
            fixed(p.difference),
            interval(p.ci),
            fixed(p.t),
            p_value(p.p),
            p_value(p.p_bonferroni),
            p_value(p.p_holm),
            fixed(p.dz),
        )
        for p in analysis.pairs
    )
    notes = (
        f"Paired t tests on participants' marginal means, df = {analysis.n_participants - 1}. Bonf., Holm: p "
        "adjusted for the pairs of the margin. Interval: 95%, unadjusted. dz: mean difference over its SD.",
    )
    header = ("Margin: pair", "Diff.", "95% CI", "t", "p", "Bonf.", "Holm", "dz")
    return Table("pairs", _title(analysis, "Pairs"), header, rows, 1, notes, folded=len(rows) > 24)


def counts_table(analysis: Analysis) -> Table:
    """Ratings behind the cell means where they differ between participants or cells; empty otherwise."""
    counts = analysis.cells.counts
    if counts.min() == counts.max():
        return Table("counts", "", (), ())
    flat = counts.reshape(len(counts), -1)
    rows = tuple(
        (
            ", ".join(cell.values()),
            str(flat[:, i].min()),
            fixed(float(flat[:, i].mean()), 1),
            str(flat[:, i].max()),
        )
        for i, cell in enumerate(analysis.cells.cells)
    )
    header = ("Cell", "Fewest", "Mean", "Most")
    return Table("counts", _title(analysis, "Ratings per participant and cell"), header, rows, 1, folded=True)


def _reasons(analysis: Analysis, which: str, skip: str = "\0") -> tuple[str, ...]:
    """Why tests do not exist, one note a reason."""
    effects: dict[str, list[str]] = {}
    for effect in analysis.anova.effects:
        reason = getattr(effect, which)
        if reason is not None and not reason.startswith(skip):
            effects.setdefault(reason, []).append(effect.effect)
    return tuple(f"Not defined for {', '.join(names)}: {reason}." for reason, names in effects.items())
