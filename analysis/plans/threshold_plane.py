"""The analysis of thresholds over two factors: a function with a line of thresholds for each series."""

from collections.abc import Mapping

from analysis.plans.prepared import Prepared
from analysis.plans.series_answers import answers_of, series_labels
from analysis.report.contents import Contents
from analysis.thresholds.answers import Answers
from analysis.thresholds.plane_people import SeriesPlane, fit_planes, points_of
from analysis.thresholds.series import Difference, differences
from experiments.errors import InputError
from experiments.trials.threshold.declaration import Threshold, threshold_of
from experiments.trials.threshold.grid import model


def analyse(prepared: Prepared) -> Contents:
    """Every series over all people and of each person; thresholds and tilts of series compared."""
    from analysis.report.plane_contents import contents_of

    trial, labels = threshold_of(prepared.experiment), series_labels(prepared.experiment)
    # The declared middle, as the server has it: series that lack a level are compared with the others.
    middle = model(prepared.experiment).middle
    fits = tuple(_fit(name, labels[name], mine, trial, middle) for name, mine in answers_of(prepared).items())
    compared: tuple[Difference, ...] = ()
    for what in ("threshold", "tilt"):
        compared += differences([(fit.label, _by_person(fit, what)) for fit in fits], what)
    return contents_of(prepared, fits, compared)


def _fit(name: str, label: str, answers: Answers, trial: Threshold, middle: float) -> SeriesPlane:
    points, falling = points_of(answers), trial.direction == "falling"
    try:
        result = fit_planes(answers, "normal", trial.task.guess, trial.lapse, falling=falling, middle=middle)
    except InputError as error:
        return SeriesPlane(name, label, points, None, str(error).removeprefix(f"{answers.source}: "))
    return SeriesPlane(name, label, points, result, None)


def _by_person(series: SeriesPlane, what: str) -> Mapping[str, float]:
    people = () if series.result is None else series.result.people
    return {one.participant: getattr(one.fit, what) for one in people if one.fit is not None}
