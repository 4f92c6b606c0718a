"""Clips that participants could not see: which, for how many people of how many, and why.

A trial has failed for a person where no play of it was better than `failed`: nobody saw the clip as a clip.
"""

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field

from sqlalchemy.orm import Session

from server.models import Study
from server.monitor import repository
from server.monitor.repository import MetRun
from server.monitor.schemas import FailingClip
from server.participants.schemas import Origin

LATEST_RUNS = 500
"""Runs that are looked at, the latest: an alarm is about people who take part now."""
FEW = 2
ALARM_SHARE = 0.5
NOT_SEEN_IN_TRIAL = "x"
NOT_MET = "."


@dataclass
class _Seen:
    """What is known of one clip."""

    file: str
    cell: str
    met_by: set[str] = field(default_factory=set)
    failed_for: set[str] = field(default_factory=set)
    rules: Counter[str] = field(default_factory=Counter)
    reasons: Counter[str] = field(default_factory=Counter)


def failing_clips(session: Session, study: Study, chosen: Origin | None) -> list[FailingClip]:
    """The clips that failed for anybody in the latest runs of one origin, those for most people first."""
    origin: Origin = chosen or ("pilot" if study.status == "pilot" else "participant")
    runs = {run.id: run for run in repository.met_runs(session, study, origin, LATEST_RUNS)}
    with_failures = [run.id for run in runs.values() if NOT_SEEN_IN_TRIAL in run.heat]
    if not with_failures:
        return []
    failed = [
        play
        for play in repository.failed_plays(session, with_failures)
        if _letter(runs[play.run], play.trial_index) == NOT_SEEN_IN_TRIAL
    ]
    clips: dict[str, _Seen] = {}
    for play in failed:
        for _, clip in play.blamed:
            seen = clips.setdefault(clip.sha256, _Seen(clip.file, clip.cell))
            seen.failed_for.add(runs[play.run].participant)
            seen.rules[play.rule] += 1
    _add_who_met(session, runs, clips)
    _add_reasons(session, with_failures, clips)
    listed = [_of(sha256, seen) for sha256, seen in clips.items()]
    return sorted(listed, key=lambda clip: (not clip.alarm, -clip.failed_for, clip.file))


def _add_who_met(session: Session, runs: dict[int, MetRun], clips: dict[str, _Seen]) -> None:
    for run, trial_index, sha256 in repository.trials_with_clips(session, list(runs), list(clips)):
        if _letter(runs[run], trial_index) != NOT_MET:
            clips[sha256].met_by.add(runs[run].participant)


def _add_reasons(session: Session, runs: list[int], clips: dict[str, _Seen]) -> None:
    """What the pages said of clips that they could not show."""
    for data in repository.unavailable_clips(session, runs):
        named: Iterable[object] = [data.get("clip_sha256"), *_listed(data.get("clips"))]
        for sha256 in {str(one) for one in named if one}:
            if sha256 in clips and data.get("reason"):
                clips[sha256].reasons[str(data["reason"])[:200]] += 1


def _listed(value: object) -> list[object]:
    if isinstance(value, dict):
        return list(value.values())
    return value if isinstance(value, list) else []


def _letter(run: MetRun, trial_index: int) -> str:
    return run.heat[trial_index] if trial_index < len(run.heat) else NOT_MET


def _of(sha256: str, seen: _Seen) -> FailingClip:
    people, failed = len(seen.met_by | seen.failed_for), len(seen.failed_for)
    return FailingClip(
        clip_sha256=sha256,
        file=seen.file,
        cell=seen.cell,
        people=people,
        failed_for=failed,
        rules=dict(seen.rules.most_common()),
        reason=next((reason for reason, _ in seen.reasons.most_common(1)), ""),
        alarm=failed == people or (failed >= FEW and failed >= ALARM_SHARE * people),
    )
