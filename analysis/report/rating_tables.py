"""Models, opinion scores, agreement and robust companions as tables and words."""

from functools import partial

from analysis.agreement import Agreement, Reliability
from analysis.models.formula import SLOPES_NOTE
from analysis.models.ordinal import OrdinalResult
from analysis.models.random_part import MixedResult
from analysis.models.residuals import ResidualChecks
from analysis.opinion import OpinionResult
from analysis.plans.result import Analysis
from analysis.report.contents import Section, caption, mark_name
from analysis.report.formats import Table, as_sentence
from analysis.report.numbers import DASH, fixed, interval, p_value, share
from analysis.report.r_script import robust_files
from analysis.report.rank_tables import bayes_text
from analysis.robust import TRIM, Companions, PermutationTest, RankTest, TrimmedPair

# Mixed and ordinal models as tables.

DF_NAMES = {"satterthwaite": "Satterthwaite's", "kenward-roger": "Kenward and Roger's"}
PROFILE = "Intervals: profile likelihood (maximum likelihood)."


def mixed_effects_table(result: MixedResult, name: str, synthetic: bool) -> Table:
    """Type III tests with their denominator df."""
    rows = tuple(
        (e.effect, fixed(e.f_value), str(e.df_effect), fixed(e.df_error, 1), p_value(e.p_value))
        for e in result.effects
    )
    return Table(
        "mixed", caption("Linear mixed model", name, synthetic), ("Effect", "F", "df1", "df2", "p"), rows, 1
    )


def mixed_components_table(result: MixedResult, name: str, synthetic: bool) -> Table:
    """Standard deviations of the random terms."""
    title = caption("Random effects", name, synthetic)
    if result.components[-1].ci is None:
        rows = tuple((c.group, c.term or "residual", fixed(c.sd, 3)) for c in result.components)
        return Table("mixed-random", title, ("Group", "Term", "SD"), rows, 2)
    more = tuple((c.group, c.term or "residual", fixed(c.sd, 3), _interval(c.ci)) for c in result.components)
    return Table("mixed-random", title, ("Group", "Term", "SD", "95% CI"), more, 2, (PROFILE,))


def mixed_coefficients_table(result: MixedResult, name: str, synthetic: bool) -> Table:
    """Sum-coded coefficients with their profile intervals."""
    rows = tuple(
        (c.name, fixed(c.estimate, 3), fixed(c.se, 3), fixed(c.df, 1), p_value(c.p_value), _interval(c.ci))
        for c in result.coefficients
    )
    header = ("Coefficient", "b", "SE", "df", "p", "95% CI")
    return Table("mixed-coefficients", caption("Coefficients", name, synthetic), header, rows, 1, (PROFILE,))


def means_tables(result: MixedResult | OrdinalResult, name: str, synthetic: bool) -> tuple[Table, ...]:
    """What was added of marginal means, pairs, trends and likelihood-ratio tests."""
    tables = []
    letter = "t" if isinstance(result, MixedResult) else "z"
    if result.means is not None:
        means = tuple(
            (_levels(one.levels), fixed(one.estimate, 3), fixed(one.se, 3), _df(one.df), _interval(one.ci))
            for one in result.means.means
        )
        title = caption("Marginal means", name, synthetic)
        scale = "" if letter == "t" else " On the logit scale, from the mean of the thresholds."
        note = f"Equal weights of other factors' levels; covariates at their means.{scale}"
        tables.append(Table("means", title, ("Mean of", "M", "SE", "df", "95% CI"), means, 1, (note,)))
        trends = tuple(
            (
                f"{one.covariate} {_levels(one.levels)}".strip(),
                *(fixed(one.estimate, 3), fixed(one.se, 3), fixed(one.t), _df(one.df), p_value(one.p_value)),
                _interval(one.ci),
            )
            for one in result.means.trends
        )
        slope_header = ("Slope of", "b", "SE", letter, "df", "p", "95% CI")
        tables.append(
            Table("trends", caption("Trends of covariates", name, synthetic), slope_header, trends, 1)
        )
        # pairs of cells of two factors are many: they are in the JSON
        has_bounds = any(one.p_equivalence is not None for one in result.means.pairs)
        single = [one for one in result.means.pairs if ":" not in one.margin]
        pairs = tuple(
            (
                f"{'' if one in single else one.margin + ', '}{_levels(one.first)} - {_levels(one.second)}",
                *(fixed(one.difference, 3), fixed(one.se, 3), fixed(one.t), _df(one.df)),
                *(p_value(one.p_tukey), p_value(one.p_holm), p_value(one.p_bonferroni)),
                *(
                    []
                    if not has_bounds
                    else [DASH if one.p_equivalence is None else p_value(one.p_equivalence)]
                ),
            )
            for one in (*single, *result.means.trend_pairs)
        )
        header = ("Pair", "Difference", "SE", letter, "df", "p (Tukey)", "p (Holm)", "p (Bonf.)")
        header = (*header, *(("p (TOST)",) if has_bounds else ()))
        tables.append(Table("pairs", caption("Pairs of means and slopes", name, synthetic), header, pairs, 1))
    rows = tuple(
        (test.effect, fixed(test.chi2), str(test.df), p_value(test.p_value)) for test in result.ratio_tests
    )
    title = caption("Likelihood-ratio tests", name, synthetic)
    tables.append(Table("likelihood-ratio", title, ("Effect", "χ²", "df", "p"), rows, 1))
    return tuple(table for table in tables if table.rows)


def _levels(levels: dict[str, str]) -> str:
    return ", ".join(f"{factor}={level}" for factor, level in levels.items())


def _df(df: float) -> str:
    return fixed(df, 1) if df < float("inf") else "∞"


def _interval(ends: tuple[float, float] | None) -> str:
    return DASH if ends is None else f"[{fixed(ends[0], 3)}, {fixed(ends[1], 3)}]"


def ordinal_effects_table(result: OrdinalResult, name: str, synthetic: bool) -> Table:
    """Joint Wald tests of the effects on the logit scale."""
    rows = tuple((e.effect, fixed(e.chi2), str(e.df), p_value(e.p_value)) for e in result.effects)
    return Table(
        "ordinal", caption("Ordinal mixed model", name, synthetic), ("Effect", "χ²", "df", "p"), rows, 1
    )


def ordinal_coefficients_table(result: OrdinalResult, name: str, synthetic: bool) -> Table:
    """Sum-coded coefficients on the logit scale."""
    rows = tuple(
        (c.name, fixed(c.estimate, 3), fixed(c.se, 3), fixed(c.z), p_value(c.p_value))
        for c in result.coefficients
    )
    header = ("Coefficient", "b", "SE", "z", "p")
    return Table("ordinal-coefficients", caption("Ordinal coefficients", name, synthetic), header, rows, 1)


def ordinal_components_table(result: OrdinalResult, name: str, synthetic: bool) -> Table:
    """Standard deviations of the random terms on the logit scale."""
    rows = tuple((c.group, c.term, fixed(c.sd, 3)) for c in result.components)
    header = ("Group", "Term", "SD")
    return Table("ordinal-random", caption("Random effects (logit)", name, synthetic), header, rows, 2)


def mixed_text(result: MixedResult) -> str:
    """What was fitted, in words."""
    of_items = f"of {result.n_items} items " if result.n_items else ""
    said = [
        f"{result.formula}, fitted by REML (criterion {result.reml_criterion:.2f}) to {result.n_ratings} "
        f"ratings {of_items}by {result.n_participants} participants. Type III tests with "
        f"{DF_NAMES[result.df_method]} degrees of freedom.",
        *_slopes_note(result),
    ]
    return " ".join([*said, *map(as_sentence, result.notes)])


def _slopes_note(result: MixedResult | OrdinalResult) -> tuple[str, ...]:
    """What || means in the formula, where slopes of a factor have it."""
    slopes = {name for c in result.components if c.term != "intercept" for name in c.term.split(":")}
    of_factors = "||" in result.formula and not slopes.isdisjoint(result.factors)
    return (SLOPES_NOTE,) if of_factors else ()


def _integral(nodes: int) -> str:
    return "Laplace approximation" if nodes == 1 else f"adaptive Gauss-Hermite quadrature with {nodes} nodes"


def residuals_table(checks: ResidualChecks, name: str, synthetic: bool = False) -> Table:
    """Tests of residuals."""
    rows = tuple((test.name, fixed(test.statistic, 3), p_value(test.p_value)) for test in checks.tests)
    notes = (
        f"p: share of {checks.n_simulations} data sets simulated from the model, each with its own "
        "random effects, that depart as far from it.",
    )
    title = caption("Residual checks", name, synthetic)
    return Table("residuals", title, ("Check", "Statistic", "p"), rows, 1, notes)


def ordinal_text(result: OrdinalResult) -> str:
    """What was fitted, in words."""
    said = [
        f"{result.formula}, logit link, flexible thresholds, {_integral(result.quadrature)} (log-likelihood "
        f"{result.log_likelihood:.2f}, AIC {result.aic:.2f}). Wald tests.",
        *_slopes_note(result),
    ]
    if result.slopes == "none" and result.effects:
        said.append(
            "Random intercepts only: if people differ in the size of an effect, its p is too small. Add "
            "--slopes all to model these differences."
        )
    return " ".join([*said, *map(as_sentence, result.notes)])


# Opinion scores as tables and words.

SCORES: dict[str, tuple[str, ...]] = {
    "acr": (),
    "z": ("z: votes minus the person's mean (of the session), over the SD.",),
    "acr-hr": ("DMOS: a person's vote minus that on the hidden reference, plus the scale's highest point.",),
    "ccr": ("CMOS: above 0 if the item was preferred to the reference; reversed where it was shown first.",),
    "dscqs": ("DMOS: the vote on the reference minus that on the item; higher is worse.",),
}


def scores_table(result: OpinionResult, name: str, synthetic: bool = False) -> Table:
    """Items from the best down, within each group of items that people rated across."""
    rows = tuple(
        (
            item.name,
            *((str(item.group or DASH),) if result.n_groups > 1 else ()),
            fixed(item.mos),
            fixed(item.sd),
            str(item.n),
            interval((item.ci_low, item.ci_high)) if item.n > 1 else DASH,
            fixed(item.recovered),
            fixed(item.recovered_se),
        )
        for item in sorted(result.items, key=lambda one: (one.group or 0, -one.mos, one.name))
    )
    group = ("Group",) if result.n_groups > 1 else ()
    score = "z" if result.z_scores else {"acr": "MOS", "ccr": "CMOS"}.get(result.method, "DMOS")
    header = ("Item", *group, score, "SD", "n", "95% CI", "Recovered", "SE")
    notes = (
        *SCORES["z" if result.z_scores else result.method],
        "Recovered: biases removed and votes weighted by consistency (alternating projection).",
    )
    title = caption("Mean opinion scores", name, synthetic)
    return Table("opinion", title, header, rows, 1, notes)


def raters_table(result: OpinionResult, name: str, synthetic: bool = False) -> Table:
    """People from the most biased down."""
    rows = tuple(
        (
            person.name,
            str(person.n),
            DASH if person.bias is None else fixed(person.bias),
            DASH if person.inconsistency is None else fixed(person.inconsistency),
            DASH if person.correlation is None else share(person.correlation, 2),
            "rejected" if person.rejected_bt500 else "",
        )
        for person in sorted(result.participants, key=lambda one: (-abs(one.bias or 0.0), one.name))
    )
    header = ("Person", "Votes", "Bias", "Inconsistency", "r with MOS", "BT.500")
    title = caption("People", name, synthetic)
    return Table("opinion-people", title, header, rows, 1, (), True)


def opinion_text(result: OpinionResult, name: str, synthetic: bool = False) -> str:
    """What was computed, in words; nobody is left out by the screening."""
    rejected = [person.name for person in result.participants if person.rejected_bt500]
    said = [
        f"{mark_name(name, synthetic)}: {result.n_votes} votes on {len(result.items)} items "
        f"by {len(result.participants)} people; intervals from t with n - 1 degrees of freedom."
    ]
    if rejected and not any("BT.500" in decision for decision in result.decisions):
        said.append(f"BT.500 would reject {', '.join(rejected)}; add --screen bt500 to exclude them.")
    return " ".join([*said, *map(as_sentence, result.decisions)])


# Reliability and agreement as tables and words.


def reliability_text(result: Reliability, name: str, synthetic: bool = False) -> str:
    """Alpha and omega in a sentence, then what was decided."""
    alpha = f"{share(result.alpha, 3)}, 95% CI {_interval_between(result.alpha_low, result.alpha_high)}"
    omega = result.omega_reason if result.omega is None else f"McDonald's omega = {share(result.omega, 3)}"
    said = (
        f"{mark_name(name, synthetic)}: {len(result.items)} items, {result.n_cases} cases; Cronbach's "
        f"alpha = {alpha}; {omega}."
    )
    return " ".join([said, *map(as_sentence, result.decisions)])


def items_table(result: Reliability, name: str, synthetic: bool = False) -> Table:
    """The items in the order asked for."""
    rows = tuple(
        (
            item.name,
            fixed(item.mean),
            fixed(item.sd),
            share(item.item_rest_correlation, 2),
            DASH if item.loading is None else share(item.loading, 2),
            DASH if item.alpha_without is None else share(item.alpha_without, 3),
        )
        for item in result.items
    )
    header = ("Item", "Mean", "SD", "r with rest", "Loading", "alpha without")
    return Table("items", caption("Items of the scale", name, synthetic), header, rows, 1)


def agreement_text(result: Agreement, name: str, synthetic: bool = False) -> str:
    """Krippendorff's alpha in a sentence, then what was decided."""
    interval = _interval_between(result.ci_low, result.ci_high)
    alpha = f"{share(result.krippendorff_alpha, 3)}, 95% CI {interval}"
    said = (
        f"{mark_name(name, synthetic)}: {result.n_ratings} ratings of {result.n_items} items by "
        f"{result.n_people} people; Krippendorff's alpha ({result.level}) = {alpha} (items resampled)."
    )
    reason = [f"{result.icc_reason}."] if result.icc_reason else []
    return " ".join([said, *reason, *map(as_sentence, result.decisions)])


def intraclass_table(result: Agreement, name: str, synthetic: bool = False) -> Table:
    """The six forms, over the items that everybody rated."""
    rows = tuple(
        (
            one.form,
            share(one.icc, 3),
            _interval_between(one.ci_low, one.ci_high),
            f"{fixed(one.f_value)} ({one.df_effect:g}, {one.df_error:g})",
            one.meaning,
        )
        for one in result.icc
    )
    header = ("Form", "ICC", "95% CI", "F (df)", "Of what")
    notes = (f"Computed over the {result.n_complete_items} items that everybody rated.",)
    return Table("icc", caption("Intraclass correlations", name, synthetic), header, rows, 1, notes)


def _interval_between(low: float, high: float) -> str:
    return f"[{share(low, 3)}, {share(high, 3)}]"


# What the robust companions say in addition to the ANOVA.

TEXT = (
    "The same effects, tested with fewer assumptions. Permutation: the univariate F is compared with those "
    "of rearranged residuals (Freedman & Lane, 1983). Participants stay whole; within participants, signs "
    "are flipped. Ranks: ANOVA of aligned ranks (Wobbrock et al., 2011), p with the Greenhouse-Geisser "
    "correction. Trimmed: pairs of levels compared by means without the outer fifth of participants on each "
    "side (Yuen, 1974), Holm-corrected within a margin. If these disagree with the ANOVA, look at individual "
    "participants in the figures."
)


def robust_section(analysis: Analysis, companions: Companions) -> Section:
    """The section of the report."""
    files = partial(robust_files, analysis, companions)
    return Section("Robust companions", TEXT, robust_tables(analysis, companions), (), files)


def bayes_tables(analysis: Analysis) -> tuple[Table, ...]:
    """Bayes factors of the effects, and of the best models."""
    bayes = analysis.bayes
    if bayes is None:
        return ()
    rows = tuple(
        (analysis.labels.term(one.effect), fixed(one.log_bf_inclusion), bayes_text(one.bf_inclusion))
        for one in bayes.effects
    )
    notes = (
        "Models with the effect against the same models without it, none with its interactions. Above 1: for "
        f"the effect. Priors: Cauchy, r = {bayes.scale_fixed:g} (participants {bayes.scale_random:g}). "
        "Participants may differ in every effect but the highest interaction, which is the residual.",
    )
    title = caption("Bayes factors of effects", analysis.name, analysis.synthetic)
    return (Table("bayes-anova", title, ("Effect", "ln BF", "BF"), rows, 1, notes),)


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
        f"{'all ' if exact else ''}{number:,}{'' if exact else ' random'} "
        f"{'sign flips' if flips else 'orders of people'}"
        for flips, exact, number in sorted(kinds)
    ]
    return f"Permutation: {' and '.join(said)}." if said else "Not tested: nothing varies."


def _pairs(analysis: Analysis, companions: Companions) -> Table:
    rows = tuple(_pair_cells(analysis, pair) for pair in companions.trimmed)
    header = ("Pair", "Difference", "SE", "t", "df", "95% CI", "p (Holm)")
    title = caption(f"Pairs of means trimmed by {TRIM:.0%}", analysis.name, analysis.synthetic)
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
