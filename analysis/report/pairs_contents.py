"""The report of a study of paired comparisons: tables, sentences and figures."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from typing import Any

from analysis.pairs.abilities import FactorTest, ItemFactors, PairsResult
from analysis.pairs.comparisons import Comparisons, separated_items
from analysis.pairs.findings import Findings, plain_reason
from analysis.plans.plan import PlanRows
from analysis.plans.result import Labels, labels_of
from analysis.report.choice_tables import abilities_table, contrasts_table, factors_table
from analysis.report.contents import Contents, Part, Picture, caption
from analysis.report.formats import Table
from analysis.report.json_output import exclusions_data, left_out, study_data
from analysis.report.numbers import apa_p, fixed, p_value, share, with_minus
from analysis.report.r_models import pairs_files
from experiments.declaration.experiment import Experiment
from table_files import counted

# Sentences about paired comparisons in APA style.

SIGNIFICANCE = 0.05
LACK_OF_FIT = "lack of fit"
NO_MAXIMUM = "could not be fitted by maximum likelihood"


def sentences(findings: Findings, items: Sequence[str]) -> tuple[str, ...]:
    """Whether items differ and in which order, what each factor does, and how well the model holds."""
    result = findings.abilities
    if result is None:
        reason = findings.abilities_reason or ""
        if NO_MAXIMUM in reason:
            return (f"{reason}.",)
        return (f"The abilities of the {len(items)} cells were not fitted: {reason}.",)
    said = [_equality(findings, result), _ranking(result)]
    if findings.factors is not None:
        said += [_factor(test) for test in findings.factors.factors if test.df > 0]
    elif findings.factors_reason:
        reason = findings.factors_reason
        said.append(f"{'' if NO_MAXIMUM in reason else 'Effects of factors were not fitted: '}{reason}.")
    return (*said, *_checks(findings, result))


def _equality(findings: Findings, result: PairsResult) -> str:
    if findings.equal is None:
        return (
            "At least one cell won or lost every comparison, so its ability is finite only because of "
            "Firth's penalty. Equal abilities were not tested."
        )
    test = findings.equal
    verdict = "differed" if test.p < SIGNIFICANCE else "did not differ significantly"
    return (
        f"The {len(result.items)} cells {verdict} in how often they were chosen, χ²({test.df}) = "
        f"{fixed(test.chi2)}, {apa_p(test.p)}."
    )


def _ranking(result: PairsResult) -> str:
    ranked = sorted(result.items, key=lambda item: (item.rank, item.name))
    named = [f"{item.name} ({fixed(item.centred)}, SE = {fixed(item.se_centred)})" for item in ranked]
    return (
        f"Abilities relative to their mean ({result.scale}), from most to least chosen: {'; '.join(named)}."
    )


def _factor(test: FactorTest) -> str:
    statistic = f"χ²({test.df}) = {fixed(test.chi2)}, {apa_p(test.p)}"
    if test.factor == LACK_OF_FIT:
        fits = "do not fully account for the abilities" if test.p < SIGNIFICANCE else "suffice"
        return (
            f"The main effects of the factors {fits} (free abilities compared with their sum), {statistic}."
        )
    verdict = "was significant" if test.p < SIGNIFICANCE else "was not significant"
    levels = [
        f"{level} {fixed(estimate)} (SE = {fixed(se)})"
        for level, estimate, se in zip(test.levels, test.estimates, test.standard_errors, strict=True)
    ]
    return (
        f"The effect of {test.factor} {verdict}, {statistic}. Relative to {test.reference}: "
        f"{', '.join(levels)}."
    )


def _checks(findings: Findings, result: PairsResult) -> list[str]:
    said, fit = [], result.goodness
    if fit.df > 0 and math.isfinite(fit.p) and not result.firth:
        holds = "departed from" if fit.p < SIGNIFICANCE else "did not depart significantly from"
        said.append(
            f"The proportion of choices in the pairs {holds} the model, χ²({fit.df}) = "
            f"{fixed(fit.deviance)}, {apa_p(fit.p)}."
        )
    if findings.order is not None:
        side = findings.order
        had = "had" if side.p < SIGNIFICANCE else "had no significant"
        said.append(
            f"The left (first) clip {had} {'an ' if side.p < SIGNIFICANCE else ''}advantage, "
            f"b = {fixed(side.estimate)}, SE = {fixed(side.se)}, z = {fixed(side.z)}, {apa_p(side.p)}."
        )
    triples = result.transitivity
    if triples.triples:
        said.append(f"{triples.weak_violations} of {triples.triples} triples violated weak transitivity.")
    return said


METHODS = {
    "bradley-terry": (
        "Abilities of the cells by the Bradley-Terry model: the log odds of choosing one of two clips are "
        "the difference of their abilities. "
    ),
    "davidson": (
        "Abilities of the cells by Davidson's (1970) model, which has ties as a third outcome: the closer "
        "two abilities are, the more likely is a tie. "
    ),
}
COUNTS = "Choices are counted in each pair, sides taken together."
ESTIMATED = {False: "Maximum likelihood. ", True: "Maximum likelihood with Firth's penalty. "}
ROBUST = "Robust SE treat each rater's comparisons as one cluster (Liang & Zeger, 1986). "
FACTORS = (
    "Each factor is tested by the likelihood ratio with and without it, keeping all other factors; levels "
    "are compared with the first declared one. "
)
LACK = "The lack-of-fit test compares free abilities with the sum of the factors' effects. "
CONTRASTS = "Differences between items are Holm-corrected. "
SIDE = "The advantage of the left (first) side is a separate parameter, fitted together with free abilities. "
TRIPLES = "Transitivity is counted over triples of items; a tie counts as half a choice for each. "


def methods_of(findings: Findings) -> str:
    """How the numbers came about, of what was computed."""
    result = findings.abilities
    if result is None:
        return COUNTS
    tests = () if findings.factors is None else findings.factors.factors
    said = METHODS[result.method] + ESTIMATED[result.firth]
    said += ROBUST if any(item.se_robust is not None for item in result.items) else ""
    said += FACTORS if any(test.factor != LACK_OF_FIT for test in tests) else ""
    said += LACK if any(test.factor == LACK_OF_FIT and test.df > 0 for test in tests) else ""
    said += CONTRASTS if result.contrasts else ""
    said += SIDE if findings.order is not None else ""
    return (said + (TRIPLES if result.transitivity.triples else "")).strip()


def _reason(reason: str | None, comparisons: Comparisons, items: Mapping[str, str]) -> str | None:
    """Why a model was not fitted, in labels and without the options of a command."""
    if reason is None:
        return None
    named = replace(comparisons, items=tuple(items[item] for item in comparisons.items))
    separated = separated_items(named)
    # Only these reasons name the option, so the cause is the separation.
    if separated is not None and "--firth" in reason:
        model = "Davidson" if comparisons.ties else "Bradley-Terry"
        return f"The {model} model {NO_MAXIMUM}, because {separated}"
    return plain_reason(reason, comparisons.source)


def item_labels(experiment: Experiment, items: tuple[str, ...]) -> dict[str, str]:
    """Labels of cells: those of their levels, in the factors in which the cells differ."""
    names = {item: item.split("/") for item in items}
    labels = labels_of(experiment)
    varied = [
        index
        for index in range(len(experiment.factors))
        if len({levels[index] for levels in names.values()}) > 1
    ]
    return {
        item: ", ".join(labels.level(experiment.factors[i].name, levels[i]) for i in varied) or item
        for item, levels in names.items()
    }


def contents_of(
    prepared: PlanRows, comparisons: Comparisons, findings: Findings, factors: ItemFactors | None = None
) -> Contents:
    """What the report says."""
    experiment, items = prepared.experiment, item_labels(prepared.experiment, comparisons.items)
    shown = labelled_findings(findings, items, labels_of(experiment))
    shown = replace(
        shown,
        abilities_reason=_reason(findings.abilities_reason, comparisons, items),
        factors_reason=_reason(findings.factors_reason, comparisons, items),
    )
    name, synthetic = experiment.name, prepared.synthetic
    people, number = len(comparisons.participants), comparisons.outcome.size
    said = sentences(shown, [items[item] for item in comparisons.items])
    return Contents(
        name=name,
        title=experiment.title,
        lead=f"{counted(people, 'participant')}, {counted(number, 'comparison')} of {len(items)} cells",
        source=prepared.source,
        synthetic=synthetic,
        n_participants=people,
        left_out=left_out(prepared.exclusions),
        decisions=comparisons.decisions,
        parts=(
            Part(
                tables(shown, name, synthetic),
                said,
                draw=lambda: draw_all(shown, synthetic, people),
                beside=lambda key: pairs_files(experiment.title, comparisons, findings, factors, key),
                brief=said[:2],
            ),
        ),
        methods=methods_of(findings),
        numbers=numbers(prepared, comparisons, findings),
        given="comparisons",
    )


def labelled_findings(findings: Findings, items: Mapping[str, str], labels: Labels) -> Findings:
    """The findings with labels in the place of names."""

    def of(result: PairsResult | None) -> PairsResult | None:
        if result is None:
            return None
        return replace(
            result,
            reference=items[result.reference],
            items=tuple(replace(item, name=items[item.name]) for item in result.items),
            contrasts=tuple(
                replace(c, first=items[c.first], second=items[c.second]) for c in result.contrasts
            ),
            factors=tuple(_labelled_test(test, labels) for test in result.factors),
        )

    pairs = tuple(
        replace(pair, first=items[pair.first], second=items[pair.second]) for pair in findings.pairs
    )
    return replace(findings, abilities=of(findings.abilities), factors=of(findings.factors), pairs=pairs)


def _labelled_test(test: FactorTest, labels: Labels) -> FactorTest:
    if not test.levels:
        return test
    return replace(
        test,
        factor=labels.factor(test.factor),
        reference=labels.level(test.factor, test.reference),
        levels=tuple(labels.level(test.factor, level) for level in test.levels),
    )


def tables(findings: Findings, name: str, synthetic: bool) -> tuple[Table, ...]:
    """Abilities first, then factors, every pair, checks, differences; of what could be fitted."""
    every = pairs_table(findings, name, synthetic)
    if findings.abilities is None:
        return (every,)
    made = [abilities_table(findings.abilities, name, synthetic)]
    if findings.factors is not None:
        made.append(factors_table(findings.factors, name, synthetic))
    made += [every, checks_table(findings, findings.abilities, name, synthetic)]
    return (*made, contrasts_table(findings.abilities, name, synthetic))


def pairs_table(findings: Findings, name: str, synthetic: bool) -> Table:
    """How often each pair was compared, and what was chosen."""
    rows = tuple(
        (f"{p.first} - {p.second}", str(p.n), str(p.first_chosen), str(p.second_chosen), str(p.ties))
        for p in findings.pairs
    )
    header = ("Pair: first − second", "Answers", "First", "Second", "Tied")
    title = caption("Choices in each pair", name, synthetic)
    return Table("pair-choices", title, header, rows, 1, (), folded=len(rows) > 24)


def checks_table(findings: Findings, result: PairsResult, name: str, synthetic: bool) -> Table:
    """How well the model holds: fit of the pairs, side, ties, transitivity."""
    rows: list[tuple[str, str, str]] = []
    fit, triples = result.goodness, result.transitivity
    if fit.df > 0:
        rows.append(("Fit of the pairs", f"χ²({fit.df}) = {fixed(fit.deviance)}", p_value(fit.p)))
    if findings.order is not None:
        side = findings.order
        rows.append(
            (
                "Advantage of the left (first) side",
                with_minus(f"{fixed(side.estimate, 3)} (SE = {fixed(side.se, 3)})"),
                p_value(side.p),
            )
        )
    if result.tie_probability_max is not None:
        rows.append(("Probability of a tie between equals", share(result.tie_probability_max), ""))
    for kind in ("weak", "moderate", "strong"):
        broken = getattr(triples, f"{kind}_violations")
        rows.append((f"Triples against {kind} transitivity", f"{broken} of {triples.triples}", ""))
    if triples.raters_with_all_pairs:
        circles = f"{triples.circular_triads} of {triples.circular_triads_max}"
        rows.append((f"Circular triads, {triples.raters_with_all_pairs} raters with all pairs", circles, ""))
    title = caption("Checks of the model", name, synthetic)
    return Table("pair-checks", title, ("Check", "Value", "p"), tuple(rows), 1)


def numbers(prepared: PlanRows, comparisons: Comparisons, findings: Findings) -> dict[str, Any]:
    """The JSON document: cells by their names, as the data have them."""
    experiment = prepared.experiment
    factors = () if findings.factors is None else findings.factors.factors
    return {
        **study_data(prepared, len(comparisons.participants)),
        "n_comparisons": int(comparisons.outcome.size),
        "labels": item_labels(experiment, comparisons.items),
        "abilities": None if findings.abilities is None else asdict(findings.abilities),
        "abilities_reason": findings.abilities_reason,
        "equal_abilities": None if findings.equal is None else asdict(findings.equal),
        "order_effect": None if findings.order is None else asdict(findings.order),
        "factors": [asdict(test) for test in factors],
        "factors_reason": findings.factors_reason,
        "pairs": [asdict(pair) for pair in findings.pairs],
        "decisions": list(comparisons.decisions),
        "exclusions": exclusions_data(prepared.exclusions),
    }


def draw_all(findings: Findings, synthetic: bool, people: int) -> tuple[Picture, ...]:
    """Abilities with their intervals, and the share of choices in each pair."""
    # matplotlib takes a second to import, which commands that draw nothing need not pay
    from analysis.report.figures import draw_abilities, draw_choices

    choices = draw_choices(findings.pairs, synthetic, people)
    if findings.abilities is None:
        return (choices,)
    return (draw_abilities(findings.abilities, synthetic, people), choices)
