"""What the results page reads: the runs of a pool and what their results depend on; background jobs."""

from collections.abc import Iterable
from typing import Any, Literal, NamedTuple

from sqlalchemy import ColumnElement, Select, and_, case, delete, func, select
from sqlalchemy.orm import Session

from experiments.checks import CHECK_CELL
from server.models import (
    AssignedTrial,
    Clip,
    Job,
    Rating,
    SeriesAnswer,
    SeriesTrial,
    Study,
    StudyRun,
    StudyVersion,
    TrialClip,
    VersionClip,
)
from server.results.cache import Revision
from server.results.summary import Trace

# What the results page reads: the runs of a pool, and what their results depend on.


class Pool(NamedTuple):
    """Which answers are shown together: one study, one origin, one data series, the scale of one name."""

    study_id: int
    origin: str
    series: int
    scale: str

    def runs(self) -> ColumnElement[bool]:
        """True for the runs of this pool."""
        return and_(
            StudyRun.study_id == self.study_id,
            StudyRun.origin == self.origin,
            StudyRun.version_id.in_(self.versions()),
        )

    def versions(self) -> Select[int]:
        """The ids of the versions whose answers may be pooled."""
        return select(StudyVersion.id).where(
            StudyVersion.study_id == self.study_id, StudyVersion.series == self.series
        )


def cells_of(session: Session, of: Pool) -> dict[int, str]:
    """The cell of every clip of the pool's versions."""
    query = select(VersionClip.id, VersionClip.cell).where(VersionClip.version_id.in_(of.versions()))
    return dict(session.execute(query).all())


def clips_of(session: Session, version: StudyVersion, answered: Iterable[int]) -> list[VersionClip]:
    """The clips of a version, and those of older versions with these ids."""
    mine = (VersionClip.version_id == version.id) & (VersionClip.cell != CHECK_CELL)
    return list(session.scalars(select(VersionClip).where(mine | VersionClip.id.in_(set(answered)))))


class StimulusCount(NamedTuple):
    """Answers that counted at one stimulus of a series."""

    series: str
    value: float
    cell: str
    n: int
    positive: int


class PersonCount(NamedTuple):
    """Answers of one run that counted at one stimulus of a series."""

    run: int
    series: str
    value: float
    cell: str
    n: int
    positive: int


class LatestEstimate(NamedTuple):
    """The newest estimate of one run's series."""

    series: str
    threshold: float
    threshold_sd: float


def _series_answers(of: Pool, *columns: Any) -> Select[Any]:
    """A query of answers that counted in their series, of runs that are not excluded."""
    same_trial = and_(
        SeriesTrial.study_run_id == SeriesAnswer.study_run_id,
        SeriesTrial.trial_index == SeriesAnswer.trial_index,
    )
    return (
        select(*columns)
        .select_from(SeriesAnswer)
        .join(SeriesTrial, same_trial)
        .join(StudyRun, StudyRun.id == SeriesAnswer.study_run_id)
        .where(of.runs(), StudyRun.excluded.is_(False), SeriesAnswer.counts.is_(True))
    )


def stimulus_counts(session: Session, of: Pool) -> list[StimulusCount]:
    """Every stimulus of every series with its answers, by the cell of its clip, stimuli ascending."""
    positive = func.sum(case((SeriesAnswer.correct.is_(True), 1), else_=0))
    keys = (SeriesTrial.series, SeriesAnswer.value, VersionClip.cell)
    answers = _series_answers(of, *keys, func.count(), positive)
    query = answers.join(VersionClip, VersionClip.id == SeriesAnswer.version_clip_id)
    rows = session.execute(query.group_by(*keys).order_by(*keys))
    return [StimulusCount(series, value, cell, n, int(of_n)) for series, value, cell, n, of_n in rows]


def person_counts(session: Session, of: Pool) -> list[PersonCount]:
    """As `stimulus_counts`, separately for each run."""
    positive = func.sum(case((SeriesAnswer.correct.is_(True), 1), else_=0))
    keys = (SeriesAnswer.study_run_id, SeriesTrial.series, SeriesAnswer.value, VersionClip.cell)
    answers = _series_answers(of, *keys, func.count(), positive)
    query = answers.join(VersionClip, VersionClip.id == SeriesAnswer.version_clip_id)
    rows = session.execute(query.group_by(*keys).order_by(*keys))
    return [PersonCount(run, series, value, cell, n, int(of_n)) for run, series, value, cell, n, of_n in rows]


def latest_estimates(session: Session, of: Pool) -> list[LatestEstimate]:
    """What each run's series led to so far; series without an estimate are left out."""
    keys = (SeriesAnswer.study_run_id, SeriesTrial.series)
    reckoned = SeriesAnswer.threshold.is_not(None)
    last = _series_answers(of, *keys, func.max(SeriesAnswer.number).label("last")).where(reckoned)
    newest = last.group_by(*keys).subquery()
    query = _series_answers(of, SeriesTrial.series, SeriesAnswer.threshold, SeriesAnswer.threshold_sd).join(
        newest,
        and_(
            newest.c.study_run_id == SeriesAnswer.study_run_id,
            newest.c.series == SeriesTrial.series,
            newest.c.last == SeriesAnswer.number,
        ),
    )
    return [LatestEstimate(*row) for row in session.execute(query.order_by(SeriesAnswer.threshold))]


def traces_of(session: Session, of: Pool, kind: str) -> list[Trace]:
    """The traces in answers of a kind: of main trials that did not fail and runs that are not excluded."""
    on_trial = and_(
        AssignedTrial.study_run_id == Rating.study_run_id, AssignedTrial.trial_index == Rating.trial_index
    )
    on_clip = and_(
        TrialClip.study_run_id == Rating.study_run_id,
        TrialClip.trial_index == Rating.trial_index,
        TrialClip.role == "shown",
    )
    query = (
        select(StudyRun.id, VersionClip.cell, Clip.fps, Rating.payload)
        .select_from(Rating)
        .join(StudyRun, StudyRun.id == Rating.study_run_id)
        .join(AssignedTrial, on_trial)
        .join(TrialClip, on_clip)
        .join(VersionClip, VersionClip.id == TrialClip.version_clip_id)
        .join(Clip, Clip.sha256 == VersionClip.clip_sha256)
        .where(of.runs(), StudyRun.excluded.is_(False), AssignedTrial.kind == "main")
        .where(Rating.kind == kind, Rating.verdict != "failed")
        .order_by(Rating.id)
    )
    return [
        Trace(run, cell, payload["step_frames"] / fps, payload["values"])
        for run, cell, fps, payload in session.execute(query)
        if payload.get("values")
    ]


def blinks_of_cells(session: Session, of: Pool) -> dict[str, list[list[float]]]:
    """For each cell, the times in s of the blinks of each of its clips; clips of performances only."""
    query = select(VersionClip.cell, VersionClip.blinks_s).where(VersionClip.version_id.in_(of.versions()))
    rows = session.execute(query.order_by(VersionClip.id)).all()
    blinks: dict[str, list[list[float]]] = {}
    for cell, times_s in rows:
        if times_s and list(times_s) not in blinks.setdefault(cell, []):
            blinks[cell].append(list(times_s))
    return blinks


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


def large_origins(session: Session, answers: int) -> list[tuple[str, str]]:
    """Open studies and their origins with at least this number of answers, previews left out."""
    query = (
        select(Study.name, StudyRun.origin)
        .join(StudyRun, StudyRun.study_id == Study.id)
        .where(Study.status.in_(("pilot", "live")), StudyRun.origin != "preview")
        .group_by(Study.id, StudyRun.origin)
        .having(func.sum(StudyRun.trials_answered) >= answers)
        .order_by(Study.id, StudyRun.origin)
    )
    return [(name, origin) for name, origin in session.execute(query)]


# The jobs that build reports and capsules and rehearse studies, as the database keeps them.

JobKind = Literal["report", "capsule", "rehearsal"]
LISTED_JOBS = 20


def lock_study(session: Session, study: Study) -> None:
    """Make others who ask for a job of this study wait until this transaction ends."""
    session.execute(select(Study.id).where(Study.id == study.id).with_for_update(key_share=True))


def latest_jobs(session: Session, study: Study, kind: JobKind) -> list[Job]:
    """The latest jobs of a kind for a study, newest first."""
    return jobs_of(session, study, kind)[:LISTED_JOBS]


def jobs_of(session: Session, study: Study, kind: JobKind) -> list[Job]:
    """Every job of a kind for a study, newest first."""
    query = select(Job).where(Job.study_id == study.id, Job.kind == kind)
    return list(session.scalars(query.order_by(Job.id.desc())))


def jobs_without_study(session: Session, kind: str) -> list[Job]:
    """Every job of a kind that belongs to no study, oldest first."""
    query = select(Job).where(Job.study_id.is_(None), Job.kind == kind)
    return list(session.scalars(query.order_by(Job.id)))


def find_job(session: Session, study: Study, kind: JobKind, public_id: str) -> Job | None:
    """The job of a kind for a study with this public id."""
    of_study = (Job.study_id == study.id, Job.kind == kind, Job.public_id == public_id)
    return session.scalar(select(Job).where(*of_study))


def job_called(session: Session, public_id: str) -> Job | None:
    """The job with this public id, of whatever study, kept from others until the transaction ends."""
    return session.scalar(select(Job).where(Job.public_id == public_id).with_for_update())


def status_of(session: Session, public_id: str) -> str | None:
    """How far the job with this public id is; None where there is none any more."""
    return session.scalar(select(Job.status).where(Job.public_id == public_id))


def remove_job(session: Session, study: Study, kind: JobKind, public_id: str) -> None:
    """Forget a job; its files are its own part's to remove."""
    of_study = (Job.study_id == study.id, Job.kind == kind, Job.public_id == public_id)
    session.execute(delete(Job).where(*of_study))
