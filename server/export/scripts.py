"""Scripts that analyse an export with usual packages: R (afex, emmeans, lme4), Python (pandas, statsmodels).

They are written anew for each study, from its declaration, and read the long table of answers.
"""

import json
from collections.abc import Mapping
from typing import Any, Literal

from jinja2 import Environment, PackageLoader, StrictUndefined

from experiments.definition import Experiment
from experiments.design import rated_levels
from experiments.rules import DropFailedPlays, DropSlowTrials, ExcludeIncomplete
from experiments.trials import KINDS
from experiments.trials.scales import scales_of

ScriptLanguage = Literal["R", "py"]
LANGUAGES: tuple[ScriptLanguage, ...] = ("R", "py")
"""By the ending of their files. A view without a template of its own gets one that reads its rows."""
APPLIED = (ExcludeIncomplete, DropFailedPlays, DropSlowTrials)
"""Rules that a row's own columns decide: scripts apply them. The others look at whole runs."""


def script(
    experiment: Experiment, language: ScriptLanguage, data: str, names: Mapping[str, str] | None = None
) -> str:
    """The script of an experiment.

    Parameters
    ----------
    data : str
        The CSV it reads where it is not told another: a path from the script's own folder.
    names : mapping of str to str, optional
        What factors are called in that CSV, where it is not their own name.
    """
    column = dict(names or {})
    factors: list[dict[str, Any]] = [
        {
            "name": column.get(factor.name, factor.name),
            "label": factor.label,
            "levels": rated_levels(experiment, factor.name),
            "between": factor.between,
            "random": factor.random,
        }
        for factor in experiment.factors
    ]
    rules = [rule.rule.replace("_", " ") for rule in experiment.exclusions if not isinstance(rule, APPLIED)]
    values: dict[str, Any] = {
        "title": " ".join(experiment.title.split()),
        "data": data,
        "factors": factors,
        "analysed": [f for f in factors if len(f["levels"]) > 1 and _in_plan(experiment, f, column)],
        "scales": scales_of(experiment),
        "applied": [rule for rule in experiment.exclusions if isinstance(rule, APPLIED)],
        "rules": rules,
        "unapplied": f"note: nobody is left out by these declared exclusions ({'; '.join(rules)}): "
        "list the runs that `analysis run` names, in this script",
        "view": KINDS[experiment.trial.kind].view.name,
    }
    templates = [f"{values['view']}.{language}.j2", f"answers.{language}.j2"]
    return _environment().select_template(templates).render(values)


def _in_plan(experiment: Experiment, factor: Mapping[str, Any], column: Mapping[str, str]) -> bool:
    return factor["name"] in {column.get(name, name) for name in experiment.compared_factors}


def _environment() -> Environment:
    environment = Environment(
        loader=PackageLoader("server", "export/templates"),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,  # noqa: S701 - scripts, whose texts are quoted by `text`
    )
    # A string of JSON is one of R and of Python too, once the escapes that only JSON has are not there.
    environment.filters["text"] = lambda value: json.dumps(str(value), ensure_ascii=False)
    environment.filters["texts"] = lambda values: ", ".join(
        json.dumps(str(value), ensure_ascii=False) for value in values
    )
    return environment
