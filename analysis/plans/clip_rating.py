"""The analysis of single-clip ratings: cell means, their tests, and models beside them."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np
import pandas as pd

from analysis.errors import NoRatingsError
from analysis.plans.plan import Plan
from analysis.plans.prepare import Prepared, prepare, refuse_unknown, where
from analysis.plans.result import Analysis, analyse_cells, labels_of
from analysis.read.pool import Pool
from analysis.read.reading import Reading
from analysis.read.study_answers import StudyAnswers
from analysis.report.contents import Contents, Progress, Section
from analysis.within.anova import AnovaResult, linear_anova
from analysis.within.between import BetweenDesign, between_design, no_groups
from analysis.within.cell_means import CellTable, cell_table
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


def on_scale(experiment: Experiment, rows: pd.DataFrame, name: str) -> pd.DataFrame:
    """The rows of one scale: all of them where the study has one."""
    if len(scales_of(experiment)) == 1:
        return rows
    if "scale" not in rows.columns:
        raise InputError(f"'{experiment.name}' has several scales; the data have no column 'scale'")
    return rows[(rows["scale"] == name).to_numpy()]


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


class Tested(NamedTuple):
    """Cell means of prepared rows, and every effect."""

    cells: CellTable
    anova: AnovaResult


def tested(prepared: Prepared) -> Tested:
    """Average and test, and no more: what each choice of a multiverse needs."""
    cells, design = _averaged(prepared)
    return Tested(
        cells, linear_anova(cells.y, cells.factors, cells.levels, design or no_groups(len(cells.y)))
    )


def _averaged(prepared: Prepared) -> tuple[CellTable, BetweenDesign | None]:
    """Cell means, and the groups where the design has some."""
    experiment, rows = prepared.experiment, prepared.rows
    factors = experiment.compared_factors
    levels = {f.name: rated_levels(experiment, f.name) for f in experiment.factors}
    within = [name for name in factors if not experiment.factor(name).between]
    cells = cell_table(rows, "participant", "response", within, levels)
    between = [name for name in factors if name not in within]
    return cells, groups_of(rows, cells.participants, between, levels) if between else None


def analyse(prepared: Prepared, rating: str = "response") -> Analysis:
    """Average and test; `rating` names what was rated."""
    experiment = prepared.experiment
    cells, groups = _averaged(prepared)
    return analyse_cells(
        cells,
        name=experiment.name,
        title=experiment.title,
        source=prepared.source,
        rating=rating,
        synthetic=prepared.synthetic,
        decisions=prepared.decisions,
        labels=labels_of(experiment),
        between=groups,
        experiment=experiment,
        exclusions=prepared.exclusions,
    )


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


def further_sections(analysis: Analysis, prepared: Prepared, progress: Progress) -> tuple[Section, ...]:
    """Sensitivity analyses and the multiverse of one scale: the one `prepared` names, or the only one."""
    from analysis.plans.multiverse import multiverse_section
    from analysis.plans.sensitivity import sensitivity_sections

    sections = sensitivity_sections(analysis, progress)
    progress("multiverse of exclusions")
    return (*sections, multiverse_section(analysis, prepared, _tested_named))


def _tested_named(prepared: Prepared) -> Tested:
    """The tests of one scale: the named one, or the only one."""
    if prepared.scale is None:
        return tested(prepared)
    rows = on_scale(prepared.experiment, prepared.rows, prepared.scale)
    return tested(replace(prepared, exclusions=replace(prepared.exclusions, rows=rows)))


def groups_of(
    rows: pd.DataFrame,
    participants: Sequence[str],
    factors: Sequence[str],
    levels: Mapping[str, Sequence[str]],
) -> BetweenDesign:
    """The groups of these participants; InputError where one has rows of two."""
    codes = np.zeros((len(participants), len(factors)), np.int64)
    for column, name in enumerate(factors):
        level_of: dict[str, str] = {}
        pairs = rows[["participant", name]].astype(str).drop_duplicates()
        for participant, level in pairs.itertuples(index=False):
            if level_of.setdefault(participant, level) != level:
                raise InputError(
                    f"participant {participant} has ratings of '{level_of[participant]}' and '{level}', but "
                    f"'{name}' is declared between participants"
                )
        codes[:, column] = [levels[name].index(level_of[participant]) for participant in participants]
    return between_design(factors, [levels[name] for name in factors], codes)


PLAN = Plan(READING, check, contents, keys=("scale",))
