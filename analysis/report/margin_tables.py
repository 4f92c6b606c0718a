"""Tables of the margins: means, pairs, simple effects, contrasts, equivalence, and ratings a cell."""

from analysis.plans.result import Analysis
from analysis.report.formats import Table
from analysis.report.numbers import fixed, interval, p_value, share
from analysis.report.table_cells import test_cells, title_of
from analysis.within.simple_effects import SIGNIFICANCE, first_test


def means_table(analysis: Analysis) -> Table:
    """Estimated marginal means of one and two factors, and the cells."""
    rows = tuple(
        (
            f"{analysis.labels.effect(tuple(m.levels))}: {analysis.labels.cell(m.levels)}",
            fixed(m.mean, 3),
            fixed(m.se, 3),
            interval(m.ci),
        )
        for m in analysis.means
    )
    header = ("Margin: levels", "Mean", "SE", "95% CI")
    title = title_of(analysis, "Marginal and cell means")
    return Table("means", title, header, rows, 1, folded=len(rows) > 12)


def pairs_table(analysis: Analysis) -> Table:
    """Paired comparisons of every margin of one factor (and of two where asked for)."""
    rows = tuple(
        (
            analysis.labels.pair(p.cell_a, p.cell_b),
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
        f"t tests on participants' marginal means, df = {analysis.anova.df_error}, paired within people. "
        "Bonf., Holm: p adjusted for the pairs of the margin. Interval: 95%, unadjusted. dz: mean difference "
        "over its SD.",
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
        "Each factor of a significant interaction at each level of the others, with the error of the whole "
        "model. Holm: adjusted for the levels it is tested at. ηₚ² belongs to the F beside it.",
    )
    header = ("Simple effect", "F", "df", "p", "Holm", "ηₚ²")
    title = title_of(analysis, "Simple effects")
    return Table("simple", title, header, tuple(rows), 1, notes, folded=len(rows) > 24)


def contrasts_table(analysis: Analysis) -> Table:
    """Polynomial trends of factors whose levels are numbers, and planned contrasts."""
    rows = tuple(
        (
            f"{analysis.labels.factor(c.factor)}: {c.name}",
            fixed(c.estimate),
            interval(c.ci),
            fixed(c.t),
            str(c.df),
            p_value(c.p),
        )
        for c in (*analysis.trends, *analysis.contrasts)
    )
    notes = (
        "Trends: orthonormal polynomials over the levels as they are spaced. Planned contrasts: weights as "
        "given. Interval: 95%, unadjusted.",
    )
    header = ("Contrast", "Estimate", "95% CI", "t", "df", "p")
    return Table("contrasts", title_of(analysis, "Trends and contrasts"), header, rows, 1, notes)


def equivalence_table(analysis: Analysis) -> Table:
    """Two one-sided tests of every pair against the declared bounds."""
    rows = tuple(
        (
            analysis.labels.pair(e.cell_a, e.cell_b),
            fixed(e.difference),
            interval(e.ci),
            p_value(e.p_lower),
            p_value(e.p_upper),
            "yes" if e.p < SIGNIFICANCE else "not shown",
        )
        for e in analysis.equivalence
    )
    bounds = interval(analysis.equivalence[0].bounds) if rows else ""
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
