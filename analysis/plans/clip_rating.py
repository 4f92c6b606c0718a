"""The analysis of single-clip ratings: cell means, their tests, and models beside them."""

from dataclasses import replace
from functools import partial

import numpy as np
import pandas as pd

from analysis.errors import NoRatingsError
from analysis.plans.plan import Plan
from analysis.plans.prepare import prepare, refuse_unknown, where
from analysis.plans.prepared import Prepared
from analysis.plans.rating_tests import analyse, further_sections, on_scale
from analysis.plans.result import Analysis
from analysis.read.pool import Pool
from analysis.read.reading import Reading
from analysis.read.study_answers import StudyAnswers
from analysis.report.contents import Contents
from experiments.definition import Experiment
from experiments.design import rated_levels
from experiments.errors import InputError
from experiments.trials.clip_rating.columns import RATINGS
from experiments.trials.clip_rating.declaration import clip_rating_of
from experiments.trials.scales import RatedScale, scale_called, scales_of

READING = Reading(RATINGS, numbers=("response",), further=("exemplar",), beside=("scale", "not_applicable"))


def check(experiment: Experiment, rows: pd.DataFrame, source: str) -> None:
    """Refuse a rating off the declared scale, and an unknown level."""
    for scale in scales_of(experiment):
        _check_scale(scale, on_scale(experiment, rows, scale.name), source)
    for factor in experiment.factors:
        known = [level.name for level in factor.levels]
        refuse_unknown(rows, factor.name, known, f"level of '{factor.name}'", source)
        _refuse_unrated(rows, factor.name, set(known) - {*rated_levels(experiment, factor.name)}, source)


def _refuse_unrated(rows: pd.DataFrame, factor: str, unrated: set[str], source: str) -> None:
    """Refuse a rating of a clip that is only shown as a reference; a row without one says nothing."""
    off = rows[factor].isin(unrated).to_numpy() & rows["response"].notna().to_numpy()
    if off.any():
        at = int(np.argmax(off))
        raise InputError(
            f"{source}: {where(rows, at)}: a rating of the reference's level '{rows[factor].iloc[at]}' of "
            f"'{factor}', which is not rated; leave the row out, or set rate_itself = true"
        )


def _check_scale(scale: RatedScale, rows: pd.DataFrame, source: str) -> None:
    given = rows["response"].to_numpy()
    steps = (given - scale.minimum) / scale.step
    off = (given < scale.minimum) | (given > scale.maximum) | (np.abs(steps - np.round(steps)) > 1e-6)
    if off.any():  # an empty answer is off nothing: comparisons with NaN are false
        at = int(np.argmax(off))
        rating = "a whole rating" if scale.step == 1 else f"a rating in steps of {scale.step:g}"
        raise InputError(
            f"{source}: {where(rows, at)}: expected {rating} from {scale.minimum:g} to {scale.maximum:g}, "
            f"got {given[at]:g}"
        )


def analyse_study(experiment: Experiment, answers: StudyAnswers, pool: Pool = Pool()) -> Analysis:
    """Check, exclude by the declared rules, average, and test; raises as `prepare`."""
    return analyse(prepare(experiment, PLAN, answers, pool))


def contents(prepared: Prepared) -> Contents:
    """What the report says."""
    reported = _ratings(prepared)
    if clip_rating_of(prepared.experiment).reference is None:
        return reported
    from analysis.plans.degradation import with_degradation

    return with_degradation(reported, prepared)


def _ratings(prepared: Prepared) -> Contents:
    from analysis.report.within_contents import contents_of

    if prepared.scale is not None:
        named = scale_called(prepared.experiment, prepared.scale)
        rows = on_scale(prepared.experiment, prepared.rows, named.name)
        if rows.empty:
            raise NoRatingsError(f"{prepared.source} has no ratings on the scale {named.name} yet")
        prepared = replace(prepared, exclusions=replace(prepared.exclusions, rows=rows))
        said = f"the scale {named.name} alone, of {len(scales_of(prepared.experiment))}"
        analysis = analyse(replace(prepared, decisions=(*prepared.decisions, said)), named.name)
        return contents_of(analysis, partial(further_sections, analysis, prepared))
    if len(scales_of(prepared.experiment)) > 1:
        from analysis.plans.several_scales import contents_of_scales

        return contents_of_scales(prepared)
    analysis = analyse(prepared)
    return contents_of(analysis, partial(further_sections, analysis, prepared))


PLAN = Plan(READING, check, contents, keys=("scale",))
