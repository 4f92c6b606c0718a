"""Ratings on several scales: each analysed for itself, and how far they measure the same."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd

from analysis.plans.prepared import Prepared
from analysis.plans.rating_tests import analyse, further_sections, on_scale
from analysis.plans.result import Analysis
from analysis.report.captions import caption, in_words
from analysis.report.contents import Contents, Part, Progress, Section
from analysis.report.formats import Table
from analysis.report.json_output import as_data, exclusions_data, study_data
from analysis.report.left_out import left_out
from analysis.report.numbers import DASH, fixed
from analysis.report.within_contents import methods_of, part_of
from experiments.trials.scales import RatedScale, scales_of

METHODS = (
    "Each scale is analysed for itself, as it was answered. Cronbach's alpha is over the scales as items and "
    "the participants' ratings of clips as cases, reverse-keyed scales turned. "
)


def contents_of_scales(prepared: Prepared) -> Contents:
    """A part of the report for each scale, and one for all."""
    experiment = prepared.experiment
    scales = scales_of(experiment)
    analyses = [(scale, _of_scale(prepared, scale)) for scale in scales]
    alpha = cronbach_alpha(scale_cases(prepared, scales))
    people = prepared.rows["participant"].astype(str).nunique()
    parts = [_part(scale, analysis, replace(prepared, scale=scale.name)) for scale, analysis in analyses]
    return Contents(
        name=experiment.name,
        title=experiment.title,
        lead=f"{people} participants, {len(scales)} scales",
        source=prepared.source,
        synthetic=prepared.synthetic,
        n_participants=people,
        left_out=left_out(prepared.exclusions),
        decisions=tuple(dict.fromkeys(said for _, one in analyses for said in one.decisions)),
        parts=(*parts, _reliability(alpha, len(scales), experiment.name, prepared.synthetic)),
        methods=METHODS + methods_of(analyses[0][1]),
        numbers={
            **study_data(prepared, people),
            "scales": [
                {"scale": scale.name, "reverse": scale.reverse, **as_data(one)} for scale, one in analyses
            ],
            "cronbach_alpha": alpha,
            "exclusions": exclusions_data(prepared.exclusions),
        },
        given="ratings",
    )


def _of_scale(prepared: Prepared, scale: RatedScale) -> Analysis:
    rows = on_scale(prepared.experiment, prepared.rows, scale.name)
    return analyse(replace(prepared, exclusions=replace(prepared.exclusions, rows=rows)), scale.name)


def _part(scale: RatedScale, analysis: Analysis, prepared: Prepared) -> Part:
    """The part of one scale; `prepared` names it."""
    title = f"{in_words(scale.name)}{' (reverse-keyed)' if scale.reverse else ''}"

    def more(progress: Progress) -> tuple[Section, ...]:
        return further_sections(analysis, prepared, lambda step: progress(f"{scale.name}: {step}"))

    return part_of(analysis, more, title).under(scale.name, title)


def scale_cases(prepared: Prepared, scales: Sequence[RatedScale]) -> pd.DataFrame:
    """A row a rated trial and a column a scale, reverse-keyed ones turned; trials with every scale alone."""
    rows = prepared.rows
    keys = [name for name in ("run", "trial_index", "play") if name in rows.columns]
    if "trial_index" not in keys:
        keys = ["run", *prepared.experiment.factor_names]
    columns = {}
    for scale in scales:
        mine = rows[(rows["scale"] == scale.name).to_numpy()]
        given = mine.groupby(keys, observed=True)["response"].mean()
        columns[scale.name] = scale.minimum + scale.maximum - given if scale.reverse else given
    return pd.DataFrame(columns).dropna()


def cronbach_alpha(cases: pd.DataFrame) -> dict[str, Any] | None:
    """Alpha with its 95% interval (Feldt), by pingouin; None where a scale does not vary."""
    # pingouin takes seconds to import, which one scale need not pay
    from pingouin import cronbach_alpha as alpha_of

    if len(cases) < 3 or not (np.ptp(cases.to_numpy(dtype=float), axis=0) > 0).all():
        return None
    alpha, (low, high) = alpha_of(data=cases)
    return {"alpha": float(alpha), "ci_low": float(low), "ci_high": float(high), "n": len(cases)}


def _reliability(alpha: dict[str, Any] | None, scales: int, name: str, synthetic: bool) -> Part:
    row = ("all", str(scales), DASH, DASH, DASH)
    said = "Cronbach's alpha is not defined: a scale does not vary, or too few trials have an answer on each."
    if alpha is not None:
        bounds = f"[{fixed(alpha['ci_low'], 3)}, {fixed(alpha['ci_high'], 3)}]"
        row = ("all", str(scales), fixed(alpha["alpha"], 3), bounds, str(alpha["n"]))
        said = f"The {scales} scales agree with Cronbach's alpha = {fixed(alpha['alpha'])}, 95% CI {bounds}."
    header = ("Scales", "Items", "alpha", "95% CI", "Ratings")
    table = Table("reliability", caption("Reliability of the scales", name, synthetic), header, (row,), 1)
    return Part((table,), (said,), "Reliability")
