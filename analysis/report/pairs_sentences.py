"""Sentences about paired comparisons in APA style."""

import math
from collections.abc import Sequence

from analysis.pairs.factors import FactorTest
from analysis.pairs.findings import Findings
from analysis.pairs.pairs_result import PairsResult
from analysis.report.numbers import apa_p, fixed

SIGNIFICANCE = 0.05
LACK_OF_FIT = "lack of fit"


def sentences(findings: Findings, items: Sequence[str]) -> tuple[str, ...]:
    """Whether items differ and in which order, what each factor does, and how well the model holds."""
    result = findings.abilities
    if result is None:
        return (f"The abilities of {len(items)} cells were not fitted: {findings.abilities_reason}.",)
    said = [_equality(findings, result), _ranking(result)]
    if findings.factors is not None:
        said += [_factor(test) for test in findings.factors.factors if test.df > 0]
    elif findings.factors_reason:
        said.append(f"Effects of factors were not fitted: {findings.factors_reason}.")
    return (*said, *_checks(findings, result))


def _equality(findings: Findings, result: PairsResult) -> str:
    if findings.equal is None:
        return (
            "Some cell won or lost every comparison with the others, so that its ability is finite only by "
            "Firth's penalty; equal abilities were not tested."
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
    return f"From most to least chosen, abilities in {result.scale}, against their mean: {'; '.join(named)}."


def _factor(test: FactorTest) -> str:
    statistic = f"χ²({test.df}) = {fixed(test.chi2)}, {apa_p(test.p)}"
    if test.factor == LACK_OF_FIT:
        fits = "do not tell the whole" if test.p < SIGNIFICANCE else "suffice"
        return f"Effects of single factors {fits} (free abilities against their sum), {statistic}."
    verdict = "was significant" if test.p < SIGNIFICANCE else "was not significant"
    levels = [
        f"{level} {fixed(estimate)} (SE = {fixed(se)})"
        for level, estimate, se in zip(test.levels, test.estimates, test.standard_errors, strict=True)
    ]
    return (
        f"The effect of {test.factor} {verdict}, {statistic}. Against {test.reference}: {', '.join(levels)}."
    )


def _checks(findings: Findings, result: PairsResult) -> list[str]:
    said, fit = [], result.goodness
    if fit.df > 0 and math.isfinite(fit.p) and not result.firth:
        holds = "departs from" if fit.p < SIGNIFICANCE else "does not depart significantly from"
        said.append(
            f"The share of choices in the pairs {holds} the model, χ²({fit.df}) = {fixed(fit.deviance)}, "
            f"{apa_p(fit.p)}."
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
        said.append(f"{triples.weak_violations} of {triples.triples} triples break weak transitivity.")
    return said
