"""The analysis of thresholds: a psychometric function for each series and person, and series compared."""

from collections.abc import Mapping

import numpy as np
import pandas as pd

from analysis.plans.plan import Plan, PlanRows, refuse_unknown, where
from analysis.read.reading import Reading
from analysis.report.contents import Contents
from analysis.thresholds.answers import Answers, count_trials
from analysis.thresholds.people import fit_thresholds
from analysis.thresholds.plane_people import SeriesPlane, fit_planes, points_of
from analysis.thresholds.series import Difference, SeriesFit, answers_of, differences, series_labels
from experiments.declaration.experiment import Experiment
from experiments.declaration.threshold import CODES, Threshold, YesNo, threshold_of
from experiments.errors import InputError
from experiments.kinds.threshold import THRESHOLDS
from experiments.kinds.threshold_grid import model, series_of

READING = Reading(THRESHOLDS, texts=("response", "series", "interval"), numbers=("value",))


def number_answers(rows: pd.DataFrame) -> pd.DataFrame:
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
        raise InputError(f"{source}: {where(rows, at)}: expected the stimulus value in 'value', got none")


def analyse(prepared: PlanRows) -> Contents:
    """Every series over all people and of each person, and series compared."""
    if threshold_of(prepared.experiment).stimulus.second:
        return analyse_planes(prepared)
    from analysis.report.threshold_contents import contents_of

    fits = fits_of(prepared)
    return contents_of(prepared, fits, differences([(fit.label, _thresholds(fit)) for fit in fits]))


def fits_of(prepared: PlanRows) -> tuple[SeriesFit, ...]:
    """The fits of every series that has answers, in declared order."""
    trial, labels = threshold_of(prepared.experiment), series_labels(prepared.experiment)
    return tuple(_fit(name, labels[name], answers, trial) for name, answers in answers_of(prepared).items())


def _fit(name: str, label: str, answers: Answers, trial: Threshold) -> SeriesFit:
    trials, falling = count_trials(answers.x, answers.response), trial.direction == "falling"
    try:
        result = fit_thresholds(answers, trial.function, trial.task.guess, trial.lapse, falling)
    except InputError as error:
        return SeriesFit(name, label, trials, None, str(error).removeprefix(f"{answers.source}: "))
    return SeriesFit(name, label, trials, result, None)


def _thresholds(series: SeriesFit) -> Mapping[str, float]:
    people = () if series.result is None else series.result.people
    return {one.participant: one.fit.threshold for one in people if one.fit is not None}


PLAN = Plan(READING, check, analyse, number_answers)


# The analysis of thresholds over two factors: a function with a line of thresholds for each series.


def analyse_planes(prepared: PlanRows) -> Contents:
    """Every series over all people and of each person; thresholds and tilts of series compared."""
    from analysis.report.plane_contents import contents_of

    trial, labels = threshold_of(prepared.experiment), series_labels(prepared.experiment)
    # The declared middle, as the server has it: series that lack a level are compared with the others.
    middle = model(prepared.experiment).middle
    fits = tuple(
        _fit_plane(name, labels[name], mine, trial, middle) for name, mine in answers_of(prepared).items()
    )
    compared: tuple[Difference, ...] = ()
    for what in ("threshold", "tilt"):
        compared += differences([(fit.label, _by_person(fit, what)) for fit in fits], what)
    return contents_of(prepared, fits, compared)


def _fit_plane(name: str, label: str, answers: Answers, trial: Threshold, middle: float) -> SeriesPlane:
    points, falling = points_of(answers), trial.direction == "falling"
    try:
        result = fit_planes(answers, "normal", trial.task.guess, trial.lapse, falling=falling, middle=middle)
    except InputError as error:
        return SeriesPlane(name, label, points, None, str(error).removeprefix(f"{answers.source}: "))
    return SeriesPlane(name, label, points, result, None)


def _by_person(series: SeriesPlane, what: str) -> Mapping[str, float]:
    people = () if series.result is None else series.result.people
    return {one.participant: getattr(one.fit, what) for one in people if one.fit is not None}
