"""What the R script computes beside the tests: sizes, intervals, Bayes factors, equal spread, equivalence."""

from collections.abc import Mapping
from itertools import combinations
from typing import Any

from analysis.plans.result import Analysis
from analysis.report.r_text import as_csv, r_number
from analysis.within.effects import Effect
from analysis.within.homogeneity import box_test, levene_tests
from analysis.within.pairwise import Pair

Names = Mapping[str, str]


def sizes(analysis: Analysis, names: Names) -> dict[str, Any]:
    """The values of `verify-sizes.R.j2`; `names` are those of factors and covariates in R."""
    design = analysis.anova.between
    box = box_test(analysis.anova)
    known = box is not None and box.m is not None
    terms = [":".join(names[part] for part in term) for term in design.terms[1:]]
    return {
        "sizes": as_csv(_effect(effect, names) for effect in analysis.anova.effects).strip(),
        "dz": as_csv(_pair(analysis, pair, names) for pair in _of_one_factor(analysis, names)).strip(),
        "between": [names[name] for name in (*design.factors, *(c.name for c in design.covariates))],
        "between_terms": " + ".join(terms) or "1",
        "groups": [names[name] for name in design.factors],
        "within_names": [names[name] for name in analysis.anova.factors],
        "levene": as_csv(
            [f"cell {i}", r_number(test.f_value), r_number(test.p_value)]
            for i, test in enumerate(levene_tests(analysis.anova))
        ).strip(),
        "box": as_csv([[r_number(v) for v in (box.m, box.chi2, box.df, box.p_value)]]).strip()
        if box is not None and known
        else "",
        "equivalence": _equivalence(analysis, names),
    }


def _effect(effect: Effect, names: Names) -> list[str]:
    several = effect.multivariate
    exact = several is not None and several.exact and bool(effect.within)
    numbers = [effect.eta_sq_partial, effect.omega_sq_partial, *effect.eta_sq_partial_ci]
    numbers.append(effect.eta_sq_generalized)
    if exact and several is not None:
        numbers += [*several.eta_sq_partial_ci, several.f_value, several.df_effect, several.df_error]
    else:
        numbers += [float("nan")] * 5
    return [":".join(names[part] for part in (*effect.between, *effect.within)), *map(r_number, numbers)]


def _of_one_factor(analysis: Analysis, names: Names) -> list[Pair]:
    return [pair for pair in analysis.pairs if pair.effect in names]


def _pair(analysis: Analysis, pair: Pair, names: Names) -> list[Any]:
    levels = dict(zip(analysis.anova.all_factors, analysis.anova.all_levels, strict=True))[pair.effect]
    positions = [levels.index(name) + 1 for name in (pair.level_a, pair.level_b)]
    numbers = (pair.t, pair.df, pair.dz, *pair.dz_ci, pair.bayes_factor)
    return [names[pair.effect], *positions, *map(r_number, numbers)]


def _equivalence(analysis: Analysis, names: Names) -> str:
    """Tests of the factors all of whose pairs have one, which are those that R has."""
    rows = []
    for name, levels in zip(analysis.anova.all_factors, analysis.anova.all_levels, strict=True):
        tests = [test for test in analysis.equivalence if test.effect == name]
        if len(tests) == len(list(combinations(levels, 2))):
            rows += [
                [names[name], *map(r_number, (*test.bounds, test.p_lower, test.p_upper, *test.ci))]
                for test in tests
            ]
    return as_csv(rows).strip()
