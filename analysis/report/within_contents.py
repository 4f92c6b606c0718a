"""The report of means and their tests: what `analysis anova` and a study of ratings say."""

from collections.abc import Callable

from analysis.plans.result import Analysis
from analysis.report.brief import brief
from analysis.report.contents import Contents, Part, Picture, Progress, Section
from analysis.report.formats import Table
from analysis.report.json_output import as_data
from analysis.report.left_out import left_out
from analysis.report.r_script import r_files
from analysis.report.sentences import sentences
from analysis.report.tables import all_tables

BETWEEN_METHODS = (
    " Groups (sum-to-zero contrasts) and covariates enter the multivariate linear model of the cell means; "
    "sums of squares are of type {kind}. Means weigh groups equally and are those of a participant with the "
    "mean of every covariate. Error df are participants less coefficients."
)

METHODS = (
    "Cell means are unweighted means of a participant's trials; participants with an empty cell are dropped "
    "and named. Effects are tested on orthonormal contrasts of the cell means. Multivariate: Hotelling's T², "
    "exact F on (q, N - q) df. Univariate: corrected by Greenhouse-Geisser and Huynh-Feldt. The F reported "
    "first is the multivariate one where every effect has an exact one and the plan does not name the "
    "univariate one; else it is the univariate one with Greenhouse-Geisser's df, for all effects. Marginal "
    "means and their errors come from participants' own marginal means. Pairs are t tests, paired within "
    "participants."
)

WITHIN_BARS = " Error bars of figures are 95% intervals within participants (Cousineau 2005, Morey 2008)."

MODEL_BARS = " Figures show the estimated marginal means of the table and their 95% intervals."


def contents_of(
    analysis: Analysis, more: Callable[[Progress], tuple[Section, ...]] = lambda _: ()
) -> Contents:
    """What the report of one analysis says; `more` makes further sections."""
    return Contents(
        name=analysis.name,
        title=analysis.title,
        lead=f"{analysis.n_participants} participants, {analysis.labels.effect(analysis.anova.factors)}",
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
    if analysis.robust is None:
        return tables
    # what only some ask for is imported when it is
    from analysis.report.robust_tables import robust_tables

    return (*tables, *robust_tables(analysis, analysis.robust))


def scripts_of(analysis: Analysis, key: str) -> dict[str, bytes]:
    """R scripts that compute the tables anew, and what they read."""
    files = r_files(analysis, key)
    if analysis.robust is None:
        return files
    from analysis.report.r_robust import robust_files

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
    from analysis.report.figures import bars_of, draw, figures_of
    from analysis.report.pictures import in_both_formats

    pictures = []
    for spec in figures_of(analysis):
        figure = draw(analysis, spec)
        shown = f"{spec.title}: mean ratings and every participant's mean. {bars_of(analysis)}"
        pictures.append(Picture(spec.key, spec.title, shown, *in_both_formats(figure)))
    return tuple(pictures)
