"""Tables of `analysis ranks`."""

from analysis.ranks import RankAnalysis
from analysis.report.contents import caption
from analysis.report.formats import Table
from analysis.report.numbers import fixed, p_value, share, share_interval

EFFECTS = {"Friedman": "Kendall's W", "Kruskal-Wallis": "Epsilon squared, H / (N - 1)"}


def levels_table(result: RankAnalysis, name: str, synthetic: bool = False) -> Table:
    """Medians and mean ranks of the levels, and the test of all of them."""
    test = result.test
    shown = (fixed(test.chi2), f"{test.df}", p_value(test.p_value), share(test.effect))
    rows = tuple(
        (level, f"{n}", fixed(median), fixed(rank), *(shown if number == 0 else ("",) * 4))
        for number, (level, n, median, rank) in enumerate(
            zip(result.levels, result.n, result.medians, result.mean_ranks, strict=True)
        )
    )
    header = (result.factor, "n", "Median", "Mean rank", "χ²", "df", "p", "Effect")
    bounds = share_interval((test.effect_low, test.effect_high))
    notes = (f"{test.name} test, corrected for ties. Effect: {EFFECTS[test.name]}, 95% CI {bounds}.",)
    return Table("ranks", caption(f"{test.name} test", name, synthetic), header, rows, 1, notes)


def pairs_table(result: RankAnalysis, name: str, synthetic: bool = False) -> Table:
    """Every pair of levels."""
    is_between = result.design == "between"
    rows = tuple(
        (
            f"{pair.first} - {pair.second}",
            fixed(pair.statistic, 1),
            p_value(pair.p_value),
            p_value(pair.p_holm),
            share(pair.r),
            share_interval((pair.r_low, pair.r_high)),
            *((fixed(pair.dunn_z or 0.0), p_value(pair.dunn_p_holm or 0.0)) if is_between else ()),
        )
        for pair in result.pairs
    )
    letter, test = ("U", "Mann-Whitney") if is_between else ("V", "Wilcoxon signed-rank")
    header = ("Pair", letter, "p", "p (Holm)", "r", "95% CI", *(("Dunn z", "p (Holm)") if is_between else ()))
    approximate = sum(not pair.exact for pair in result.pairs)
    notes = [
        f"{test} tests. r: rank-biserial correlation, positive if the first level is higher; interval over "
        "resampled participants."
    ]
    if approximate:
        notes.append(
            f"{approximate} of {len(result.pairs)} p values use the normal approximation with continuity "
            "correction (ties, or no exact distribution)."
        )
    return Table("rank_pairs", caption("Pairs of levels", name, synthetic), header, rows, 1, tuple(notes))
