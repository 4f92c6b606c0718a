"""Timelines, exclusion with a reason, and erasure on request."""

from collections.abc import Collection
from datetime import timedelta

from sqlalchemy.orm import Session

from server.accounts.audit import record
from server.accounts.identity import Identity
from server.core.errors import Conflict
from server.core.values import now
from server.models import AssignedTrial, Link, Rating, Study, StudyRun, VersionClip
from server.participation import visit_repository
from server.participation.identity_keys import ParticipantIdentity, UnreadableError
from server.participation.identity_repository import known_as
from server.results.monitor_repository import main_trials
from server.results.schemas import (
    RunIdentity,
    RunPage,
    RunSummary,
    Show,
    Timeline,
    TimelineCalibration,
    TimelineClip,
    TimelineEvent,
    TimelineForm,
    TimelineTrial,
)


def page(
    session: Session,
    study: Study,
    show: Show,
    search: str,
    before: str | None,
    limit: int,
    *,
    simulated: bool = False,
) -> RunPage:
    """At most `limit` runs that fit, the latest first, those begun before the run `before`."""
    last = None if before is None else visit_repository.find_run(session, study, before).id
    runs = visit_repository.page_of_runs(session, study, show, search, last, limit + 1, simulated=simulated)
    shown = runs[:limit]
    counts = visit_repository.answered_trials(session, [run.id for run in shown])
    refused = visit_repository.refused_records(session, [run.id for run in shown])
    main = main_trials(session, shown)
    are_all = last is None and len(runs) <= limit
    return RunPage(
        runs=[
            summary(run, *counts.get(run.id, (set(), 0)), refused.get(run.id, 0), main[run.id])
            for run in shown
        ],
        total=len(shown)
        if are_all
        else visit_repository.number_of_runs(session, study, show, search, simulated=simulated),
        next=shown[-1].public_id if len(runs) > limit else None,
    )


def summary(
    run: StudyRun, answered: Collection[int], not_good: int, refused: int, main: Collection[int]
) -> RunSummary:
    """One line of the participants page; the study counts the trials `main` alone."""
    spent = (run.completed_at or run.last_seen_at) - run.started_at
    return RunSummary(
        run=run.public_id,
        participant=run.participant,
        phase=run.phase,
        origin=run.origin,
        status=run.status,
        stage=run.stage,
        language=run.language,
        started_at=run.started_at,
        last_seen_at=run.last_seen_at,
        completed_at=run.completed_at,
        minutes=round(spent / timedelta(minutes=1), 1),
        trials=run.trials_total,
        answered=len(answered),
        main_trials=len(main),
        main_answered=len(set(answered).intersection(main)),
        not_good=not_good,
        refused=refused,
        excluded=run.excluded,
        exclusion_reason=run.exclusion_reason,
        erased_at=run.erased_at,
        version=run.version.number,
        link=_way_in(run.link),
    )


def _way_in(link: Link) -> str:
    """The name of a link next to its participant: its label, unless it is a person's."""
    return link.kind if link.kind == "personal" else link.label or link.kind


def identity(session: Session, study: Study, public_id: str, reader: Identity) -> RunIdentity:
    """Who a run's participant is to the recruiter; that somebody looked is written down."""
    run = visit_repository.find_run(session, study, public_id)
    record(session, reader, "identity read", "run", public_id, study=study.name)
    try:
        known = known_as(session, run) or ParticipantIdentity()
    except UnreadableError as error:
        raise Conflict(f"{error}.") from error
    return RunIdentity(
        run=public_id,
        participant=run.participant,
        identifier=known.identifier,
        parameters=dict(known.parameters),
        link=run.link.label,
    )


def timeline(session: Session, study: Study, public_id: str) -> Timeline:
    """One run with every play, event, form and calibration; heartbeats of its page are left out."""
    run = visit_repository.find_run(session, study, public_id)
    plays = visit_repository.plays(session, run)
    clips = visit_repository.clips_by_trial(session, run)
    answered = {rating.trial_index for rating, _, _ in plays}
    refused = visit_repository.refused_records(session, [run.id]).get(run.id, 0)
    not_good = sum(rating.verdict in ("flagged", "failed") for rating, _, _ in plays)
    return Timeline(
        summary=summary(run, answered, not_good, refused, main_trials(session, [run])[run.id]),
        device=run.device,
        consented_at=run.consented_at,
        trials=[_trial(*play, clips.get(play[0].trial_index, [])) for play in plays],
        events=[
            TimelineEvent(type=row.type, at_client=row.at_client, received_at=row.received_at, data=row.data)
            for row in visit_repository.events(session, run)
        ],
        forms=[
            TimelineForm(form=row.form, answers=row.answers, saved_at=row.saved_at)
            for row in visit_repository.forms(session, run)
        ],
        calibrations=[
            TimelineCalibration.model_validate(row) for row in visit_repository.calibrations(session, run)
        ],
    )


_FROM_RATING = (
    "trial_index", "play", "rt", "rt_from_first_frame", "time_elapsed", "changes", "comment", "method",
    "verdict", "verdict_rule", "key_to_first_frame_ms", "frames_drawn", "frames_late", "frames_missing",
    "longest_gap_ms", "stalls", "focus_lost", "clock_gap_ms", "clock_late_ms", "refresh_rate_hz",
    "device_pixel_ratio", "px_per_mm", "viewing_distance_mm", "disturbances", "drawn", "playback", "saved_at",
)  # fmt: skip


def _trial(
    rating: Rating, trial: AssignedTrial, clip: VersionClip | None, clips: list[tuple[str, VersionClip]]
) -> TimelineTrial:
    values = {name: getattr(rating, name) for name in _FROM_RATING}
    values |= {"answer": rating.payload, "response": rating.payload.get("response")}
    values |= {"kind": trial.kind, "block": trial.block, "expected_response": trial.expected_response}
    values |= {
        "cell": clip.cell if clip else None,
        "exemplar": clip.exemplar if clip else None,
        "clip_sha256": clip.clip_sha256 if clip else None,
        "clips": [
            TimelineClip(role=role, cell=one.cell, exemplar=one.exemplar, clip_sha256=one.clip_sha256)
            for role, one in clips
        ],
    }
    return TimelineTrial.model_validate(values)


def exclude(session: Session, study: Study, public_id: str, reason: str, identity: Identity) -> None:
    """Mark a run as excluded; its data stay, with the reason."""
    run = visit_repository.find_run(session, study, public_id)
    if run.erased_at is not None:
        raise Conflict("This run's data were erased; there is nothing left to exclude.")
    run.excluded, run.exclusion_reason = True, reason
    run.excluded_at, run.excluded_by = now(), identity.account_id
    record(session, identity, "run excluded", "run", public_id, study=study.name, reason=reason)


def include(session: Session, study: Study, public_id: str, identity: Identity) -> None:
    """Undo an exclusion; the audit log keeps that it was there."""
    run = visit_repository.find_run(session, study, public_id)
    if not run.excluded:
        raise Conflict("This run is not excluded.")
    record(
        session, identity, "exclusion undone", "run", public_id, study=study.name, reason=run.exclusion_reason
    )
    run.excluded, run.exclusion_reason, run.excluded_at, run.excluded_by = False, None, None, None
