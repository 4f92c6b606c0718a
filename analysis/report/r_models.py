"""A script in R that fits the mixed and ordinal models of a report anew, and compares."""

from collections.abc import Sequence
from itertools import count, product
from typing import TYPE_CHECKING, Any

import pandas as pd

from analysis.plans.result import Analysis
from analysis.report.r_script import SCRIPT
from analysis.report.r_text import as_csv, head_of_script, r_number
from analysis.report.templating import filled
from analysis.within.contrasts import effect_members

if TYPE_CHECKING:
    from analysis.models.mixed_result import MixedResult
    from analysis.models.ordinal_result import OrdinalResult

Rows = list[list[Any]]

MODEL_SCRIPTS = tuple(f"{kind}-{SCRIPT}" for kind in ("mixed", "ordinal"))
"""How the names of these scripts end."""


def model_files(
    analysis: Analysis, arguments: dict[str, Any], model: "MixedResult | OrdinalResult", key: str = ""
) -> dict[str, bytes]:
    """The script of one model and the ratings it reads, by file name.

    The contrasts of a factor of three levels or more share one variance here, which neither lmer nor clmm
    has: both packages' own likelihood functions are asked for it. No file for an ordinal model with an SD at
    its upper limit, where the likelihood has no maximum.
    """
    from analysis.models.mixed_result import MixedResult
    from analysis.models.ordinal_maximum import SD_MAX

    is_mixed = isinstance(model, MixedResult)
    if not is_mixed and max(c.sd for c in model.components) > SD_MAX - 1e-6:
        return {}
    kind = "mixed" if is_mixed else "ordinal"
    slopes = [c.term for c in model.components if c.group == "participant" and c.term != "intercept"]
    levels = dict(zip(analysis.anova.all_factors, analysis.anova.all_levels, strict=True))
    shared = any(len(levels[name]) > 2 for slope in slopes for name in slope.split(":"))
    own = "-".join(part for part in (key, kind) if part)
    script, data = f"{own}-{SCRIPT}", f"{own}-ratings.csv"
    names = {name: f"f{i}" for i, name in enumerate(model.factors, start=1)}
    coded = (", ".join(f'"{names[name]}"' for name in slope.split(":")) for slope in slopes)
    with_df = isinstance(model, MixedResult) and not shared and not model.singular
    text = filled(
        "verify-models.R.j2",
        **head_of_script(analysis.title, script, data),
        factors=[{"name": names[name], "levels": len(levels[name])} for name in model.factors],
        slopes=[f"c({slope})" for slope in coded],
        fixed=" * ".join(names.values()),
        mixed=is_mixed,
        ordinal=not is_mixed,
        df=with_df,
        **({} if isinstance(model, MixedResult) else _estimates(model, names, levels)),
        printed=as_csv(
            _printed_mixed(model, names, with_df)
            if isinstance(model, MixedResult)
            else _printed_ordinal(model, names, levels)
        ).strip(),
        floor="1e-3",
        limit="1e-5",
        loose=[f'"{table}"' for table in ("mixed df", "ordinal coefficient", "ordinal se", "ordinal SD")],
    )
    return {script: text.encode(), data: _ratings(arguments, model.factors, names).encode()}


def _printed_mixed(model: "MixedResult", names: dict[str, str], with_df: bool) -> Rows:
    """Criterion, F, and df where lmerTest has them: not of shared variances, nor at a bound."""
    rows: Rows = [["mixed criterion", "REML", r_number(model.reml_criterion)]]
    for effect in model.effects:
        label = ":".join(sorted(names[part] for part in effect.effect.split(":")))
        rows.append(["mixed F", label, r_number(effect.f_value)])
        if with_df:
            rows.append(["mixed df", label, r_number(effect.df_error)])
    return [*rows, ["mixed residual SD", "residual", r_number(model.sigma)]]


def _printed_ordinal(
    model: "OrdinalResult", names: dict[str, str], levels: dict[str, tuple[str, ...]]
) -> Rows:
    thresholds = enumerate(model.thresholds, start=1)
    rows: Rows = [["ordinal likelihood", "log", r_number(model.log_likelihood)]]
    rows += [["ordinal threshold", str(i), r_number(value)] for i, value in thresholds]
    for key, coefficient in zip(_r_columns(model, names, levels), model.coefficients, strict=True):
        rows.append(["ordinal coefficient", key, r_number(coefficient.estimate)])
        rows.append(["ordinal se", key, r_number(coefficient.se)])
    return [*rows, *(["ordinal SD", key, r_number(sd)] for key, sd in _spreads(model))]


def _estimates(
    model: "OrdinalResult", names: dict[str, str], levels: dict[str, tuple[str, ...]]
) -> dict[str, list[str]]:
    """Where the script takes clmm's likelihood: numbers in R, those of a kind with their names."""
    named = zip(_r_columns(model, names, levels), model.coefficients, strict=True)
    return {
        "thresholds": [r_number(value) for value in model.thresholds],
        "coefficients": [f"`{key}` = {r_number(coefficient.estimate)}" for key, coefficient in named],
        "spreads": [f"`{key}` = {r_number(sd)}" for key, sd in _spreads(model)],
    }


def _r_columns(
    model: "OrdinalResult", names: dict[str, str], levels: dict[str, tuple[str, ...]]
) -> list[str]:
    """R's names of the sum-coded coefficients, in the order of those here: R has f2:f3 before f1:f4."""
    return [
        ":".join(f"{names[model.factors[m]]}{k}" for m, k in zip(members, codes, strict=True))
        for members in effect_members(len(model.factors))
        for codes in product(*(range(1, len(levels[model.factors[m]])) for m in members))
    ]


def _grouping(name: str) -> str:
    """The script's column of a grouping: the one that is no participant is its item."""
    return name if name == "participant" else "item"


def _spreads(model: "OrdinalResult") -> list[tuple[str, float]]:
    """Standard deviations as the script calls them: a group's intercept by its name, slopes by number."""
    slopes = count(1)
    return [
        (_grouping(c.group) if c.term == "intercept" else str(next(slopes)), c.sd) for c in model.components
    ]


def _ratings(
    arguments: dict[str, Any],
    factors: Sequence[str],
    names: dict[str, str],
) -> str:
    """Trials with codes for people, items and levels, so that no name stands in code."""
    from analysis.within.level_codes import level_codes

    rows: pd.DataFrame = arguments["rows"]
    items = rows.groupby(list(arguments["item"]), sort=False, observed=True, dropna=False).ngroup()
    columns: list[list[Any]] = [
        (pd.factorize(rows["participant"].astype(str))[0] + 1).tolist(),
        (items + 1).tolist(),
    ]
    for name in factors:
        # as the model codes them: the words of an SPSS file stand in the order of its codes
        columns.append((level_codes(rows[name], name)[0] + 1).tolist())
    columns.append([r_number(value) for value in rows[arguments["rating"]]])
    header = ["participant", "item", *(names[name] for name in factors), "rating"]
    return as_csv([header, *zip(*columns, strict=True)])
