"""The analysis of a declared experiment: its ratings, its exclusion rules, its tests."""

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from analysis.errors import NoRatingsError
from analysis.plans.exclusions import Exclusions, apply_exclusions
from analysis.plans.result import Analysis, Labels, analyse_cells
from analysis.read.pool import Pool, pooled
from analysis.read.study_ratings import StudyRatings
from analysis.within.between import BetweenDesign, between_design
from analysis.within.cell_means import cell_table
from experiments.definition import Experiment
from experiments.errors import InputError, did_you_mean
from experiments.trials.clip_rating.declaration import clip_rating_of


def analyse_study(experiment: Experiment, ratings: StudyRatings, pool: Pool = Pool()) -> Analysis:
    """Check, exclude by the declared rules, average, and test.

    Raises
    ------
    NoRatingsError
        No main trial of this origin, or nobody left after exclusion.
    InputError
        A rating off the declared scale, an unknown level, a trial stored twice with different data.
    """
    chosen, pooling = pooled(ratings.rows, pool, ratings.source)
    rows, repeats = _without_repeats(chosen, ratings.source)
    _check(experiment, rows, ratings.source)
    checked = StudyRatings(rows, ratings.source, (*ratings.decisions, *pooling), ratings.first_seen)
    exclusions = apply_exclusions(experiment, checked)
    _refuse_nobody(exclusions, ratings.source, pool)
    factors = experiment.analysis.factors or experiment.factor_names
    levels = {f.name: [level.name for level in f.levels] for f in experiment.factors}
    within = [name for name in factors if not experiment.factor(name).between]
    cells = cell_table(exclusions.rows, "participant", "response", within, levels)
    between = [name for name in factors if name not in within]
    return analyse_cells(
        cells,
        name=experiment.name,
        title=experiment.title,
        source=ratings.source,
        rating="response",
        synthetic=checked.synthetic,
        decisions=(*checked.decisions, *repeats),
        labels=labels_of(experiment),
        between=groups_of(exclusions.rows, cells.participants, between, levels) if between else None,
        experiment=experiment,
        exclusions=exclusions,
    )


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
        for who, level in pairs.itertuples(index=False):
            if level_of.setdefault(who, level) != level:
                raise InputError(
                    f"participant {who} has ratings of '{level_of[who]}' and '{level}', but '{name}' is "
                    "declared between participants"
                )
        codes[:, column] = [levels[name].index(level_of[who]) for who in participants]
    return between_design(factors, [levels[name] for name in factors], codes)


def labels_of(experiment: Experiment) -> Labels:
    """The labels an experiment declares."""
    return Labels(
        factors={f.name: f.label for f in experiment.factors},
        levels={(f.name, level.name): level.label for f in experiment.factors for level in f.levels},
    )


def _main(rows: pd.DataFrame) -> pd.DataFrame:
    return rows[(rows["kind"] == "main").to_numpy()] if "kind" in rows.columns else rows


def _where(rows: pd.DataFrame, position: int) -> str:
    row = rows.iloc[position]
    trial = f", trial {row['trial_index']:g}" if "trial_index" in rows.columns else ""
    return f"participant {row['participant']}{trial}"


def _check(experiment: Experiment, rows: pd.DataFrame, source: str) -> None:
    main = _main(rows)
    scale = clip_rating_of(experiment).scale
    given = main["response"].to_numpy()
    off = ~np.isnan(given) & ((given < scale.minimum) | (given > scale.maximum) | (given != np.round(given)))
    if off.any():
        at = int(np.argmax(off))
        raise InputError(
            f"{source}: {_where(main, at)}: expected a whole rating from {scale.minimum} to {scale.maximum}, "
            f"got {given[at]:g}"
        )
    if (main["participant"] == "").any():
        raise InputError(f"{source}: 'participant' is empty in {(main['participant'] == '').sum()} rows")
    for factor in experiment.factors:
        known = [level.name for level in factor.levels]
        column = main[factor.name]
        for name in pd.unique(column):
            if name not in known:
                at = int(np.argmax((column == name).to_numpy()))
                raise InputError(
                    f"{source}: {_where(main, at)}: '{name}' is no level of '{factor.name}'"
                    f"{did_you_mean(str(name), known)}"
                )


def _without_repeats(rows: pd.DataFrame, source: str) -> tuple[pd.DataFrame, tuple[str, ...]]:
    """Count a trial stored twice once where its data agree; refuse it where they do not."""
    if "trial_index" not in rows.columns:
        return rows, ()
    who = "run" if "run" in rows.columns else "participant"
    keys = [who, "trial_index", *(["play"] if "play" in rows.columns else [])]
    again = rows.duplicated(keys).to_numpy()
    if not again.any():
        return rows, ()
    differ = again & ~rows.duplicated().to_numpy()
    if differ.any():
        raise InputError(
            f"{source}: {_where(rows, int(np.argmax(differ)))} stands there twice with different data; "
            "remove the wrong row"
        )
    return rows[~again], (f"{again.sum()} repeated rows of trials already there, counted once",)


def _refuse_nobody(exclusions: Exclusions, source: str, pool: Pool) -> None:
    if not exclusions.n_runs:
        aside = f" (set aside: {'; '.join(exclusions.set_aside)})" if exclusions.set_aside else ""
        wanted = f" of origin '{pool.origin}'" if pool.origin else ""
        raise NoRatingsError(f"{source} has no ratings{wanted} yet{aside}")
    if exclusions.rows.empty:
        who = "; ".join(f"{run.participant} ({', '.join(run.reasons)})" for run in exclusions.runs[:5])
        raise NoRatingsError(f"{source}: no participant remains after the declared exclusions: {who}")
