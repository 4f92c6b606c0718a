"""Adaptive series: the answers at each stimulus, and the thresholds that people's series led to."""

import math
from collections.abc import Mapping, Sequence
from statistics import fmean

from sqlalchemy.orm import Session

from experiments import design
from experiments.declaration.experiment import Experiment
from experiments.declaration.threshold import Series, TwoInterval, threshold_of
from experiments.kinds.threshold_grid import Point, model, seconds, series_of
from server.models import Study, StudyVersion
from server.participation.quest import Tilt, tilt
from server.participation.tally_pools import pooled_tally
from server.results.repository import (
    LatestEstimate,
    PersonCount,
    Pool,
    StimulusCount,
    latest_estimates,
    person_counts,
    stimulus_counts,
)
from server.results.schemas import MeanTilt, SeriesResult, StimulusAnswers, ThresholdResults
from server.results.service import common_results
from server.results.summary import half_width
from server.studies.lookup import definition_of


def summarise(session: Session, study: Study, version: StudyVersion, of: Pool) -> ThresholdResults:
    """The series of one pool, which is of the data series of `version`.

    Which series an answer belongs to is known to its own row alone: tallies count answers by clip, and two
    series may show the same clips. So answers come from there, and all else from the tallies.
    """
    definition = definition_of(version)
    declared, tally = threshold_of(definition), pooled_tally(session, of.runs(), "", ())
    counts, estimates = stimulus_counts(session, of), latest_estimates(session, of)
    second = declared.stimulus.second
    tilts = mean_tilts(definition, person_counts(session, of)) if second else {}
    return ThresholdResults(
        **common_results(study, version, of, tally),
        ratings=tally.answers.total(),
        factor=declared.stimulus.factor,
        second_factor=second.factor if second else None,
        second_middle=model(definition).middle if second else None,
        two_interval=isinstance(declared.task, TwoInterval),
        series_results=[
            series_result(one, counts, estimates, second_by_cell(definition), tilts.get(one.name))
            for one in series_of(definition)
        ],
    )


def second_by_cell(definition: Experiment) -> dict[str, float]:
    """The number along the second factor of each cell's clips; empty where series move along one."""
    second = threshold_of(definition).stimulus.second
    if second is None:
        return {}
    numbers = {level: number for number, level in seconds(definition).items()}
    clips = design.clips(definition)
    return {clip.cell: numbers[clip.level(second.factor)] for clip in clips}


def series_result(
    one: Series,
    counts: Sequence[StimulusCount],
    estimates: Sequence[LatestEstimate],
    seconds_of: Mapping[str, float],
    tilt: MeanTilt | None,
) -> SeriesResult:
    """What is known of a series: counts and estimates are those of all series, thresholds ascending."""
    stimuli = [
        StimulusAnswers(value=value, second=second, n=n, positive=positive)
        for (value, second), (n, positive) in _by_stimulus(one, counts, seconds_of).items()
    ]
    mine = [row for row in estimates if row.series == one.name]
    thresholds = [row.threshold for row in mine]
    mean = math.fsum(thresholds) / len(thresholds) if thresholds else None
    return SeriesResult(
        name=one.name,
        levels=dict(one.levels),
        people=len(mine),
        answers=sum(row.n for row in stimuli),
        mean=mean,
        sd=_sd(thresholds),
        mean_posterior_sd=math.fsum(row.threshold_sd for row in mine) / len(mine) if mine else None,
        stimuli=stimuli,
        thresholds=thresholds,
        tilt=tilt,
    )


def mean_tilts(definition: Experiment, counts: Sequence[PersonCount]) -> dict[str, MeanTilt]:
    """The mean tilt of each series that has answers."""
    assumed, seconds_of = model(definition), second_by_cell(definition)
    people: dict[tuple[str, int], dict[Point, tuple[int, int]]] = {}
    for row in counts:
        mine = people.setdefault((row.series, row.run), {})
        point = Point(row.value, seconds_of[row.cell])
        n, positive = mine.get(point, (0, 0))
        mine[point] = (n + row.n, positive + row.positive)
    by_series: dict[str, list[Tilt]] = {}
    for (series, _), mine in people.items():
        by_series.setdefault(series, []).append(tilt(assumed, mine))
    return {series: _mean_tilt(tilts) for series, tilts in by_series.items()}


def _mean_tilt(tilts: Sequence[Tilt]) -> MeanTilt:
    means = [one.mean for one in tilts]
    mean, half = fmean(means), half_width(means) if len(means) > 1 else None
    return MeanTilt(
        people=len(tilts),
        mean=mean,
        sd=_sd(means),
        low=None if half is None else mean - half,
        high=None if half is None else mean + half,
        mean_posterior_sd=fmean(one.sd for one in tilts),
    )


def _by_stimulus(
    one: Series, counts: Sequence[StimulusCount], seconds_of: Mapping[str, float]
) -> dict[tuple[float, float | None], tuple[int, int]]:
    """Number of answers and of positive ones: clips of several cells are one stimulus where numbers agree."""
    sums: dict[tuple[float, float | None], tuple[int, int]] = {}
    for row in counts:
        if row.series == one.name:
            stimulus = (row.value, seconds_of.get(row.cell))
            n, positive = sums.get(stimulus, (0, 0))
            sums[stimulus] = (n + row.n, positive + row.positive)
    return sums


def _sd(values: Sequence[float]) -> float | None:
    """With n - 1 below; None of fewer than two."""
    if len(values) < 2:
        return None
    mean = math.fsum(values) / len(values)
    return math.sqrt(math.fsum((value - mean) ** 2 for value in values) / (len(values) - 1))
