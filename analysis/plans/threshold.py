"""The analysis of thresholds: a psychometric function for each series and person, and series compared."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import pandas as pd
from scipy import stats
from statsmodels.stats.multitest import multipletests

from analysis.plans.plan import Plan
from analysis.plans.prepare import Prepared, refuse_unknown, where
from analysis.plans.result import labels_of
from analysis.read.reading import Reading
from analysis.report.contents import Contents
from analysis.thresholds.likelihood import Trials
from analysis.thresholds.people import Answers, ThresholdsResult, counted, fit_thresholds
from experiments.definition import Experiment
from experiments.errors import InputError
from experiments.trials.threshold.answer import CODES
from experiments.trials.threshold.columns import THRESHOLDS
from experiments.trials.threshold.declaration import Threshold, YesNo, threshold_of
from experiments.trials.threshold.grid import series_of

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
    """Thresholds of two series compared within people (paired t); p corrected by Holm over all pairs."""

    first: str
    second: str
    people: int
    difference: float
    ci_low: float
    ci_high: float
    t: float
    df: int
    p: float
    p_holm: float


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
    from analysis.report.threshold_contents import contents_of

    fits = fits_of(prepared)
    return contents_of(prepared, fits, differences(fits))


def series_labels(experiment: Experiment) -> dict[str, str]:
    """Labels of the series: those of their levels, or their names."""
    labels = labels_of(experiment)
    return {
        series.name: ", ".join(labels.level(factor, level) for factor, level in series.levels.items())
        or series.name
        for series in series_of(experiment)
    }


def fits_of(prepared: Prepared) -> tuple[SeriesFit, ...]:
    """The fits of every series that has answers, in declared order."""
    trial, labels = threshold_of(prepared.experiment), series_labels(prepared.experiment)
    rows = prepared.rows
    seen = (rows["said"] == "yes").to_numpy()
    if not isinstance(trial.task, YesNo):
        seen = (rows["said"] == rows["interval"].astype(str)).to_numpy()
    fits = []
    for name, label in labels.items():
        mine = (rows["series"] == name).to_numpy()
        if mine.any():
            people = rows["participant"].astype(str).to_numpy(dtype=object)[mine]
            x, y = rows["value"].to_numpy(dtype=float)[mine], seen[mine].astype(float)
            answers = Answers(x, y, people, None, prepared.source, prepared.synthetic, ())
            fits.append(_fit(name, label, answers, trial))
    return tuple(fits)


def _fit(name: str, label: str, answers: Answers, trial: Threshold) -> SeriesFit:
    trials, falling = counted(answers.x, answers.response), trial.direction == "falling"
    try:
        result = fit_thresholds(answers, trial.function, trial.task.guess, trial.lapse, falling)
    except InputError as error:
        return SeriesFit(name, label, trials, None, str(error).removeprefix(f"{answers.source}: "))
    return SeriesFit(name, label, trials, result, None)


def differences(fits: tuple[SeriesFit, ...]) -> tuple[Difference, ...]:
    """Paired t tests between series, over the people who have a threshold in both."""
    made = []
    for one, other in combinations(fits, 2):
        first, second = _thresholds(one), _thresholds(other)
        both = sorted(first.keys() & second.keys())
        gaps = np.array([first[who] - second[who] for who in both])
        if len(both) < 2 or not np.ptp(gaps) > 0:
            continue
        test = stats.ttest_1samp(gaps, 0.0)
        low, high = test.confidence_interval(0.95)
        numbers = (float(gaps.mean()), float(low), float(high), float(test.statistic), len(both) - 1)
        made.append((one.label, other.label, len(both), *numbers, float(test.pvalue)))
    holm = multipletests([row[-1] for row in made], method="holm")[1].tolist() if made else []
    return tuple(Difference(*row, p) for row, p in zip(made, holm, strict=True))


def _thresholds(series: SeriesFit) -> Mapping[str, float]:
    people = () if series.result is None else series.result.people
    return {one.participant: one.fit.threshold for one in people if one.fit is not None}


PLAN = Plan(READING, check, analyse, numbered)
