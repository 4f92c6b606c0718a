"""Adaptive series: the answers at each stimulus, and the thresholds that people's series led to."""

import math
from collections.abc import Sequence

from sqlalchemy.orm import Session

from experiments.trials.threshold.declaration import Series, TwoInterval, threshold_of
from experiments.trials.threshold.grid import series_of
from server.clock import now
from server.models import Study, StudyVersion
from server.results.repository import (
    LatestEstimate,
    Pool,
    StimulusCount,
    latest_estimates,
    stimulus_counts,
)
from server.results.schemas import SeriesResult, StimulusAnswers, ThresholdResults
from server.results.service import playback_of, time_bins
from server.studies.lookup import definition_of
from server.tallies.pools import pooled


def summarise(session: Session, study: Study, version: StudyVersion, of: Pool) -> ThresholdResults:
    """The series of one pool, which is of the data series of `version`.

    Which series an answer belongs to is known to its own row alone: tallies count answers by clip, and two
    series may show the same clips. So answers come from there, and all else from the tallies.
    """
    definition = definition_of(version)
    declared, tally = threshold_of(definition), pooled(session, of.runs(), "", ())
    counts, estimates = stimulus_counts(session, of), latest_estimates(session, of)
    return ThresholdResults(
        study=study.name,
        origin=of.origin,
        series=version.series,
        counted_at=now(),
        participants=len(tally.means),
        ratings=tally.answers.total(),
        factor=declared.stimulus.factor,
        two_interval=isinstance(declared.task, TwoInterval),
        series_results=[series_result(one, counts, estimates) for one in series_of(definition)],
        response_times=time_bins(tally),
        playback=playback_of(tally),
    )


def series_result(
    one: Series, counts: Sequence[StimulusCount], estimates: Sequence[LatestEstimate]
) -> SeriesResult:
    """What is known of a series: counts and estimates are those of all series, thresholds ascending."""
    stimuli = [
        StimulusAnswers(value=row.value, n=row.n, positive=row.positive)
        for row in counts
        if row.series == one.name
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
    )


def _sd(values: Sequence[float]) -> float | None:
    """With n - 1 below; None of fewer than two."""
    if len(values) < 2:
        return None
    mean = math.fsum(values) / len(values)
    return math.sqrt(math.fsum((value - mean) ** 2 for value in values) / (len(values) - 1))
