"""Series of trials: what was fitted to each, and two series compared."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from analysis.plans.plan import PlanRows, refuse_unknown
from analysis.plans.result import labels_of
from analysis.thresholds.answers import Answers
from analysis.thresholds.likelihood import Trials
from analysis.thresholds.people import ThresholdsResult
from analysis.within.adjustments import holm
from experiments.declaration.experiment import Experiment
from experiments.declaration.threshold import YesNo, threshold_of
from experiments.kinds.threshold_grid import seconds, series_of


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

    Within people by a paired t test where more than half of the smaller series' people have both; else
    between groups of people by Welch's, without the `left_out` people who have both: their estimates are
    not independent.
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
    paired: bool
    left_out: int
    what: str = "threshold"


def differences(
    series: Sequence[tuple[str, Mapping[str, float]]], what: str = "threshold"
) -> tuple[Difference, ...]:
    """The estimates by person of every two series compared, in pairs where the same people have both."""
    made = [row for one, other in combinations(series, 2) if (row := _compared(one, other)) is not None]
    corrected = holm(np.array([row[-1] for _, row in made])).tolist() if made else []
    return tuple(Difference(*row, p, *how, what) for (how, row), p in zip(made, corrected, strict=True))


_Row = tuple[str, str, int, float, float, float, float, float, float]


def _compared(
    one: tuple[str, Mapping[str, float]], other: tuple[str, Mapping[str, float]]
) -> tuple[tuple[bool, int], _Row] | None:
    """Whether in pairs and people left out; labels, people, difference with its interval, t, df and p.

    None where too few people have an estimate.
    """
    (label, first), (other_label, second) = one, other
    both = sorted(first.keys() & second.keys())
    paired = 2 * len(both) > min(len(first), len(second))
    if paired:
        gaps = np.array([first[name] - second[name] for name in both])
        # Without variance the t test would divide by zero.
        if len(both) < 2 or not np.ptp(gaps) > 0:
            return None
        test: Any = stats.ttest_1samp(gaps, 0.0)
        people, difference = len(both), float(gaps.mean())
    else:
        a, b = (np.array([one[name] for name in one if name not in both]) for one in (first, second))
        if min(a.size, b.size) < 2 or not np.ptp(a) + np.ptp(b) > 0:
            return None
        test = stats.ttest_ind(a, b, equal_var=False)
        people, difference = a.size + b.size, float(a.mean() - b.mean())
    low, high = test.confidence_interval(0.95)
    numbers = (difference, float(low), float(high), float(test.statistic), float(test.df))
    return (paired, 0 if paired else len(both)), (label, other_label, people, *numbers, float(test.pvalue))


# The answers of a threshold study, by series.


def series_labels(experiment: Experiment) -> dict[str, str]:
    """Labels of the series: those of their levels, or their names in words."""
    labels = labels_of(experiment)
    return {
        series.name: ", ".join(labels.level(factor, level) for factor, level in series.levels.items())
        or series.name.replace("_", " ")
        for series in series_of(experiment)
    }


def answers_of(prepared: PlanRows) -> dict[str, Answers]:
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


def _seconds(prepared: PlanRows) -> NDArray[np.float64] | None:
    """The number along the second factor of each row; None where there is none."""
    second = threshold_of(prepared.experiment).stimulus.second
    if second is None:
        return None
    number = {level: value for value, level in seconds(prepared.experiment).items()}
    refuse_unknown(prepared.rows, second.factor, list(number), f"level of {second.factor}", prepared.source)
    return np.asarray(prepared.rows[second.factor].map(number), dtype=np.float64)
