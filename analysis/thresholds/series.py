"""Series of trials: what was fitted to each, and two series compared."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
from scipy import stats

from analysis.thresholds.likelihood import Trials
from analysis.thresholds.people import ThresholdsResult
from analysis.within.adjustments import holm


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
