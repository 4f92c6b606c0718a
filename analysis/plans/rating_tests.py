"""Ratings of a study: cell means, their tests, and what is computed beside them."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pandas as pd

from analysis.plans.prepared import Prepared
from analysis.plans.result import Analysis, analyse_cells, labels_of
from analysis.report.contents import Progress, Section
from analysis.within.anova import AnovaResult, linear_anova
from analysis.within.between import BetweenDesign, between_design, no_groups
from analysis.within.cell_means import CellTable, cell_table
from experiments.definition import Experiment
from experiments.design import rated_levels
from experiments.errors import InputError
from experiments.trials.scales import scales_of


def on_scale(experiment: Experiment, rows: pd.DataFrame, name: str) -> pd.DataFrame:
    """The rows of one scale: all of them where the study has one."""
    if len(scales_of(experiment)) == 1:
        return rows
    if "scale" not in rows.columns:
        raise InputError(f"'{experiment.name}' has several scales; the data have no column 'scale'")
    return rows[(rows["scale"] == name).to_numpy()]


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


def further_sections(analysis: Analysis, prepared: Prepared, progress: Progress) -> tuple[Section, ...]:
    """Sensitivity analyses and the multiverse of one scale: the one `prepared` names, or the only one."""
    from analysis.plans.multiverse_section import multiverse_section
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
