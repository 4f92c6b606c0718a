"""The tables of an analysis of means: the paper's layout, effects, margins and simple effects."""

from analysis.plans.result import Analysis
from analysis.report.contents import caption
from analysis.report.formats import Table
from analysis.report.numbers import (
    DASH,
    apa_p,
    as_given,
    f_text,
    fixed,
    interval,
    mean_digits,
    p_value,
    share,
    share_interval,
    sum_digits,
)
from analysis.within.anova import Effect, UnivariateTest
from analysis.within.homogeneity import box_test, levene_tests
from analysis.within.simple_effects import SIGNIFICANCE, first_test

# What the tables of an analysis share: titles, and the cells of a test.


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


# Tables of the effects: their tests, what these assume, and their sizes.


def univariate_table(analysis: Analysis) -> Table:
    """Univariate tests with uncorrected df."""
    sums = [(e.univariate.ss, e.univariate.ss_error) for e in analysis.anova.effects]
    digits = sum_digits(one for pair in sums for one in pair)
    rows = tuple(
        (
            analysis.labels.effect(e.factors),
            fixed(e.univariate.ss, digits),
            fixed(e.univariate.ss_error, digits),
            f"{e.univariate.df_effect}, {e.univariate.df_error}",
            f_text(e.univariate.f_value),
            p_value(e.univariate.p_value),
        )
        for e in analysis.anova.effects
    )
    header = ("Effect", "SS", "SS error", "df", "F", "p")
    notes = _reasons(analysis, "univariate_reason")
    return Table("univariate", title_of(analysis, "Univariate tests"), header, rows, 1, notes)


def has_sphericity(effect: Effect) -> bool:
    """Whether an effect has several contrasts within participants, so that sphericity may fail."""
    return effect.mauchly is not None or effect.univariate.epsilon_gg < 1


def sphericity_table(analysis: Analysis) -> Table:
    """Mauchly's test, both epsilons, and p with corrected df; effects with one contrast are left out."""
    rows = tuple(
        (
            analysis.labels.effect(e.factors),
            share(e.mauchly.w) if e.mauchly else DASH,
            p_value(e.mauchly.p_value) if e.mauchly else DASH,
            share(e.univariate.epsilon_gg),
            f"{fixed(e.univariate.df_effect_gg, 1)}, {fixed(e.univariate.df_error_gg, 1)}",
            p_value(e.univariate.p_gg),
            fixed(e.univariate.epsilon_hf, 3),
            f"{fixed(e.univariate.df_effect_hf, 1)}, {fixed(e.univariate.df_error_hf, 1)}",
            p_value(e.univariate.p_hf),
        )
        for e in analysis.anova.effects
        if has_sphericity(e)
    )
    header = ("Effect", "W", "p(W)", "ε GG", "df GG", "p GG", "ε HF", "df HF", "p HF")
    notes = (
        "W: Mauchly's test, textbook form. GG: Greenhouse-Geisser, HF: Huynh-Feldt (printed uncapped, used "
        "as min(1, ε)). Effects with one contrast cannot violate sphericity and are not shown.",
        *_reasons(analysis, "mauchly_reason", skip="one contrast"),
    )
    return Table("sphericity", title_of(analysis, "Sphericity and corrections"), header, rows, 1, notes)


def levene_table(analysis: Analysis) -> Table:
    """Levene's test of participants' means and of every cell; empty without groups."""
    tests = levene_tests(analysis.anova)
    rows = tuple(
        (t.where, f_text(t.f_value), f"{t.df_effect}, {t.df_error}", p_value(t.p_value)) for t in tests
    )
    notes: tuple[str, ...] = ("Distances from the group median (Brown-Forsythe). means: over all cells.",)
    box = box_test(analysis.anova)
    if box is not None and box.chi2 is not None and box.p_value is not None:
        said = f"χ²({box.df}) = {fixed(box.chi2)}, {apa_p(box.p_value)}"
        notes = (*notes, f"Box's M test of the cells' covariance matrices: {said}.")
    elif box is not None:
        notes = (*notes, f"Box's M was not computed: {box.reason}.")
    title = title_of(analysis, "Levene's test of equal spread")
    return Table("levene", title, ("Scores", "F", "df", "p"), rows, 1, notes, folded=len(rows) > 12)


def multivariate_table(analysis: Analysis) -> Table:
    """The four multivariate statistics and their F."""
    rows = tuple(
        (
            analysis.labels.effect(e.factors),
            share(e.multivariate.pillai),
            share(e.multivariate.wilks),
            fixed(e.multivariate.hotelling_lawley, 3),
            fixed(e.multivariate.roy, 3),
            f_text(e.multivariate.f_value),
            f"{e.multivariate.df_effect}, {e.multivariate.df_error}",
            p_value(e.multivariate.p_value),
        )
        if e.multivariate
        else (analysis.labels.effect(e.factors), *[DASH] * 7)
        for e in analysis.anova.effects
    )
    header = ("Effect", "Pillai", "Wilks", "H-L", "Roy", "F", "df", "p")
    notes = (
        "H-L: Hotelling-Lawley trace. "
        + (
            "All four give the same exact F."
            if all(e.multivariate.exact for e in analysis.anova.effects if e.multivariate)
            else "F is Pillai's; it is approximate for effects with several dimensions."
        ),
        *_reasons(analysis, "multivariate_reason"),
    )
    return Table("multivariate", title_of(analysis, "Multivariate tests"), header, rows, 1, notes)


def effect_size_table(analysis: Analysis) -> Table:
    """Sizes of the univariate effects and, next to them, of the multivariate ones."""
    rows = tuple(
        (
            analysis.labels.effect(e.factors),
            share(e.eta_sq_partial),
            share_interval(e.eta_sq_partial_ci),
            share(e.eta_sq_generalized),
            share(e.omega_sq_partial),
            share(e.multivariate.eta_sq_partial) if e.multivariate else DASH,
            share_interval(e.multivariate.eta_sq_partial_ci) if e.multivariate else DASH,
        )
        for e in analysis.anova.effects
    )
    notes = (
        "ηₚ² and ωₚ² (partial) and generalized (gen.) η² are of the univariate test; the interval uses the "
        "Greenhouse-Geisser df. mv: ηₚ² of the multivariate test. Intervals: 95%, noncentral F with the "
        "method of Steiger (2004).",
    )
    header = ("Effect", "ηₚ²", "95% CI", "gen. η²", "ωₚ²", "mv ηₚ²", "95% CI")
    return Table("effects", title_of(analysis, "Effect sizes"), header, rows, 1, notes)


def _reasons(analysis: Analysis, which: str, skip: str = "\0") -> tuple[str, ...]:
    """Why tests do not exist, one note per reason."""
    effects: dict[str, list[str]] = {}
    for effect in analysis.anova.effects:
        reason = getattr(effect, which)
        if reason is not None and not reason.startswith(skip):
            effects.setdefault(reason, []).append(analysis.labels.effect(effect.factors))
    return tuple(f"Not defined for {', '.join(names)}: {reason}." for reason, names in effects.items())


# Tables of the margins: means, pairs, simple effects, contrasts, equivalence, and ratings per cell.


def means_table(analysis: Analysis) -> Table:
    """Estimated marginal means of one and two factors, and the cells."""
    digits = mean_digits(m.se for m in analysis.means)
    rows = tuple(
        (
            f"{analysis.labels.effect(tuple(m.levels))}: {analysis.labels.cell(m.levels)}",
            fixed(m.mean, max(digits, 3)),
            fixed(m.se, max(digits, 3)),
            interval(m.ci, digits),
        )
        for m in analysis.means
    )
    header = ("Margin: levels", "Mean", "SE", "95% CI")
    title = title_of(analysis, "Marginal and cell means")
    return Table("means", title, header, rows, 1, folded=len(rows) > 12)


def pairs_table(analysis: Analysis) -> Table:
    """Paired comparisons of every margin of one factor (and of two where asked for)."""
    digits = mean_digits(p.se for p in analysis.pairs)
    rows = tuple(
        (
            analysis.labels.pair(p.cell_a, p.cell_b),
            fixed(p.difference, digits),
            interval(p.ci, digits),
            fixed(p.t),
            p_value(p.p),
            p_value(p.p_bonferroni),
            p_value(p.p_holm),
            fixed(p.dz),
        )
        for p in analysis.pairs
    )
    notes = (
        f"t tests on participants' marginal means, df = {analysis.anova.df_error}, paired within people. "
        "Bonf., Holm: p adjusted for the number of pairs. Interval: 95%, unadjusted. dz: mean difference "
        "divided by its SD.",
    )
    header = ("Margin: pair", "Diff.", "95% CI", "t", "p", "Bonf.", "Holm", "dz")
    return Table("pairs", title_of(analysis, "Pairs"), header, rows, 1, notes, folded=len(rows) > 24)


def simple_effects_table(analysis: Analysis) -> Table:
    """Simple effects of significant interactions."""
    rows = []
    for simple in analysis.simple_effects:
        m = first_test(simple.test, analysis.multivariate_first)
        f, df, p = test_cells(simple.test, analysis.multivariate_first)
        size = simple.test.eta_sq_partial if m is None else m.eta_sq_partial
        label = f"{analysis.labels.factor(simple.of)} at {analysis.labels.cell(simple.at)}"
        rows.append((label, f, df, p, p_value(simple.p_holm), share(size)))
    notes = (
        "Each factor of a significant interaction at each level of the others. Each simple effect is tested "
        "with its own error term. Holm: adjusted for the number of levels tested. ηₚ² belongs to the F "
        "in the same row.",
    )
    header = ("Simple effect", "F", "df", "p", "Holm", "ηₚ²")
    title = title_of(analysis, "Simple effects")
    return Table("simple", title, header, tuple(rows), 1, notes, folded=len(rows) > 24)


def contrasts_table(analysis: Analysis) -> Table:
    """Polynomial trends of factors whose levels are numbers, and planned contrasts."""
    contrasts = (*analysis.trends, *analysis.contrasts)
    digits = mean_digits(c.se for c in contrasts)
    rows = tuple(
        (
            f"{analysis.labels.factor(c.factor)}: {c.name}",
            fixed(c.estimate, digits),
            interval(c.ci, digits),
            fixed(c.t),
            str(c.df),
            p_value(c.p),
        )
        for c in contrasts
    )
    notes = (
        "Trends: orthonormal polynomials with the spacing of the levels. Planned contrasts: weights as "
        "declared. Interval: 95%, unadjusted.",
    )
    header = ("Contrast", "Estimate", "95% CI", "t", "df", "p")
    return Table("contrasts", title_of(analysis, "Trends and contrasts"), header, rows, 1, notes)


def equivalence_table(analysis: Analysis) -> Table:
    """Two one-sided tests of every pair against the declared bounds."""
    digits = mean_digits(pair.se for pair in analysis.pairs)
    rows = tuple(
        (
            analysis.labels.pair(e.cell_a, e.cell_b),
            fixed(e.difference, digits),
            interval(e.ci, digits),
            p_value(e.p_lower),
            p_value(e.p_upper),
            "yes" if e.p < SIGNIFICANCE else "not shown",
        )
        for e in analysis.equivalence
    )
    bounds = as_given(analysis.equivalence[0].bounds) if rows else ""
    notes = (f"Two one-sided t tests (TOST) within {bounds}, α = .05; interval 90%.",)
    header = ("Margin: pair", "Diff.", "90% CI", "p lower", "p upper", "equal")
    return Table("equivalence", title_of(analysis, "Equivalence"), header, rows, 1, notes)


def counts_table(analysis: Analysis) -> Table:
    """Ratings behind the cell means where they differ between participants or cells; empty otherwise."""
    counts = analysis.cells.counts
    if counts.min() == counts.max():
        return Table("counts", "", (), ())
    flat = counts.reshape(len(counts), -1)
    rows = tuple(
        (
            analysis.labels.cell(cell),
            str(flat[:, i].min()),
            fixed(float(flat[:, i].mean()), 1),
            str(flat[:, i].max()),
        )
        for i, cell in enumerate(analysis.cells.cells)
    )
    header = ("Cell", "Fewest", "Mean", "Most")
    return Table(
        "counts", title_of(analysis, "Ratings per participant and cell"), header, rows, 1, folded=True
    )


# The tables of an analysis: the paper's layout first, then everything the tests gave.


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
    univariate = "univariate, df and p with the Greenhouse-Geisser correction"
    kind = "multivariate, df (q, N − q)" if multivariate else univariate
    notes = [
        f"N = {analysis.n_participants}. F: {kind}. SE: standard error across participants.",
        *_pair_notes(analysis),
    ]
    header = ("Factor", "Condition", "Mean (SE)", *(("SD",) if spread else ()), "F", "df", "p")
    title = title_of(analysis, "Mean ratings by condition, with tests of each factor")
    return Table("paper", title, header, tuple(rows), 2, tuple(notes))


def uses_multivariate(analysis: Analysis) -> bool:
    """Whether the table's tests are multivariate: where planned, if every effect has an exact one."""
    return analysis.multivariate_first


def _factor_rows(analysis: Analysis, factor: str, multivariate: bool, spread: bool) -> list[tuple[str, ...]]:
    test = test_cells(analysis.anova.effect(factor), multivariate)
    rows: list[tuple[str, ...]] = []
    means = [m for m in analysis.means if m.effect == factor]
    digits = mean_digits(m.se for m in means)
    for mean in means:
        first = not rows
        name = analysis.labels.factor(factor) if first else ""
        label = analysis.labels.level(factor, mean.levels[factor])
        sd = (fixed(mean.se * analysis.n_participants**0.5, digits),) if spread else ()
        numbers = (f"{fixed(mean.mean, digits)} ({fixed(mean.se, digits)})", *sd)
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
            notes.append(f"{name}: all {len(pairs)} pairs differed (Bonferroni, α = .05).")
        elif len(others) == len(pairs):
            notes.append(f"{name}: no pair differed (Bonferroni, α = .05).")
        else:
            notes.append(f"{name}: all pairs differed (Bonferroni, α = .05) except {', '.join(others)}.")
    return notes
