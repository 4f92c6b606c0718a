"""The results of a study as data arrive."""

from bisect import bisect_right
from collections import Counter, defaultdict
from collections.abc import Sequence
from datetime import datetime
from itertools import combinations
from typing import TypedDict

from sqlalchemy.orm import Session

from experiments.declaration.trial import RatedScale
from experiments.kinds import scale_called, scales_of
from server.core.values import now
from server.models import Study, StudyVersion
from server.participation.tallies import RT_MS
from server.participation.tally_pools import PooledTally, pooled_tally
from server.results import summary
from server.results.repository import Pool, clips_of
from server.results.schemas import (
    CellResult,
    ClipResult,
    Margin,
    Mean,
    Playback,
    Results,
    ResultScale,
    TimeBin,
)
from server.studies.lookup import definition_of

MAX_BINS = 20
ROUNDING = 1e-9
"""An answer on a step may lie a rounding error below it."""


def pool(study: Study, version: StudyVersion, origin: str, scale: str | None) -> Pool:
    """The answers that results are of, on the first scale where none is named; InputError for none such.

    Kinds that are not rated on scales have the empty name.
    """
    definition = definition_of(version)
    name = scale_called(definition, scale).name if scale is not None or scales_of(definition) else ""
    return Pool(study.id, origin, version.series, name)


def results(session: Session, study: Study, version: StudyVersion, of: Pool) -> Results:
    """Means, distributions, response times and playback of one pool, which is of the series of `version`."""
    definition = definition_of(version)
    scale = scale_called(definition, of.scale)
    bins = bins_of(scale)
    factors = list(definition.factor_names)
    tally = pooled_tally(session, of.runs(), of.scale, factors)
    clips = _clips(session, version, tally, bins, scale.maximum)
    return Results(
        **common_results(study, version, of, tally),
        ratings=sum(clip.ratings for clip in clips),
        scales=[_scale_out(one) for one in scales_of(definition)],
        scale=_scale_out(scale),
        bins=bins,
        # A participant has only some levels of a dealt factor, as of one between participants.
        margins=margins(
            tally.means, factors, [one.name for one in definition.factors if one.between or one.dealt]
        ),
        cells=_cells(clips),
        clips=clips,
    )


class Common(TypedDict):
    """What the results of every kind of trial begin with."""

    study: str
    origin: str
    series: int
    counted_at: datetime
    participants: int
    response_times: list[TimeBin]
    playback: Playback


def common_results(study: Study, version: StudyVersion, of: Pool, tally: PooledTally) -> Common:
    """What the tallies say of a pool, whatever its kind of trial."""
    return {
        "study": study.name,
        "origin": of.origin,
        "series": version.series,
        "counted_at": now(),
        "participants": len(tally.means),
        "response_times": time_bins(tally),
        "playback": playback_of(tally),
    }


def margins(means: summary.CellMeans, factors: list[str], between: Sequence[str] = ()) -> list[Margin]:
    """Every factor, every pair of factors, and the cells where there are more than two factors."""
    people = summary.raters_of_same_cells(means)
    kept = [list(chosen) for size in (1, 2) for chosen in combinations(factors, size)]
    if len(factors) > 2:
        kept.append(factors)
    return [
        Margin(
            factors=keep,
            means=[Mean.model_validate(vars(one)) for one in summary.margin(people, factors, keep, between)],
        )
        for keep in kept
    ]


def bins_of(scale: RatedScale) -> list[float]:
    """Lowest answer of each count: every answer there is, or twenty equal parts where there are more."""
    steps = round((scale.maximum - scale.minimum) / scale.step)
    count, width = (steps + 1, scale.step) if steps <= MAX_BINS else (MAX_BINS, steps * scale.step / MAX_BINS)
    return [scale.minimum + index * width for index in range(count)]


def _scale_out(scale: RatedScale) -> ResultScale:
    return ResultScale(
        name=scale.name,
        type=scale.type,
        minimum=scale.minimum,
        maximum=scale.maximum,
        reverse=scale.reverse,
    )


def _clips(
    session: Session, version: StudyVersion, tally: PooledTally, bins: list[float], highest: float
) -> list[ClipResult]:
    counts: dict[int, list[int]] = defaultdict(lambda: [0] * len(bins))
    sums: dict[int, float] = defaultdict(float)
    for (clip, _, response), number in tally.answers.items():
        if bins[0] <= response <= highest:
            counts[clip][bisect_right(bins, response + ROUNDING) - 1] += number
            sums[clip] += response * number
    shown = {row.id: row for row in clips_of(session, version, counts)}
    return [
        ClipResult(
            clip_sha256=row.clip_sha256,
            file=row.file,
            cell=row.cell,
            exemplar=row.exemplar,
            ratings=sum(counts[number]),
            mean=sums[number] / sum(counts[number]) if sum(counts[number]) else None,
            counts=counts[number],
        )
        for number, row in sorted(shown.items())
    ]


def _cells(clips: list[ClipResult]) -> list[CellResult]:
    grouped: dict[str, list[ClipResult]] = defaultdict(list)
    for clip in clips:
        grouped[clip.cell].append(clip)
    return [
        CellResult(
            cell=cell,
            ratings=sum(clip.ratings for clip in members),
            mean=_weighted_mean(members),
            counts=[sum(column) for column in zip(*(clip.counts for clip in members), strict=True)],
        )
        for cell, members in grouped.items()
    ]


def _weighted_mean(clips: list[ClipResult]) -> float | None:
    total = sum(clip.ratings for clip in clips)
    return sum(clip.ratings * clip.mean for clip in clips if clip.mean is not None) / total if total else None


def time_bins(tally: PooledTally) -> list[TimeBin]:
    """Response times in bins of 250 ms."""
    return [TimeBin(start_ms=RT_MS * index, answers=n) for index, n in sorted(tally.times.items())]


def playback_of(tally: PooledTally) -> Playback:
    """How the clips were shown."""
    counts: tuple[Counter[str], ...] = (Counter(), Counter(), Counter())
    for words, number in tally.plays.items():
        for count, word in zip(counts, words, strict=True):
            count[word] += number if word else 0
    verdicts, methods, rules = (dict(sorted((+count).items())) for count in counts)
    return Playback(verdicts=verdicts, methods=methods, rules=rules, key_to_first_frame_ms=tally.onsets)
