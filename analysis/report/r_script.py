"""A script in R that recomputes a report's tables with afex, car and emmeans, and compares."""

import csv
import io
import itertools
import re
from collections.abc import Iterable, Mapping, Sequence
from importlib.metadata import version
from itertools import combinations
from typing import Any

import numpy as np

from analysis.plans.result import Analysis
from analysis.report.write import fill_template
from analysis.robust import TRIM, Companions
from analysis.within.anova import Effect
from analysis.within.homogeneity import box_test, levene_tests
from analysis.within.pairwise import Pair
from analysis.within.simple_effects import SimpleEffect

# Numbers and rows as R reads them.


def r_number(value: float | None) -> str:
    """A number as R reads it; NA where there is none."""
    # `repr` has every digit: R compares to 1e-8, and a rounded number would differ.
    return "NA" if value is None or not np.isfinite(value) else repr(float(value))


def as_csv(rows: Iterable[Sequence[Any]]) -> str:
    """Rows as CSV text."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue()


def head_of_script(title: str, script: str, data: str) -> dict[str, str]:
    """What every script says first: of which report it is, who wrote it, its name and its data."""
    # A title over several lines would end the comment that it is written into.
    return {"title": " ".join(title.split()), "version": version("palpebra"), "script": script, "data": data}


# What the R script computes in addition to the tests: sizes, intervals, Bayes factors, equal spread,
# equivalence.

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
    # None without error, with a singular one, or with fewer df than contrasts.
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
    # `names` holds single factors; pairs of cells of several factors have another key.
    return [pair for pair in analysis.pairs if pair.effect in names]


def _pair(analysis: Analysis, pair: Pair, names: Names) -> list[Any]:
    levels = dict(zip(analysis.anova.all_factors, analysis.anova.all_levels, strict=True))[pair.effect]
    # R counts from 1.
    positions = [levels.index(name) + 1 for name in (pair.level_a, pair.level_b)]
    numbers = (pair.t, pair.df, pair.dz, *pair.dz_ci, pair.bayes_factor)
    return [names[pair.effect], *positions, *map(r_number, numbers)]


def _equivalence(analysis: Analysis, names: Names) -> str:
    """Tests of the factors all of whose pairs have one, which are those that R has."""
    rows = []
    # R tests all pairs of a factor at once, so a part of them cannot be compared.
    for name, levels in zip(analysis.anova.all_factors, analysis.anova.all_levels, strict=True):
        tests = [test for test in analysis.equivalence if test.effect == name]
        if len(tests) == len(list(combinations(levels, 2))):
            rows += [
                [names[name], *map(r_number, (*test.bounds, test.p_lower, test.p_upper, *test.ci))]
                for test in tests
            ]
    return as_csv(rows).strip()


SCRIPT, DATA = "verify.R", "cell-means.csv"

# Plain ASCII without dots: such a name needs no backticks in a formula.
_R_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
_TAKEN = frozenset(
    {
        *("participant", "rating", "mean", "emmean", "SE", "df", "T", "F", "TRUE", "FALSE"),
        *(
            "NA",
            "NULL",
            "NaN",
            "Inf",
            "if",
            "else",
            "for",
            "in",
            "function",
            "while",
            "repeat",
            "next",
            "break",
        ),
    }
)
"""Words of R's own, and columns that the script or emmeans adds to a factor's."""


def r_files(analysis: Analysis, key: str = "") -> dict[str, bytes]:
    """The script and the cell means that it reads, by file name; `key` distinguishes the parts of a
    report."""
    script, data = (f"{key}-{name}" if key else name for name in (SCRIPT, DATA))
    names = safe_names(analysis)
    text = fill_template(
        "verify.R.j2",
        **head_of_script(analysis.title, script, data),
        **design_in_r(analysis, names),
        within=bool(analysis.anova.factors),
        confidence=r_number(analysis.anova.confidence),
        effects=_effects(analysis, names),
        means=_means(analysis, names),
        pairs=_pairs(analysis, names),
        adjusted=_adjusted(analysis, names),
        contrasts=[
            f"c({', '.join(map(r_number, contrast.weights))})"
            for contrast in (*analysis.trends, *analysis.contrasts)
        ],
        contrasts_printed=_contrasts(analysis, names),
        pillai=_pillai(analysis, names),
        simple=[_levels_held(analysis, names, simple) for simple in analysis.simple_effects],
        simple_printed=_simple(analysis, names),
        **sizes(analysis, names),
    )
    return {script: text.encode(), data: _data(analysis, names).encode()}


def safe_names(analysis: Analysis) -> dict[str, str]:
    """Names that R takes in a formula: a factor's or covariate's own where it can be one."""
    own = [name for name, _ in _factors(analysis)] + [c.name for c in analysis.anova.between.covariates]
    names: dict[str, str] = {}
    for i, name in enumerate(own, start=1):
        fits = (
            # Case is ignored, so that two names never differ by it alone.
            _R_NAME.fullmatch(name) and name not in _TAKEN and name.casefold() not in map(str.casefold, names)
        )
        names[name] = name if fits else f"variable_{i}"
    return names


def _factors(analysis: Analysis) -> list[tuple[str, tuple[str, ...]]]:
    return list(zip(analysis.anova.all_factors, analysis.anova.all_levels, strict=True))


def _factor(name: str, levels: Sequence[str]) -> dict[str, str]:
    # Level names are text inside R strings: quotes and backslashes are escaped.
    texts = ", ".join('"' + level.replace("\\", "\\\\").replace('"', '\\"') + '"' for level in levels)
    return {"name": name, "texts": texts, "codes": ", ".join(f'"l{i}"' for i in range(1, len(levels) + 1))}


def factors_in_r(analysis: Analysis, names: dict[str, str]) -> list[dict[str, str]]:
    """Every factor's name in R, its levels as text and the codes that stand for them there."""
    return [_factor(names[name], levels) for name, levels in _factors(analysis)]


def design_in_r(analysis: Analysis, names: dict[str, str]) -> dict[str, Any]:
    """What every script of an ANOVA says of its design: columns, formula, type of sums of squares."""
    return {
        "factors": factors_in_r(analysis, names),
        "numbers": [names[c.name] for c in analysis.anova.between.covariates],
        "formula": formula_in_r(analysis, names),
        "type": analysis.anova.sum_of_squares,
    }


def formula_in_r(analysis: Analysis, names: dict[str, str]) -> str:
    """The formula of the ANOVA as afex takes it."""
    # The first term is the intercept, which R adds by itself.
    between = [":".join(names[part] for part in term) for term in analysis.anova.between.terms[1:]]
    within = "*".join(names[name] for name in analysis.anova.factors)
    error = f"Error(participant/({within}))" if within else "Error(participant)"
    return f"rating ~ {' + '.join([*between, error])}"


def _data(analysis: Analysis, names: dict[str, str]) -> str:
    anova, design = analysis.anova, analysis.anova.between
    header = ["participant", *(names[f] for f in design.factors), *(names[c.name] for c in design.covariates)]
    rows = []
    for i, participant in enumerate(analysis.cells.participants):
        groups = [levels[code] for levels, code in zip(design.levels, design.codes[i], strict=True)]
        # Centered as in our tables: with type III, tests of factors depend on where 0 lies.
        numbers = [repr(float(c.values[i] - c.centre)) for c in design.covariates]
        for at in np.ndindex(anova.y.shape[1:]):
            cell = [levels[k] for levels, k in zip(anova.levels, at, strict=True)]
            rows.append([participant, *groups, *numbers, *cell, repr(float(anova.y[i][at]))])
    return as_csv([[*header, *(names[f] for f in anova.factors), "rating"], *rows])


def _effects(analysis: Analysis, names: dict[str, str]) -> str:
    rows = []
    for effect in analysis.anova.effects:
        test = effect.univariate
        name = ":".join(names[part] for part in (*effect.between, *effect.within))
        # One contrast is always spherical: R reports no epsilon for it, either.
        epsilon = test.epsilon_gg if test.df_effect > 1 and effect.within else None
        rows.append(
            [name, *map(r_number, (test.f_value, test.df_effect, test.df_error, test.p_value, epsilon))]
        )
    return as_csv(rows).strip()


def _margins(analysis: Analysis) -> dict[str, tuple[str, ...]]:
    """The factors of each margin, by name of the margin."""
    return {mean.effect: tuple(mean.levels) for mean in analysis.means}


def _in_r(factors: Sequence[str], names: dict[str, str]) -> str:
    """A margin's name in R; a factor's own where it is of one."""
    return ":".join(names[factor] for factor in factors)


def _means(analysis: Analysis, names: dict[str, str]) -> str:
    rows = [
        [
            _in_r(tuple(mean.levels), names),
            # Codes, not names: cells are joined by colons, which a name may contain.
            _cells(analysis, tuple(mean.levels))[tuple(mean.levels.values())],
            *map(r_number, (mean.mean, mean.se, *mean.ci)),
        ]
        for mean in analysis.means
    ]
    return as_csv(rows).strip()


def _cells(analysis: Analysis, factors: Sequence[str]) -> dict[tuple[str, ...], str]:
    """The codes of each cell of a margin, joined as R joins them, by the names of its levels."""
    levels = dict(_factors(analysis))
    of = [[(name, f"l{i}") for i, name in enumerate(levels[factor], start=1)] for factor in factors]
    return {
        tuple(name for name, _ in cell): ":".join(code for _, code in cell) for cell in itertools.product(*of)
    }


def _pairs(analysis: Analysis, names: dict[str, str]) -> str:
    rows, margins = [], _margins(analysis)
    for pair in analysis.pairs:
        factors = margins[pair.effect]
        codes = _cells(analysis, factors)
        numbers = (pair.difference, pair.se, pair.df, pair.t, pair.p, *pair.ci)
        cells = [codes[tuple(cell[name] for name in factors)] for cell in (pair.cell_a, pair.cell_b)]
        rows.append([_in_r(factors, names), *cells, *map(r_number, numbers)])
    return as_csv(rows).strip()


def _adjusted(analysis: Analysis, names: dict[str, str]) -> str:
    margins = _margins(analysis)
    rows = [
        [
            _in_r(margins[pair.effect], names),
            *map(r_number, (pair.p, pair.p_bonferroni, pair.p_holm, pair.p_sidak, pair.p_fdr)),
            # What Studentized ranges need besides p: t, its df and the number of means.
            *map(r_number, (pair.t, pair.df, len(_cells(analysis, margins[pair.effect])), pair.p_tukey)),
        ]
        for pair in analysis.pairs
    ]
    return as_csv(rows).strip()


def _contrasts(analysis: Analysis, names: dict[str, str]) -> str:
    rows = [
        [names[c.factor], f"contrast {i}", *map(r_number, (c.estimate, c.se, c.t, c.p, *c.ci))]
        for i, c in enumerate((*analysis.trends, *analysis.contrasts), start=1)
    ]
    return as_csv(rows).strip()


def _pillai(analysis: Analysis, names: dict[str, str]) -> str:
    rows = []
    for effect in analysis.anova.effects:
        if effect.multivariate is not None and effect.within:
            name = ":".join(names[part] for part in (*effect.between, *effect.within))
            rows.append([name, r_number(effect.multivariate.pillai)])
    return as_csv(rows).strip()


def _levels_held(analysis: Analysis, names: dict[str, str], simple: SimpleEffect) -> str:
    """The levels at which a simple effect is tested, as codes."""
    levels = dict(_factors(analysis))
    # Codes l1, l2, ... in place of names, which may hold quotes.
    at = (f'{names[name]} = "l{levels[name].index(level) + 1}"' for name, level in simple.at.items())
    return f"list({', '.join(at)})"


def _simple(analysis: Analysis, names: dict[str, str]) -> str:
    """Each as it is printed: the exact F, or that of too few participants with Greenhouse-Geisser's df."""
    rows = []
    for simple in analysis.simple_effects:
        exact, test = simple.test.multivariate, simple.test.univariate
        numbers = (test.f_value, test.df_effect_gg, test.df_error_gg, test.p_gg)
        if exact is not None:
            numbers = (exact.f_value, exact.df_effect, exact.df_error, exact.p_value)
        within = simple.of in analysis.anova.factors
        # R has separate functions for the three; the word selects one.
        how = ("exact" if exact is not None else "corrected") if within else "between"
        rows.append([names[simple.of], *map(r_number, numbers), how])
    return as_csv(rows).strip()


# A script in R that computes the robust companions of a report again, and compares.

ROBUST_SCRIPT = f"robust-{SCRIPT}"


def robust_files(analysis: Analysis, companions: Companions, key: str = "") -> dict[str, bytes]:
    """The script by file name; it reads the cell means in the folder of `verify.R`."""
    script, data = (f"{key}-{name}" if key else name for name in (ROBUST_SCRIPT, DATA))
    names = safe_names(analysis)
    design = analysis.anova.between
    text = fill_template(
        "verify-robust.R.j2",
        **head_of_script(analysis.title, script, data),
        **design_in_r(analysis, names),
        between=[names[name] for name in (*design.factors, *(c.name for c in design.covariates))],
        terms=[":".join(names[part] for part in term) for term in design.terms[1:]],
        groups=[names[name] for name in design.factors],
        within=[names[name] for name in analysis.anova.factors],
        trim=TRIM,
        permutations=_permutations(analysis, companions, names),
        ranks=_ranks(analysis, companions, names),
        trimmed=_trimmed(companions, names),
    )
    return {script: text.encode()}


def _permutations(analysis: Analysis, companions: Companions, names: dict[str, str]) -> str:
    rows = []
    for effect, test in zip(analysis.anova.effects, companions.permutations, strict=True):
        between, within = (
            ":".join(names[part] for part in parts) for parts in (effect.between, effect.within)
        )
        exact = "TRUE" if test.exact else "FALSE"
        rows.append(
            [between, within, r_number(test.f_value), r_number(test.p_value), test.n_rearranged, exact]
        )
    return as_csv(rows).strip()


def _ranks(analysis: Analysis, companions: Companions, names: dict[str, str]) -> str:
    rows = []
    for test in companions.ranks:
        factors = analysis.anova.effect(test.effect).factors
        # Without a correction R has none to compare: NA leaves the number out.
        epsilon = test.epsilon_gg if test.epsilon_gg < 1 else float("nan")
        numbers = (test.f_value, test.df_effect, test.df_error, test.p_value, epsilon)
        rows.append([":".join(names[part] for part in factors), *map(r_number, numbers)])
    return as_csv(rows).strip()


def _trimmed(companions: Companions, names: dict[str, str]) -> str:
    rows = []
    for pair in companions.trimmed:
        numbers = (pair.difference, pair.se, pair.df, pair.t, pair.p, pair.p_holm, *pair.ci)
        rows.append([names[pair.effect], *map(r_number, numbers)])
    return as_csv(rows).strip()
