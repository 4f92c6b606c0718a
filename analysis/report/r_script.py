"""A script in R that computes a report's tables anew with afex, car and emmeans, and compares."""

import itertools
import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from analysis.plans.result import Analysis
from analysis.report.r_sizes import sizes
from analysis.report.r_text import as_csv, head_of_script, r_number
from analysis.report.templating import filled
from analysis.within.simple_effects import SimpleEffect

SCRIPT, DATA = "verify.R", "cell-means.csv"

_R_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
_TAKEN = frozenset(
    {"participant", "mean", "T", "F", "TRUE", "FALSE", "NA", "NULL", "if", "else", "for", "in", "function"}
)


def r_files(analysis: Analysis, key: str = "") -> dict[str, bytes]:
    """The script and the cell means that it reads, by file name; `key` tells the parts of a report apart."""
    script, data = (f"{key}-{name}" if key else name for name in (SCRIPT, DATA))
    names = safe_names(analysis)
    text = filled(
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
            _R_NAME.fullmatch(name) and name not in _TAKEN and name.casefold() not in map(str.casefold, names)
        )
        names[name] = name if fits else f"variable_{i}"
    return names


def _factors(analysis: Analysis) -> list[tuple[str, tuple[str, ...]]]:
    return list(zip(analysis.anova.all_factors, analysis.anova.all_levels, strict=True))


def _factor(name: str, levels: Sequence[str]) -> dict[str, str]:
    texts = ", ".join('"' + level.replace("\\", "\\\\").replace('"', '\\"') + '"' for level in levels)
    return {"name": name, "texts": texts, "codes": ", ".join(f'"l{i}"' for i in range(1, len(levels) + 1))}


def factors_in_r(analysis: Analysis, names: dict[str, str]) -> list[dict[str, str]]:
    """Every factor's name in R, its levels as text and the codes that stand for them there."""
    return [_factor(names[name], levels) for name, levels in _factors(analysis)]


def design_in_r(analysis: Analysis, names: dict[str, str]) -> dict[str, Any]:
    """What every script of an ANOVA says of its design: factors, formula, type of sums of squares."""
    return {
        "factors": factors_in_r(analysis, names),
        "formula": formula_in_r(analysis, names),
        "type": analysis.anova.sum_of_squares,
    }


def formula_in_r(analysis: Analysis, names: dict[str, str]) -> str:
    """The formula of the ANOVA as afex takes it."""
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
        epsilon = test.epsilon_gg if test.df_effect > 1 and effect.within else None
        rows.append(
            [name, *map(r_number, (test.f_value, test.df_effect, test.df_error, test.p_value, epsilon))]
        )
    return as_csv(rows).strip()


def _margins(analysis: Analysis) -> dict[str, tuple[str, ...]]:
    """The factors of each margin, by its name."""
    return {mean.effect: tuple(mean.levels) for mean in analysis.means}


def _in_r(factors: Sequence[str], names: dict[str, str]) -> str:
    """A margin's name in R; a factor's own where it is of one."""
    return ":".join(names[factor] for factor in factors)


def _means(analysis: Analysis, names: dict[str, str]) -> str:
    rows = [
        [
            _in_r(tuple(mean.levels), names),
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
        how = ("exact" if exact is not None else "corrected") if within else "between"
        rows.append([names[simple.of], *map(r_number, numbers), how])
    return as_csv(rows).strip()
