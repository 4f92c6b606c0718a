"""A script in R that computes a report's tables anew with afex, car and emmeans, and compares."""

import csv
import io
import re
from collections.abc import Iterable, Sequence
from importlib.metadata import version
from typing import Any

import numpy as np

from analysis.plans.result import Analysis
from analysis.report.templating import filled

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
        title=" ".join(analysis.title.split()),
        version=version("palpebra"),
        script=script,
        data=data,
        factors=[_factor(names[name], levels) for name, levels in _factors(analysis)],
        within=bool(analysis.anova.factors),
        formula=_formula(analysis, names),
        type=analysis.anova.sum_of_squares,
        effects=_effects(analysis, names),
        means=_means(analysis, names),
        pairs=_pairs(analysis, names),
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


def _formula(analysis: Analysis, names: dict[str, str]) -> str:
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
    return _csv([[*header, *(names[f] for f in anova.factors), "rating"], *rows])


def _effects(analysis: Analysis, names: dict[str, str]) -> str:
    rows = []
    for effect in analysis.anova.effects:
        test = effect.univariate
        name = ":".join(names[part] for part in (*effect.between, *effect.within))
        epsilon = test.epsilon_gg if test.df_effect > 1 and effect.within else None
        rows.append(
            [name, *map(_number, (test.f_value, test.df_effect, test.df_error, test.p_value, epsilon))]
        )
    return _csv(rows).strip()


def _means(analysis: Analysis, names: dict[str, str]) -> str:
    rows = [[names[m.effect], _number(m.mean), _number(m.se)] for m in analysis.means if m.effect in names]
    return _csv(rows).strip()


def _pairs(analysis: Analysis, names: dict[str, str]) -> str:
    rows = [
        [names[pair.effect], *map(_number, (pair.difference, pair.se, pair.df, pair.t, pair.p))]
        for pair in analysis.pairs
        if pair.effect in names
    ]
    return _csv(rows).strip()


def _number(value: float | None) -> str:
    return "NA" if value is None or not np.isfinite(value) else repr(float(value))


def _csv(rows: Iterable[Sequence[Any]]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue()
