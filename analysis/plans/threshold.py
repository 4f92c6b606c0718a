"""The analysis of thresholds: a psychometric function for each series and person, and series compared."""

from collections.abc import Mapping

import numpy as np
import pandas as pd

from analysis.plans.plan import Plan
from analysis.plans.prepare import refuse_unknown, where
from analysis.plans.prepared import Prepared
from analysis.plans.series_answers import answers_of, series_labels
from analysis.read.reading import Reading
from analysis.report.contents import Contents
from analysis.thresholds.answers import Answers, counted
from analysis.thresholds.people import fit_thresholds
from analysis.thresholds.series import SeriesFit, differences
from experiments.definition import Experiment
from experiments.errors import InputError
from experiments.trials.threshold.answer import CODES
from experiments.trials.threshold.columns import THRESHOLDS
from experiments.trials.threshold.declaration import Threshold, YesNo, threshold_of
from experiments.trials.threshold.grid import series_of

READING = Reading(THRESHOLDS, texts=("response", "series", "interval"), numbers=("value",))


def numbered(rows: pd.DataFrame) -> pd.DataFrame:
    """The answer's word as `said`, and its number as `response`."""
    words = rows["response"].astype(str)
    return rows.assign(said=words, response=words.map(CODES).astype(float))


def check(experiment: Experiment, rows: pd.DataFrame, source: str) -> None:
    """Refuse an answer that the task does not have, an unknown series, and an answer without a stimulus."""
    answers = ["yes", "no"] if isinstance(threshold_of(experiment).task, YesNo) else ["first", "second"]
    refuse_unknown(rows, "said", [*answers, "", "nan"], f"answer ({', '.join(answers)})", source)
    refuse_unknown(rows, "series", [series.name for series in series_of(experiment)], "series", source)
    bare = rows["response"].notna().to_numpy() & rows["value"].isna().to_numpy()
    if bare.any():
        at = int(np.argmax(bare))
        raise InputError(f"{source}: {where(rows, at)}: expected the stimulus's number in 'value', got none")


def analyse(prepared: Prepared) -> Contents:
    """Every series over all people and of each person, and series compared."""
    if threshold_of(prepared.experiment).stimulus.second:
        from analysis.plans.threshold_plane import analyse as analyse_plane

        return analyse_plane(prepared)
    from analysis.report.threshold_contents import contents_of

    fits = fits_of(prepared)
    return contents_of(prepared, fits, differences([(fit.label, _thresholds(fit)) for fit in fits]))


def fits_of(prepared: Prepared) -> tuple[SeriesFit, ...]:
    """The fits of every series that has answers, in declared order."""
    trial, labels = threshold_of(prepared.experiment), series_labels(prepared.experiment)
    return tuple(_fit(name, labels[name], answers, trial) for name, answers in answers_of(prepared).items())


def _fit(name: str, label: str, answers: Answers, trial: Threshold) -> SeriesFit:
    trials, falling = counted(answers.x, answers.response), trial.direction == "falling"
    try:
        result = fit_thresholds(answers, trial.function, trial.task.guess, trial.lapse, falling)
    except InputError as error:
        return SeriesFit(name, label, trials, None, str(error).removeprefix(f"{answers.source}: "))
    return SeriesFit(name, label, trials, result, None)


def _thresholds(series: SeriesFit) -> Mapping[str, float]:
    people = () if series.result is None else series.result.people
    return {one.participant: one.fit.threshold for one in people if one.fit is not None}


PLAN = Plan(READING, check, analyse, numbered)
