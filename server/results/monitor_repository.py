"""What the monitor reads: counts of runs by the database, and the latest runs with their heat maps."""

from collections import Counter
from collections.abc import Sequence
from datetime import datetime
from typing import Any, NamedTuple

from sqlalchemy import func, literal_column, select
from sqlalchemy.orm import Session

from server.models import (
    AssignedTrial,
    Link,
    Rating,
    RunEvent,
    RunTally,
    Study,
    StudyRun,
    TrialClip,
    VersionClip,
)

# Whole objects would take several times as long: this is asked every two seconds, of hundreds of runs.
SHOWN = (
    StudyRun.id,
    StudyRun.public_id,
    StudyRun.participant,
    StudyRun.phase,
    StudyRun.origin,
    StudyRun.status,
    StudyRun.stage,
    StudyRun.started_at,
    StudyRun.last_seen_at,
    StudyRun.completed_at,
    StudyRun.trials_total,
    StudyRun.excluded,
    StudyRun.erased_at,
    StudyRun.evidence_verdict,
    func.coalesce(RunTally.heat, "").label("heat"),
)


class RunCount(NamedTuple):
    """How many runs of one origin have one status and stage."""

    origin: str
    status: str
    stage: str
    runs: int


def run_counts(session: Session, study: Study) -> list[RunCount]:
    """The runs of a study, from an index alone."""
    kinds = (StudyRun.origin, StudyRun.status, StudyRun.stage)
    query = select(*kinds, func.count()).where(StudyRun.study_id == study.id)
    return [RunCount(*row) for row in session.execute(query.group_by(*kinds))]


def under_way(session: Session, study: Study, origin: str, seen_after: datetime) -> int:
    """Active runs of one origin that were seen after a moment."""
    query = select(func.count()).where(
        StudyRun.study_id == study.id,
        StudyRun.origin == origin,
        StudyRun.status == "active",
        StudyRun.last_seen_at >= seen_after,
    )
    return session.scalar(query) or 0


def by_group(
    session: Session, study: Study, origin: str, seen_after: datetime
) -> tuple[Counter[str], Counter[str]]:
    """Complete and active runs of one origin by group, without those that are excluded or silent since."""
    query = select(StudyRun.group_name, StudyRun.status, func.count()).where(
        StudyRun.study_id == study.id,
        StudyRun.origin == origin,
        StudyRun.excluded.is_(False),
        (StudyRun.status == "complete")
        | ((StudyRun.status == "active") & (StudyRun.last_seen_at > seen_after)),
    )
    counts = {"complete": Counter[str](), "active": Counter[str]()}
    for group, status, number in session.execute(query.group_by(StudyRun.group_name, StudyRun.status)):
        counts[status][group] += number
    return counts["complete"], counts["active"]


def completed_since(
    session: Session, study: Study, origin: str, moment: datetime
) -> tuple[int, datetime | None]:
    """Runs of one origin that were completed since a moment, and when the first of them was."""
    query = select(func.count(), func.min(StudyRun.completed_at)).where(
        StudyRun.study_id == study.id,
        StudyRun.origin == origin,
        StudyRun.status == "complete",
        StudyRun.completed_at >= moment,
    )
    number, first = session.execute(query).one()
    return number, first


def latest_runs(session: Session, study: Study, origin: str, limit: int) -> Sequence[Any]:
    """The runs of one origin that began last, in the order they began."""
    query = select(*SHOWN).outerjoin(RunTally, RunTally.study_run_id == StudyRun.id)
    query = query.where(StudyRun.study_id == study.id, StudyRun.origin == origin)
    return session.execute(query.order_by(StudyRun.id.desc()).limit(limit)).all()[::-1]


class MetRun(NamedTuple):
    """A run and how far its trials went: one letter per trial."""

    id: int
    participant: str
    heat: str


class ShownClip(NamedTuple):
    """A clip by its file and its cell."""

    sha256: str
    file: str
    cell: str


class FailedPlay(NamedTuple):
    """A play that failed, with the clips of its trial that it failed for, by role."""

    run: int
    trial_index: int
    rule: str
    blamed: list[tuple[str, ShownClip]]


def main_trials(session: Session, runs: Sequence[Any]) -> dict[int, list[int]]:
    """The trials that a study counts, by run: those that are neither practice nor a check."""
    others: dict[int, set[int]] = {run.id: set() for run in runs}
    # Written like this, an index of these few trials alone answers it.
    query = select(AssignedTrial.study_run_id, AssignedTrial.trial_index)
    is_main = AssignedTrial.kind == literal_column("'main'")
    query = query.where(AssignedTrial.study_run_id.in_(others), ~is_main)
    for run, trial in session.execute(query):
        others[run].add(trial)
    return {
        run.id: [trial for trial in range(run.trials_total) if trial not in others[run.id]] for run in runs
    }


def met_runs(session: Session, study: Study, origin: str, limit: int) -> list[MetRun]:
    """The runs of one origin that began last and have shown a trial."""
    query = select(StudyRun.id, StudyRun.participant, RunTally.heat)
    query = query.join(RunTally, RunTally.study_run_id == StudyRun.id)
    query = query.where(StudyRun.study_id == study.id, StudyRun.origin == origin)
    return [MetRun(*row) for row in session.execute(query.order_by(StudyRun.id.desc()).limit(limit))]


def failed_plays(session: Session, runs: Sequence[int]) -> list[FailedPlay]:
    """The failed plays of these runs. A play of several clips failed for those that were not played."""
    columns = (
        Rating.study_run_id,
        Rating.trial_index,
        Rating.play,
        Rating.verdict_rule,
        Rating.playback,
        TrialClip.role,
        VersionClip.clip_sha256,
        VersionClip.file,
        VersionClip.cell,
    )
    same_trial = (TrialClip.study_run_id == Rating.study_run_id) & (
        TrialClip.trial_index == Rating.trial_index
    )
    query = select(*columns).join(TrialClip, same_trial)
    query = query.join(VersionClip, VersionClip.id == TrialClip.version_clip_id)
    query = query.where(Rating.study_run_id.in_(runs), Rating.verdict == "failed")
    query = query.order_by(Rating.study_run_id, Rating.trial_index, Rating.play, TrialClip.position)
    plays: dict[tuple[int, int, int], FailedPlay] = {}
    unplayed: dict[tuple[int, int, int], set[str]] = {}
    for run, trial, play, rule, playback, role, sha256, file, cell in session.execute(query):
        key = (run, trial, play)
        known = plays.setdefault(key, FailedPlay(run, trial, rule, []))
        known.blamed.append((role, ShownClip(sha256, file, cell)))
        logs = playback if isinstance(playback, dict) else {}
        unplayed[key] = {one for one, log in logs.items() if log and not log.get("frames_drawn")}
    return [
        play._replace(blamed=[one for one in play.blamed if one[0] in unplayed[key]] or play.blamed)
        for key, play in plays.items()
    ]


def trials_with_clips(
    session: Session, runs: Sequence[int], hashes: Sequence[str]
) -> list[tuple[int, int, str]]:
    """Run, trial and clip, of the trials of these runs that have one of these clips."""
    query = select(TrialClip.study_run_id, TrialClip.trial_index, VersionClip.clip_sha256)
    query = query.join(VersionClip, VersionClip.id == TrialClip.version_clip_id)
    query = query.where(TrialClip.study_run_id.in_(runs), VersionClip.clip_sha256.in_(hashes))
    return [(run, trial, sha256) for run, trial, sha256 in session.execute(query)]


def unavailable_clips(session: Session, runs: Sequence[int]) -> list[dict[str, Any]]:
    """What pages said when they could not show a clip."""
    query = select(RunEvent.data).where(RunEvent.study_run_id.in_(runs))
    return list(session.scalars(query.where(RunEvent.type == "clip_unavailable")))


def refused_browsers(session: Session, study: Study) -> int:
    """How often a browser was refused before a run began."""
    query = (
        select(func.count())
        .select_from(RunEvent)
        .join(Link, Link.id == RunEvent.link_id)
        .where(Link.study_id == study.id, RunEvent.study_run_id.is_(None))
    )
    return session.scalar(query) or 0
