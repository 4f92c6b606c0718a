"""Degradation mean opinion scores (ITU-T P.910): impairment by cell, and against the rated reference."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd
from scipy import stats

from analysis.plans.plan import PlanRows
from analysis.plans.result import labels_of
from analysis.report.contents import Contents, Part, caption
from analysis.report.formats import Table
from analysis.report.numbers import DASH, fixed, interval
from experiments import design
from experiments.declaration.clip_rating import SCALE_NAME, RatingReference, clip_rating_of
from experiments.declaration.trial import ClipSpec, RatedScale
from experiments.kinds import scales_of

METHODS = (
    " DMOS is the mean over participants of their mean rating of a cell shown after its reference. Its 95% "
    "interval is from t with n - 1 degrees of freedom (ITU-T P.910)."
)
TURNED = (
    " Answers on a reverse-keyed scale are reversed first (lowest + highest answer - the answer), so high "
    "scores always mean little impairment."
)
DIFFERENTIAL = (
    " If the hidden reference was rated, a participant's differential score is V(P) - V(R) + the highest "
    "answer. V(P) and V(R) are the mean ratings of the cell and of its reference."
)


@dataclass(frozen=True)
class CellScore:
    """One cell on one scale: mean over participants, its interval, and the same of differential scores.

    Attributes
    ----------
    label : str
        The labels of the cell's levels, as tables and sentences call it.
    turned : bool
        Whether the scale is reverse-keyed, hence its answers turned: a high score is little impairment.
    dmos, sd, ci_low, ci_high : float
        NaN where too few participants rated the cell; sd with n - 1.
    n : int
        Participants.
    differential, differential_low, differential_high : float or None
        Mean of V(P) - V(R) + highest answer; None where the reference was not rated, or is this cell.
    """

    scale: str
    turned: bool
    cell: str
    label: str
    dmos: float
    sd: float
    n: int
    ci_low: float
    ci_high: float
    differential: float | None
    differential_low: float | None
    differential_high: float | None


def scores(prepared: PlanRows) -> tuple[CellScore, ...]:
    """The scores of each cell on each scale that `prepared` names, in the order of the design."""
    return tuple(
        score
        for scale in scales_of(prepared.experiment)
        if prepared.scale in (None, scale.name)
        for score in _of_scale(prepared, scale)
    )


def _of_scale(prepared: PlanRows, scale: RatedScale) -> list[CellScore]:
    means = _means(prepared, scale)
    labels = labels_of(prepared.experiment)
    return [
        _scored(scale, (clip.cell, labels.cell(dict(clip.levels))), means, reference)
        for clip, reference in _references(prepared)
        if clip.cell in means
    ]


def _means(prepared: PlanRows, scale: RatedScale) -> Mapping[str, "pd.Series[float]"]:
    """Each participant's mean rating by cell, answers on a reverse-keyed scale turned."""
    rows = prepared.rows
    # With one scale the column may be missing, or hold no name.
    if len(scales_of(prepared.experiment)) > 1:
        rows = rows[(rows["scale"] == scale.name).to_numpy()]
    # Cells are named by their levels in declared order, as `ClipSpec.cell` does.
    cells = rows[prepared.experiment.factor_names[0]].astype(str)
    for name in prepared.experiment.factor_names[1:]:
        cells = cells + "/" + rows[name].astype(str)
    answers = rows["response"]
    turned = scale.minimum + scale.maximum - answers if scale.reverse else answers
    # Answers of "does not apply" are not numbers.
    given = rows.assign(cell=cells, response=turned).dropna(subset=["response"])
    return {
        # Means of people first, so that each counts once however many exemplars they saw.
        str(cell): of.groupby("participant", observed=True)["response"].mean()
        for cell, of in given.groupby("cell")
    }


def _references(prepared: PlanRows) -> list[tuple[ClipSpec, str | None]]:
    """A clip of each cell, and the cell of its reference; None where it is its own."""
    experiment = prepared.experiment
    declared = _reference_of(prepared)
    # Exemplar 1 is as good as any: a reference is declared by levels.
    clips = [ClipSpec(levels, 1) for levels in design.cells(experiment)]
    references = [declared.of(experiment, clip) for clip in clips]
    return [
        (clip, None if reference == clip else reference.cell)
        for clip, reference in zip(clips, references, strict=True)
    ]


def _reference_of(prepared: PlanRows) -> RatingReference:
    reference = clip_rating_of(prepared.experiment).reference
    # Never reached from a report, which asks first.
    if reference is None:
        raise ValueError("expected a declared reference")
    return reference


def _scored(
    scale: RatedScale, named: tuple[str, str], means: Mapping[str, "pd.Series[float]"], reference: str | None
) -> CellScore:
    """The score of a cell `named` by name and label."""
    mine = means[named[0]]
    mean, sd, low, high = _interval(mine.to_numpy(dtype=float))
    differential: tuple[float | None, ...] = (None, None, None)
    if reference is not None and reference in means:
        # Only participants who rated both: a difference needs one of each.
        # P.910 adds the highest answer, so that no impairment gives that answer again.
        both = (mine - means[reference]).dropna().to_numpy(dtype=float) + scale.maximum
        at, _, from_, to = _interval(both)
        differential = (at, from_, to)
    return CellScore(scale.name, scale.reverse, *named, mean, sd, len(mine), low, high, *differential)


def _interval(values: np.ndarray[Any, Any]) -> tuple[float, float, float, float]:
    """Mean, sd (n - 1), and the ends of the 95% interval of the mean; NaN where undefined."""
    # One participant has a mean, but no spread.
    if len(values) < 2:
        return (float(values.mean()) if len(values) else np.nan, np.nan, np.nan, np.nan)
    mean, sd = float(values.mean()), float(values.std(ddof=1))
    reach = float(stats.t.ppf(0.975, len(values) - 1)) * sd / np.sqrt(len(values))
    return mean, sd, mean - reach, mean + reach


def with_degradation(contents: Contents, prepared: PlanRows) -> Contents:
    """The report with a part of degradation scores, where the study shows a reference before each clip."""
    reference = clip_rating_of(prepared.experiment).reference
    if reference is None:
        return contents
    every = scores(prepared)
    part = Part((_table(every, prepared),), extremes(every), "Degradation", key="degradation")
    named = tuple(replace(one, title=one.title or "Ratings") for one in contents.parts)
    return replace(
        contents,
        parts=(*named, part),
        methods=contents.methods + _methods(every, reference),
        # `vars` keeps the names of fields as keys of the JSON.
        numbers={**contents.numbers, "degradation": [vars(one) for one in every]},
    )


def _methods(every: tuple[CellScore, ...], reference: RatingReference) -> str:
    turned = TURNED if any(one.turned for one in every) else ""
    return METHODS + turned + (DIFFERENTIAL if reference.rate_itself else "")


def _table(every: tuple[CellScore, ...], prepared: PlanRows) -> Table:
    rows = tuple(
        (
            f"{one.scale} (reversed)" if one.turned else one.scale,
            one.label,
            fixed(one.dmos),
            fixed(one.sd),
            str(one.n),
            interval((one.ci_low, one.ci_high)),
            DASH if one.differential is None else fixed(one.differential),
            _range(one.differential_low, one.differential_high),
        )
        for one in every
    )
    header = ("Scale", "Cell", "DMOS", "SD", "n", "95% CI", "Differential", "95% CI")
    title = caption("Degradation mean opinion scores", prepared.experiment.name, prepared.synthetic)
    return Table("degradation", title, header, rows, 2)


def _range(low: float | None, high: float | None) -> str:
    return DASH if low is None or high is None else interval((low, high))


def extremes(every: tuple[CellScore, ...]) -> tuple[str, ...]:
    """The least and the most impaired cell of each scale, in words: scales of other ranges do not compare."""
    return tuple(
        _extremes_of([one for one in every if one.scale == scale], scale)
        # In the order of the design, each scale once.
        for scale in dict.fromkeys(one.scale for one in every)
    ) or ("No cell has a rating.",)


def _extremes_of(cells: list[CellScore], scale: str) -> str:
    # NaN cells cannot be compared and are left out.
    told = [one for one in cells if np.isfinite(one.dmos)]
    on_scale = "" if scale == SCALE_NAME else f" on {scale}"
    if not told:
        return f"No cell has a rating{on_scale}."
    least, most = max(told, key=lambda one: one.dmos), min(told, key=lambda one: one.dmos)
    return (
        f"The least impaired cell{on_scale} was {least.label} (DMOS {fixed(least.dmos)}, n = {least.n}); the "
        f"most impaired was {most.label} (DMOS {fixed(most.dmos)}, n = {most.n})."
    )
