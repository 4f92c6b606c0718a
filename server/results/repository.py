"""What the results page reads: aggregates in SQL, one row a participant and clip at most."""

from collections import Counter, defaultdict
from typing import Any, NamedTuple

from sqlalchemy import ColumnElement, and_, func, select
from sqlalchemy.orm import Session

from server.models import AssignedTrial, Rating, Study, StudyRun, StudyVersion, TrialClip, VersionClip
from server.results.cache import Revision


class ClipCount(NamedTuple):
    """How often a clip got one answer."""

    version_clip_id: int
    response: int
    times: int


RESPONSE = Rating.payload["response"].as_integer()
"""The answer on the scale."""


class Pool(NamedTuple):
    """Whose answers are shown together: one study, one origin, one data series."""

    study_id: int
    origin: str
    series: int

    def runs(self) -> ColumnElement[bool]:
        """True for the runs of this pool."""
        versions = select(StudyVersion.id).where(
            StudyVersion.study_id == self.study_id, StudyVersion.series == self.series
        )
        return and_(
            StudyRun.study_id == self.study_id,
            StudyRun.origin == self.origin,
            StudyRun.version_id.in_(versions),
        )


def usable(of: Pool) -> ColumnElement[bool]:
    """Main trials that count: answered, shown as declared, of a run that is not excluded."""
    return and_(
        of.runs(),
        StudyRun.excluded.is_(False),
        AssignedTrial.kind == "main",
        RESPONSE.is_not(None),
        Rating.verdict != "failed",
    )


def revision(session: Session, study: Study, of: Pool) -> Revision:
    """What the results of a pool depend on, asked of the runs and the newest rating alone."""
    query = select(
        func.count(),
        func.sum(StudyRun.trials_answered),
        func.count(StudyRun.excluded_at),
        func.max(StudyRun.excluded_at),
        func.count(StudyRun.erased_at),
        func.max(StudyRun.erased_at),
    ).where(of.runs())
    runs, answered, *decisions = session.execute(query).one()
    newest = session.execute(select(Rating.id, Rating.rating_id).order_by(Rating.id.desc()).limit(1)).first()
    # A number is given out again where the newest rating was erased (SQLite), hence the rating's own id.
    return Revision(
        (study.id, study.active_version, *decisions), (runs, answered, tuple(newest) if newest else None)
    )


def _joined(query: Any) -> Any:
    return (
        query.select_from(Rating)
        .join(
            AssignedTrial,
            and_(
                AssignedTrial.study_run_id == Rating.study_run_id,
                AssignedTrial.trial_index == Rating.trial_index,
            ),
        )
        .join(StudyRun, StudyRun.id == Rating.study_run_id)
    )


def _with_clip(query: Any) -> Any:
    return query.join(
        TrialClip,
        and_(
            TrialClip.study_run_id == Rating.study_run_id,
            TrialClip.trial_index == Rating.trial_index,
            TrialClip.role == "shown",
        ),
    )


def cell_means(session: Session, of: Pool, factors: list[str]) -> dict[str, dict[tuple[str, ...], float]]:
    """Participant (run number as text) -> levels in factor order -> mean rating."""
    query = _joined(
        select(Rating.study_run_id, VersionClip.cell, func.avg(RESPONSE), func.min(VersionClip.id))
    )
    query = _with_clip(query).join(VersionClip, VersionClip.id == TrialClip.version_clip_id)
    query = query.where(usable(of)).group_by(Rating.study_run_id, VersionClip.cell)
    rows = session.execute(query).all()
    levels = _levels(session, {row[3] for row in rows}, factors)
    means: dict[str, dict[tuple[str, ...], float]] = defaultdict(dict)
    for run, _cell, mean, clip in rows:
        means[str(run)][levels[clip]] = float(mean)
    return dict(means)


def _levels(session: Session, clips: set[int], factors: list[str]) -> dict[int, tuple[str, ...]]:
    query = select(VersionClip.id, VersionClip.levels).where(VersionClip.id.in_(clips))
    return {number: tuple(levels[name] for name in factors) for number, levels in session.execute(query)}


def clip_counts(session: Session, of: Pool) -> list[ClipCount]:
    """How often each clip got each answer."""
    # Grouped by name: with a parameter each, PostgreSQL would take the two expressions as different.
    query = _with_clip(_joined(select(TrialClip.version_clip_id, RESPONSE.label("response"), func.count())))
    query = query.where(usable(of)).group_by(TrialClip.version_clip_id, "response")
    return [ClipCount(*row) for row in session.execute(query)]


def response_times(session: Session, of: Pool) -> list[tuple[int, float]]:
    """(bin of 250 ms, count) of the response times from the clip's end."""
    place = func.floor(Rating.rt / 250)
    query = _joined(select(place, func.count())).where(usable(of), Rating.rt.is_not(None))
    return [(int(start), count) for start, count in session.execute(query.group_by(place).order_by(place))]


def playback(session: Session, of: Pool) -> dict[str, list[tuple[str, int]]]:
    """Counts of plays by verdict, by method and by the rule behind a verdict; failed plays included."""
    columns = (Rating.verdict, Rating.method, Rating.verdict_rule)
    query = (
        _joined(select(*columns, func.count()))
        .where(of.runs(), AssignedTrial.kind == "main")
        .group_by(*columns)
    )
    counts: dict[str, Counter[str]] = {name: Counter() for name in ("verdict", "method", "rule")}
    for *words, number in session.execute(query):
        for name, word in zip(counts, words, strict=True):
            counts[name][word] += number if word else 0
    return {name: sorted((+found).items()) for name, found in counts.items()}


def onset_delays(session: Session, of: Pool) -> list[float]:
    """Every key-to-first-frame time of at most 20,000 latest plays, in ms."""
    query = _joined(select(Rating.key_to_first_frame_ms)).where(
        usable(of), Rating.key_to_first_frame_ms.is_not(None)
    )
    return list(session.scalars(query.order_by(Rating.id.desc()).limit(20_000)))
