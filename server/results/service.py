"""The results of a study as data arrive."""

from collections import Counter, defaultdict
from collections.abc import Sequence
from itertools import combinations

from sqlalchemy import select
from sqlalchemy.orm import Session

from experiments.trials.clip_rating.declaration import SCALE_NAME, clip_rating_of
from server.clock import now
from server.models import Study, StudyVersion, VersionClip
from server.results import summary
from server.results.repository import Pool
from server.results.schemas import CellResult, ClipResult, Margin, Mean, Playback, Results, TimeBin
from server.studies.lookup import definition_of
from server.tallies.pools import PooledTally, pooled
from server.tallies.tally import RT_MS


def results(session: Session, study: Study, version: StudyVersion, origin: str) -> Results:
    """Means, distributions, response times and playback of one origin and of the data series of `version`."""
    definition, of = definition_of(version), Pool(study.id, origin, version.series)
    scale = clip_rating_of(definition).scale
    factors = list(definition.factor_names)
    tally = pooled(session, of.runs(), SCALE_NAME, factors)
    clips = _clips(session, version, tally, scale.minimum, scale.maximum)
    return Results(
        study=study.name,
        origin=origin,
        series=version.series,
        counted_at=now(),
        participants=len(tally.means),
        ratings=sum(clip.ratings for clip in clips),
        scale_minimum=scale.minimum,
        scale_maximum=scale.maximum,
        margins=margins(
            tally.means, factors, [factor.name for factor in definition.factors if factor.between]
        ),
        cells=_cells(clips),
        clips=clips,
        response_times=time_bins(tally),
        playback=playback_of(tally),
    )


def margins(means: summary.CellMeans, factors: list[str], between: Sequence[str] = ()) -> list[Margin]:
    """Every factor, every pair of factors, and the cells where there are more than two factors."""
    people = summary.alike(means)
    wanted = [list(chosen) for size in (1, 2) for chosen in combinations(factors, size)]
    if len(factors) > 2:
        wanted.append(factors)
    return [
        Margin(
            factors=keep,
            means=[Mean.model_validate(vars(one)) for one in summary.margin(people, factors, keep, between)],
        )
        for keep in wanted
    ]


def _clips(
    session: Session, version: StudyVersion, tally: PooledTally, lowest: int, highest: int
) -> list[ClipResult]:
    counts: dict[int, list[int]] = defaultdict(lambda: [0] * (highest - lowest + 1))
    for (clip, _, response), number in tally.answers.items():
        if lowest <= response <= highest:
            counts[clip][int(response) - lowest] += number
    query = select(VersionClip).where(VersionClip.version_id == version.id)
    shown = {row.id: row for row in session.scalars(query)}
    older = set(counts) - set(shown)
    for row in session.scalars(select(VersionClip).where(VersionClip.id.in_(older))):
        shown[row.id] = row
    return [
        ClipResult(
            clip_sha256=row.clip_sha256,
            file=row.file,
            cell=row.cell,
            exemplar=row.exemplar,
            ratings=sum(counts[number]),
            mean=_mean(counts[number], lowest),
            counts=counts[number],
        )
        for number, row in sorted(shown.items())
    ]


def _mean(counts: list[int], lowest: int) -> float | None:
    total = sum(counts)
    return sum(n * (lowest + place) for place, n in enumerate(counts)) / total if total else None


def _cells(clips: list[ClipResult]) -> list[CellResult]:
    grouped: dict[str, list[ClipResult]] = defaultdict(list)
    for clip in clips:
        grouped[clip.cell].append(clip)
    return [
        CellResult(
            cell=cell,
            ratings=sum(clip.ratings for clip in members),
            mean=_weighted(members),
            counts=[sum(column) for column in zip(*(clip.counts for clip in members), strict=True)],
        )
        for cell, members in grouped.items()
    ]


def _weighted(clips: list[ClipResult]) -> float | None:
    total = sum(clip.ratings for clip in clips)
    return sum(clip.ratings * clip.mean for clip in clips if clip.mean is not None) / total if total else None


def time_bins(tally: PooledTally) -> list[TimeBin]:
    """Response times in bins of 250 ms."""
    return [TimeBin(start_ms=RT_MS * place, answers=n) for place, n in sorted(tally.times.items())]


def playback_of(tally: PooledTally) -> Playback:
    """How the clips were shown."""
    counts: tuple[Counter[str], ...] = (Counter(), Counter(), Counter())
    for words, number in tally.plays.items():
        for count, word in zip(counts, words, strict=True):
            count[word] += number if word else 0
    verdicts, methods, rules = (dict(sorted((+count).items())) for count in counts)
    return Playback(verdicts=verdicts, methods=methods, rules=rules, key_to_first_frame_ms=tally.onsets)
