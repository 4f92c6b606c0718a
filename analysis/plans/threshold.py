"""The analysis of thresholds: a psychometric function for each series and person, and series compared."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import stats

from analysis.plans.plan import Plan
from analysis.plans.prepare import Prepared, refuse_unknown, where
from analysis.plans.result import labels_of
from analysis.read.reading import Reading
from analysis.report.contents import Contents
from analysis.thresholds.likelihood import Trials
from analysis.thresholds.people import Answers, ThresholdsResult, counted, fit_thresholds
from analysis.within.adjustments import holm
from experiments.definition import Experiment
from experiments.errors import InputError
from experiments.trials.threshold.answer import CODES
from experiments.trials.threshold.columns import THRESHOLDS
from experiments.trials.threshold.declaration import Threshold, YesNo, threshold_of
from experiments.trials.threshold.grid import seconds, series_of

READING = Reading(THRESHOLDS, texts=("response", "series", "interval"), numbers=("value",))


@dataclass(frozen=True)
class SeriesFit:
    """One series: its trials by stimulus, and its fits; `result` is None where `reason` says why not."""

    name: str
    label: str
    trials: Trials
    result: ThresholdsResult | None
    reason: str | None


@dataclass(frozen=True)
class Difference:
    """An estimate of two series compared; p corrected by Holm over all pairs of series.

    Within people by a paired t test; between groups of people by Welch's, whose df are no whole number.
    """

    first: str
    second: str
    people: int
    difference: float
    ci_low: float
    ci_high: float
    t: float
    df: float
    p: float
    p_holm: float
    what: str = "threshold"


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


def series_labels(experiment: Experiment) -> dict[str, str]:
    """Labels of the series: those of their levels, or their names."""
    labels = labels_of(experiment)
    return {
        series.name: ", ".join(labels.level(factor, level) for factor, level in series.levels.items())
        or series.name
        for series in series_of(experiment)
    }


def answers_of(prepared: Prepared) -> dict[str, Answers]:
    """The answers of every series that has some, by name in declared order; 1 is yes, or right."""
    trial, rows = threshold_of(prepared.experiment), prepared.rows
    seen = (rows["said"] == "yes").to_numpy()
    if not isinstance(trial.task, YesNo):
        seen = (rows["said"] == rows["interval"].astype(str)).to_numpy()
    across = _seconds(prepared)
    made = {}
    for one in series_of(prepared.experiment):
        mine = (rows["series"] == one.name).to_numpy()
        if mine.any():
            made[one.name] = Answers(
                rows["value"].to_numpy(dtype=float)[mine],
                seen[mine].astype(float),
                rows["participant"].astype(str).to_numpy(dtype=object)[mine],
                None,
                prepared.source,
                prepared.synthetic,
                (),
                None if across is None else across[mine],
            )
    return made


def _seconds(prepared: Prepared) -> NDArray[np.float64] | None:
    """The number along the second factor of each row; None where there is none."""
    second = threshold_of(prepared.experiment).stimulus.second
    if second is None:
        return None
    number = {level: value for value, level in seconds(prepared.experiment).items()}
    refuse_unknown(prepared.rows, second.factor, list(number), f"level of {second.factor}", prepared.source)
    return np.asarray(prepared.rows[second.factor].map(number), dtype=np.float64)


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


def differences(
    series: Sequence[tuple[str, Mapping[str, float]]], what: str = "threshold"
) -> tuple[Difference, ...]:
    """The estimates by person of every two series compared, in pairs where the same people have both."""
    made = [row for one, other in combinations(series, 2) if (row := _compared(one, other)) is not None]
    corrected = holm(np.array([row[-1] for row in made])).tolist() if made else []
    return tuple(Difference(*row, p, what) for row, p in zip(made, corrected, strict=True))


def _compared(
    one: tuple[str, Mapping[str, float]], other: tuple[str, Mapping[str, float]]
) -> tuple[str, str, int, float, float, float, float, float, float] | None:
    """Labels, people, difference with its interval, t, df and p; None where too few people say too little."""
    (label, first), (other_label, second) = one, other
    both = sorted(first.keys() & second.keys())
    if both:
        gaps = np.array([first[name] - second[name] for name in both])
        if len(both) < 2 or not np.ptp(gaps) > 0:
            return None
        test: Any = stats.ttest_1samp(gaps, 0.0)
        people, difference = len(both), float(gaps.mean())
    else:
        a, b = np.array(list(first.values())), np.array(list(second.values()))
        if min(a.size, b.size) < 2 or not np.ptp(a) + np.ptp(b) > 0:
            return None
        test = stats.ttest_ind(a, b, equal_var=False)
        people, difference = a.size + b.size, float(a.mean() - b.mean())
    low, high = test.confidence_interval(0.95)
    numbers = (difference, float(low), float(high), float(test.statistic), float(test.df))
    return (label, other_label, people, *numbers, float(test.pvalue))


def _thresholds(series: SeriesFit) -> Mapping[str, float]:
    people = () if series.result is None else series.result.people
    return {one.participant: one.fit.threshold for one in people if one.fit is not None}


PLAN = Plan(READING, check, analyse, numbered)
