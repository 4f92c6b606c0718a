"""Tables of `analysis ranks` and `analysis t-test`."""

from collections.abc import Callable, Sequence

from analysis.ranks import RankAnalysis
from analysis.report.contents import caption, mark_name
from analysis.report.formats import Table
from analysis.report.numbers import (
    DASH,
    apa_p,
    as_given,
    fixed,
    interval,
    mean_digits,
    p_value,
    share,
    share_interval,
)
from analysis.t_tests import MeansAnalysis
from analysis.within.simple_effects import SIGNIFICANCE

EFFECTS = {"Friedman": "Kendall's W", "Kruskal-Wallis": "Epsilon squared, H / (N - 1)"}


def levels_table(result: RankAnalysis, name: str, synthetic: bool = False) -> Table:
    """Medians and mean ranks of the levels, and the test of all of them."""
    test = result.test
    if test is None:
        raise ValueError("there is no test of all levels together")
    shown = (fixed(test.chi2), f"{test.df}", p_value(test.p_value), share(test.effect))
    rows = tuple(
        (level, f"{n}", fixed(median), fixed(rank), *(shown if number == 0 else ("",) * 4))
        for number, (level, n, median, rank) in enumerate(
            zip(result.levels, result.n, result.medians, result.mean_ranks, strict=True)
        )
    )
    header = (result.factor or "", "n", "Median", "Mean rank", "χ²", "df", "p", "Effect")
    bounds = share_interval((test.effect_low, test.effect_high))
    notes = (
        f"{test.name} test, corrected for ties. Effect: {EFFECTS[test.name]}, 95% CI {bounds}.",
        *_note_of_no_width([(test.effect_low, test.effect_high)]),
    )
    return Table("ranks", caption(f"{test.name} test", name, synthetic), header, rows, 1, notes)


def ranks_text(result: RankAnalysis, name: str, synthetic: bool = False) -> str:
    """The test of all levels in a sentence, else that of each pair or value that is significant."""
    if (test := result.test) is not None:
        verdict = "differed" if test.p_value < SIGNIFICANCE else "did not differ significantly"
        symbol = "W" if test.name == "Friedman" else "ε²"
        bounds = share_interval((test.effect_low, test.effect_high))
        return (
            f"{mark_name(name, synthetic)}: ratings {verdict} between levels of {result.factor}, "
            f"χ²({test.df}, N = {sum(result.n) if result.design == 'between' else result.n[0]}) = "
            f"{fixed(test.chi2)}, {apa_p(test.p_value)}, {symbol} = {share(test.effect)}, 95% CI {bounds}."
        )
    significant = [pair for pair in result.pairs if pair.p_holm < SIGNIFICANCE]
    named = "; ".join(f"{pair.first} and {pair.second}, {apa_p(pair.p_holm)} (Holm)" for pair in significant)
    start = mark_name(name, synthetic)
    return (
        f"{start}: significant differences: {named}."
        if significant
        else f"{start}: no significant difference."
    )


def pairs_table(result: RankAnalysis, name: str, synthetic: bool = False) -> Table:
    """Every pair of levels, or every level against the value."""
    is_between, bounds = result.design == "between", result.equivalence_bounds
    posthoc = {"between": ("Dunn", "dunn"), "within": ("Conover", "conover")}.get(result.design)
    rows = tuple(
        (
            f"{pair.first} - {pair.second}",
            fixed(pair.statistic, 1),
            p_value(pair.p_value),
            p_value(pair.p_holm),
            *_equivalence_cell(pair.p_equivalence),
            share(pair.r),
            share_interval((pair.r_low, pair.r_high)),
            *(
                (
                    _or_dash(fixed, pair.dunn_z if is_between else pair.conover_t),
                    _or_dash(p_value, pair.dunn_p_holm if is_between else pair.conover_p_holm),
                )
                if posthoc
                else ()
            ),
        )
        for pair in result.pairs
    )
    letter, test = ("U", "Mann-Whitney") if is_between else ("V", "Wilcoxon signed-rank")
    header = ("Pair", letter, "p", "p (Holm)", *_equivalence_head(bounds), "r", "95% CI")
    if posthoc:
        header = (*header, f"{posthoc[0]} {'z' if is_between else 't'}", "p (Holm)")
    approximate = sum(not pair.exact for pair in result.pairs)
    notes = [
        f"{test} tests. r: rank-biserial correlation, positive if the first level is higher; interval over "
        "resampled participants.",
        *_note_of_no_width([(pair.r_low, pair.r_high) for pair in result.pairs]),
        *_equivalence_note(bounds),
    ]
    if approximate:
        notes.append(
            f"{approximate} of {len(result.pairs)} p values use the normal approximation with continuity "
            "correction (ties, or no exact distribution)."
        )
    title = "Tests against a value" if result.design == "against" else "Pairs of levels"
    return Table("rank_pairs", caption(title, name, synthetic), header, rows, 1, tuple(notes))


def mean_tests_table(result: MeansAnalysis, name: str, synthetic: bool = False) -> Table:
    """t tests of means: pairs of groups, or each group against the value."""
    digits = mean_digits(test.se for test in result.tests)
    rows = tuple(
        (
            f"{test.first} - {test.second}",
            fixed(test.difference, digits),
            fixed(test.t),
            fixed(test.df, 0 if float(test.df).is_integer() else 2),
            p_value(test.p_holm if test.p_games_howell is None else test.p_games_howell),
            *_equivalence_cell(test.p_equivalence),
            fixed(test.d),
            interval(test.d_ci),
            bayes_text(test.bayes_factor),
        )
        for test in result.tests
    )
    corrected = "p (Holm)" if result.against is not None else "p (GH)"
    bounds = result.equivalence_bounds
    header = (
        "Test",
        "Difference",
        "t",
        "df",
        corrected,
        *_equivalence_head(bounds),
        "d",
        "95% CI",
        "BF10",
    )
    which = "One-sample t tests." if result.against is not None else "Welch's t tests; GH: Games and Howell."
    notes = (
        f"{which} d: Cohen's, over the {'SD' if result.against is not None else 'pooled SD'}, with its "
        "interval. BF10: JZS prior, r = 0.71.",
        *_equivalence_note(bounds),
    )
    return Table("t_tests", caption("Tests of means", name, synthetic), header, rows, 1, notes)


def means_text(result: MeansAnalysis, name: str, synthetic: bool = False) -> str:
    """Means of the groups and Welch's ANOVA, as a paper reports them."""
    digits = mean_digits(group.sd / group.n**0.5 for group in result.groups)
    means = "; ".join(
        f"{group.name}: M = {fixed(group.mean, digits)}, SD = {fixed(group.sd, digits)}, n = {group.n}, "
        f"95% CI {interval(group.ci, digits)}"
        for group in result.groups
    )
    said = f"{mark_name(name, synthetic)}: {means}."
    if result.against is not None:
        return said
    if result.welch is None:
        return f"{said} A group does not vary, so there is no Welch ANOVA."
    welch = result.welch
    test = f"F({welch.df_effect}, {fixed(welch.df_error)}) = {fixed(welch.f_value)}, {apa_p(welch.p_value)}"
    return f"{said} Welch's ANOVA of {result.factor}: {test}, ω² = {share(welch.omega_sq)}."


def bayes_text(value: float) -> str:
    """A Bayes factor with three digits; `>1000` above that."""
    return ">1000" if value > 1000 else f"{value:.3g}"


def _equivalence_cell(p: float | None) -> tuple[str, ...]:
    return () if p is None else (p_value(p),)


def _equivalence_head(bounds: tuple[float, float] | None) -> tuple[str, ...]:
    return () if bounds is None else ("p (TOST)",)


def _equivalence_note(bounds: tuple[float, float] | None) -> tuple[str, ...]:
    if bounds is None:
        return ()
    return (f"TOST: two one-sided tests; below .05 the difference is inside {as_given(bounds)}.",)


def _note_of_no_width(intervals: Sequence[tuple[float, float]]) -> tuple[str, ...]:
    # All participants agree, and so does every draw of them.
    if all(low < high for low, high in intervals):
        return ()
    return (
        "An interval without width does not show certainty: all participants of this sample agree, so "
        "resampling cannot vary. The population's effect may be smaller.",
    )


def _or_dash(form: Callable[[float], str], value: float | None) -> str:
    return DASH if value is None else form(value)
