"""What was shown in a run, trial by trial, also of runs that are older than the ledger of views."""

from collections.abc import Iterable, Mapping, Sequence
from datetime import datetime, timedelta

from sqlalchemy.orm import Session

from experiments.kinds import KINDS
from server.core.errors import NotFound
from server.core.storage import clip_address
from server.models import Clip, Rating, Study, StudyRun, VersionClip, View, ViewClip
from server.participation.views import unpack_log
from server.participation.visit_repository import find_run
from server.results import replay_repository
from server.results.schemas import (
    ClipInRole,
    FrameLog,
    Replay,
    ReplayableTrial,
    ReplayedClip,
    ReplayedEvent,
    ReplayedPlay,
    ReplayedTrial,
    ReplayedView,
)
from server.studies.lookup import definition_of

# Views rebuilt from an answer's own log, for runs that are older than the ledger of views.

Log = list[tuple[int, float]]
AT_ONCE = {"left", "right"}
"""Roles that one clock draws."""


def showings_of(drawn: Sequence[Sequence[float]]) -> list[Log]:
    """The log of an answer, cut where a clip begins again: where the frame's index falls.

    >>> showings_of([[0, 10.0], [1, 43.0], [0, 9.0], [2, 75.0]])
    [[(0, 10.0), (1, 43.0)], [(0, 9.0), (2, 75.0)]]
    """
    logs: list[Log] = []
    for index, ms in drawn:
        if not logs or index <= logs[-1][-1][0]:
            logs.append([])
        logs[-1].append((int(index), float(ms)))
    return logs


def groups_of(roles: Sequence[str]) -> list[list[str]]:
    """The roles of a trial, those together that are shown at once, in the order of showing.

    >>> groups_of(["reference", "left", "right"])
    [['reference'], ['left', 'right']]
    >>> groups_of(["second", "first", "reference"])
    [['reference'], ['first'], ['second']]
    """
    order = ("reference", "first", "left", "right", "second", "shown")
    groups: list[list[str]] = []
    for role in sorted(roles, key=order.index):
        if groups and {groups[-1][-1], role} <= AT_ONCE:
            groups[-1].append(role)
        else:
            groups.append([role])
    return groups


def rebuilt_views(drawn: Sequence[Sequence[float]], clips: Mapping[str, str]) -> list[ReplayedView]:
    """The views of a play from what its answer says was drawn.

    Parameters
    ----------
    drawn : sequence of (int, float)
        Index and time in ms since the start key of every drawn frame, view after view.
    clips : mapping of str to str
        The trial's clips: role to hash.
    """
    groups, logs = groups_of(list(clips)), showings_of(drawn)
    if not groups:
        return []
    return [
        _rebuilt_view(start // len(groups) + 1, groups, logs[start : start + len(groups)], clips)
        for start in range(0, len(logs), len(groups))
    ]


def _rebuilt_view(
    number: int, groups: Sequence[Sequence[str]], logs: Sequence[Log], clips: Mapping[str, str]
) -> ReplayedView:
    seen = [
        FrameLog.model_validate({"role": role, "clip_sha256": clips[role], "drawn": log})
        for group, log in zip(groups, logs, strict=False)
        for role in group
    ]
    return ReplayedView(
        number=number,
        from_answer=True,
        started_at_client=None,
        ended_at_client=None,
        outcome=None,
        screen={},
        showings=None,
        clips=seen,
        disturbances={},
    )


# What was shown in a run, trial by trial: frame logs, answers, verdicts and events side by side.

AROUND = timedelta(seconds=2)
"""Events so long before the first view and after the last answer are shown with a trial."""
_OF_ANSWER = (
    "rt", "rt_from_first_frame", "answered_at_client", "comment", "method", "verdict", "verdict_rule",
    "refresh_rate_hz", "device_pixel_ratio",
)  # fmt: skip


def replay(session: Session, study: Study, public_id: str) -> Replay:
    """The run's trials in their order, and what its pages need to know to show them again."""
    run = find_run(session, study, public_id)
    experiment = definition_of(run.version)
    return Replay(
        run=run.public_id,
        participant=run.participant,
        origin=run.origin,
        language=run.language,
        erased=run.erased_at is not None,
        trial=KINDS[experiment.trial.kind].shown(experiment),
        display=experiment.display,
        trials=_trials(session, run),
    )


def _trials(session: Session, run: StudyRun) -> list[ReplayableTrial]:
    verdicts, views = replay_repository.verdicts(session, run), replay_repository.view_counts(session, run)
    clips: dict[int, list[ClipInRole]] = {}
    for trial_index, role, cell, exemplar in replay_repository.roles(session, run):
        named = ClipInRole.model_validate({"role": role, "cell": cell, "exemplar": exemplar})
        clips.setdefault(trial_index, []).append(named)
    listed = []
    for trial in replay_repository.assigned_trials(session, run):
        index = trial.trial_index
        judged, (count, latest) = verdicts.get(index, []), views.get(index, (0, 0))
        listed.append(
            ReplayableTrial(
                trial_index=index,
                kind=trial.kind,
                block=trial.block,
                block_label=trial.block_label,
                clips=clips.get(index, []),
                plays=max(len(judged), latest),
                views=count,
                verdict=judged[-1] if judged else None,
            )
        )
    return listed


def replayed_trial(session: Session, study: Study, public_id: str, trial_index: int) -> ReplayedTrial:
    """One trial of a run: every play of it with its views, frame by frame."""
    run = find_run(session, study, public_id)
    trial = replay_repository.assigned_trial(session, run, trial_index)
    if trial is None:
        raise NotFound(f"The run '{run.public_id}' has no trial {trial_index}; trials are numbered from 0.")
    assigned = replay_repository.clips_of_trial(session, run, trial_index)
    ratings = replay_repository.answers(session, run, trial_index)
    stored = replay_repository.views(session, run, trial_index)
    hashes = {role: clip.sha256 for role, _, clip in assigned}
    plays = [
        _play(
            session,
            run,
            number,
            _rating_of_play(ratings, number),
            [one for one in stored if one[0].play == number],
            hashes,
        )
        for number in sorted({rating.play for rating in ratings} | {view.play for view, _ in stored})
    ]
    shown = {clip.clip_sha256 for _, clips in stored for clip in clips} - set(hashes.values())
    others = replay_repository.clips_by_hash(session, run, shown) if shown else []
    return ReplayedTrial(
        trial_index=trial_index,
        clips=_clips(run, [*((placed, clip) for _, placed, clip in assigned), *others]),
        expected_response=trial.expected_response,
        plays=plays,
        events=_events(session, run, plays),
    )


def _rating_of_play(ratings: Iterable[Rating], play: int) -> Rating | None:
    return next((rating for rating in ratings if rating.play == play), None)


def _play(
    session: Session,
    run: StudyRun,
    number: int,
    rating: Rating | None,
    stored: Sequence[tuple[View, Sequence[ViewClip]]],
    hashes: dict[str, str],
) -> ReplayedPlay:
    views = [_view(view, clips) for view, clips in stored]
    if rating is not None and not views:
        views = rebuilt_views(rating.drawn or [], hashes)
    of_answer = {name: getattr(rating, name, None) for name in _OF_ANSWER}
    return ReplayedPlay.model_validate(
        {
            **of_answer,
            "verdict_rule": of_answer["verdict_rule"] or "",
            "play": number,
            "px_per_mm": rating.px_per_mm
            if rating is not None
            else replay_repository.px_per_mm_at(session, run, stored[0][0].received_at),
            "views": views,
            "answer": rating.payload if rating is not None else None,
        }
    )


def _view(view: View, clips: Iterable[ViewClip]) -> ReplayedView:
    return ReplayedView.model_validate(
        {
            "number": view.number,
            "from_answer": False,
            "started_at_client": view.started_at_client,
            "ended_at_client": view.ended_at_client,
            "outcome": view.outcome,
            "screen": view.screen,
            "showings": view.showings,
            "clips": [
                {"role": clip.role, "clip_sha256": clip.clip_sha256, "drawn": unpack_log(clip.frame_log)}
                for clip in clips
            ],
            "disturbances": view.disturbances,
        }
    )


def _clips(run: StudyRun, clips: Iterable[tuple[VersionClip, Clip]]) -> list[ReplayedClip]:
    """Each clip once, at the first of its places."""
    by_hash: dict[str, ReplayedClip] = {}
    for placed, clip in clips:
        by_hash.setdefault(
            clip.sha256,
            ReplayedClip(
                clip_sha256=clip.sha256,
                clip_url=clip_address(clip.sha256),
                cell=placed.cell,
                exemplar=placed.exemplar,
                frames=clip.frames,
                fps=clip.fps,
                width_px=clip.width_px,
                height_px=clip.height_px,
                width_mm=placed.width_mm,
                inter_ocular_px=run.version.inter_ocular_px,
            ),
        )
    return list(by_hash.values())


def _events(session: Session, run: StudyRun, plays: Iterable[ReplayedPlay]) -> list[ReplayedEvent]:
    """What happened from the first view to the last answer, by the participant's clock."""
    moments = [moment for play in plays for moment in _moments(play)]
    if not moments:
        return []
    events = replay_repository.events_between(session, run, min(moments) - AROUND, max(moments) + AROUND)
    return [
        ReplayedEvent(type=event.type, at_client=event.at_client, data=event.data)
        for event in events
        if event.at_client is not None
    ]


def _moments(play: ReplayedPlay) -> Iterable[datetime]:
    for view in play.views:
        yield from (moment for moment in (view.started_at_client, view.ended_at_client) if moment is not None)
    if play.answered_at_client is not None:
        yield play.answered_at_client
