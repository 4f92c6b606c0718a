"""The answers of a threshold study, by series."""

import numpy as np
from numpy.typing import NDArray

from analysis.plans.prepare import refuse_unknown
from analysis.plans.prepared import Prepared
from analysis.plans.result import labels_of
from analysis.thresholds.answers import Answers
from experiments.definition import Experiment
from experiments.trials.threshold.declaration import YesNo, threshold_of
from experiments.trials.threshold.grid import seconds, series_of


def series_labels(experiment: Experiment) -> dict[str, str]:
    """Labels of the series: those of their levels, or their names in words."""
    labels = labels_of(experiment)
    return {
        series.name: ", ".join(labels.level(factor, level) for factor, level in series.levels.items())
        or series.name.replace("_", " ")
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
