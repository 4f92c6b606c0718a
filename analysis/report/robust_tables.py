"""What the robust companions say, beside the ANOVA they accompany."""

from functools import partial

from analysis.plans.result import Analysis
from analysis.report.captions import caption
from analysis.report.contents import Section
from analysis.report.formats import Table
from analysis.report.numbers import DASH, fixed, interval, p_value
from analysis.report.r_robust import robust_files
from analysis.robust.companions import Companions
from analysis.robust.permutation import PermutationTest
from analysis.robust.ranks import RankTest
from analysis.robust.trimmed import TRIM, TrimmedPair

TEXT = (
    "The same effects by tests that assume less. Permutation: the univariate F among those of rearranged "
    "residuals (Freedman and Lane), whole participants kept together; within participants their signs are "
    "flipped. Ranks: the ANOVA of aligned ranks (Wobbrock and others), p corrected by Greenhouse-Geisser. "
    "Trimmed: pairs of levels by means without the outer fifth of participants on each side (Yuen), Holm's p "
    "within a margin. Where these disagree with the ANOVA, look at the figures for single participants."
)


def robust_section(analysis: Analysis, companions: Companions) -> Section:
    """The section of the report."""
    files = partial(robust_files, analysis, companions)
    return Section("Robust companions", TEXT, robust_tables(analysis, companions), (), files)


def robust_tables(analysis: Analysis, companions: Companions) -> tuple[Table, ...]:
    """The tests of effects, and the pairs by trimmed means where there are factors."""
    tables = (_effects(analysis, companions), _pairs(analysis, companions))
    return tuple(table for table in tables if table.rows)


def _effects(analysis: Analysis, companions: Companions) -> Table:
    ranks = {test.effect: test for test in companions.ranks}
    rows = tuple(
        (
            analysis.labels.effect(effect.factors),
            p_value(effect.univariate.p_gg),
            p_value(permuted.p_value),
            *_rank_cells(ranks.get(effect.effect)),
        )
        for effect, permuted in zip(analysis.anova.effects, companions.permutations, strict=True)
    )
    header = ("Effect", "p (ANOVA, GG)", "p (permutation)", "F (ranks)", "df", "p (ranks)")
    notes = [_rearranged(companions.permutations)]
    if companions.ranks_reason:
        notes.append(f"Ranks: {companions.ranks_reason}.")
    title = caption("Effects by permutation and by aligned ranks", analysis.name, analysis.synthetic)
    return Table("robust", title, header, rows, 1, tuple(notes))


def _rank_cells(test: RankTest | None) -> tuple[str, str, str]:
    if test is None:
        return DASH, DASH, DASH
    shrink = min(1.0, test.epsilon_gg)
    df = f"{fixed(shrink * test.df_effect)}, {fixed(shrink * test.df_error)}"
    if not shrink < 1:
        df = f"{test.df_effect}, {test.df_error}"
    return fixed(test.f_value), df, p_value(test.p_gg)


def _rearranged(tests: tuple[PermutationTest, ...]) -> str:
    kinds = {(test.flips, test.exact, test.n_rearranged) for test in tests if test.n_rearranged}
    said = [
        f"{'all' if exact else 'a random'} {number:,} {'flips of signs' if flips else 'orders of people'}"
        for flips, exact, number in sorted(kinds)
    ]
    return f"Permutation: {' and '.join(said)}." if said else "Nothing to rearrange: nothing varies."


def _pairs(analysis: Analysis, companions: Companions) -> Table:
    rows = tuple(_pair_cells(analysis, pair) for pair in companions.trimmed)
    header = ("Pair", "Difference", "SE", "t", "df", "95% CI", "p (Holm)")
    title = caption(f"Pairs by means trimmed by {TRIM:.0%}", analysis.name, analysis.synthetic)
    return Table("trimmed", title, header, rows, 1)


def _pair_cells(analysis: Analysis, pair: TrimmedPair) -> tuple[str, ...]:
    return (
        analysis.labels.pair({pair.effect: pair.level_a}, {pair.effect: pair.level_b}),
        fixed(pair.difference),
        fixed(pair.se, 3),
        fixed(pair.t),
        fixed(pair.df, 0 if float(pair.df).is_integer() else 1),
        interval(pair.ci),
        p_value(pair.p_holm),
    )
