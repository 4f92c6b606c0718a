"""The live monitor: runs, presence, funnel, expected finish, and clips that participants could not see."""

from collections import Counter
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from typing import Any

from sqlalchemy.orm import Session

from experiments.assignment.groups import names
from experiments.declaration.experiment import Experiment
from server.core.values import now
from server.models import STAGES, Study
from server.participation.evidence import reasons_against
from server.participation.evidence_repository import has_refusals
from server.participation.judgement import judge_run
from server.participation.run_schemas import Origin
from server.participation.visit_repository import find_run
from server.results import monitor_repository
from server.results.monitor_repository import MetRun, RunCount
from server.results.schemas import (
    FailingClip,
    FunnelStep,
    GroupCount,
    MonitoredRun,
    MonitorSnapshot,
    RunEvidence,
)

# The live monitor: runs, presence, funnel and expected finish of one study.

HERE_WITHIN = timedelta(minutes=1)
PACE_OVER = timedelta(days=1)
MAX_LISTED = 500
"""Runs that are listed, the latest; all are counted."""


def snapshot(
    session: Session, study: Study, experiment: Experiment, chosen: Origin | None = None
) -> MonitorSnapshot:
    """The monitor of `study` at this moment.

    It is of one origin: where none is wanted, the pilot while the study is one, else participants.
    Of the others only the number is shown, of previews nothing.
    """
    lease = timedelta(minutes=experiment.session.lease_minutes)
    moment = now()
    origin: Origin = chosen or ("pilot" if study.status == "pilot" else "participant")
    every = monitor_repository.run_counts(session, study)
    counted = [kind for kind in every if kind.origin == origin]
    by_status = Counter[str]()
    for kind in counted:
        by_status[kind.status] += kind.runs
    active = monitor_repository.under_way(session, study, origin, moment - lease)
    recent = monitor_repository.completed_since(session, study, origin, moment - PACE_OVER)
    runs = monitor_repository.latest_runs(session, study, origin, MAX_LISTED)
    main = monitor_repository.main_trials(session, runs)
    return MonitorSnapshot(
        study=study.name,
        study_status=study.status,
        quota=study.quota,
        server_time=moment,
        origin=origin,
        complete=by_status["complete"],
        active=active,
        dropped=by_status["active"] - active,
        screened_out=by_status["screened_out"],
        withdrawn=by_status["withdrawn"],
        others=runs_of_other_origins(every, origin),
        refused_browsers=monitor_repository.refused_browsers(session, study),
        groups=group_counts(session, study, experiment, origin, moment - lease),
        funnel=funnel(counted, _stages_without(experiment)),
        expected_finish=expected_finish(by_status["complete"], *recent, study.quota, moment),
        total=sum(kind.runs for kind in counted),
        runs=[monitored_run(run, main[run.id], moment, lease) for run in runs],
    )


def runs_of_other_origins(every: Sequence[RunCount], origin: str) -> dict[str, int]:
    """Runs of other origins than this, previews left out."""
    counts = Counter[str]()
    for kind in every:
        if kind.origin not in (origin, "preview"):
            counts[kind.origin] += kind.runs
    return dict(counts)


def group_counts(
    session: Session, study: Study, experiment: Experiment, origin: str, seen_after: datetime
) -> list[GroupCount]:
    """Places taken in each group, excluded runs not counted; nothing where there is one group only."""
    every, quotas = names(experiment), experiment.groups.quotas
    if len(every) < 2:
        return []
    complete, active = monitor_repository.by_group(session, study, origin, seen_after)
    return [
        GroupCount(name=name, quota=quotas.get(name), complete=complete[name], active=active[name])
        for name in every
    ]


def monitored_run(run: Any, main: Sequence[int], moment: datetime, lease: timedelta) -> MonitoredRun:
    """One line of the monitor's table; the study counts the trials `main` alone."""
    letters = run.heat.ljust(run.trials_total, ".")[: run.trials_total]
    silent = moment - run.last_seen_at
    if run.status != "active":
        presence = "finished"
    elif silent > lease:
        presence = "dropped"
    else:
        presence = "here" if silent <= HERE_WITHIN else "away"
    return MonitoredRun.model_validate(
        {
            "run": run.public_id,
            "participant": run.participant,
            "phase": run.phase,
            "origin": run.origin,
            "status": run.status,
            "stage": stage_reached(run),
            "presence": presence,
            "started_at": run.started_at,
            "last_seen_at": run.last_seen_at,
            "answered": len(letters) - letters.count("."),
            "trials": run.trials_total,
            "main_answered": sum(letters[trial] != NOT_MET for trial in main),
            "main_trials": len(main),
            "uncertain": letters.count("u"),
            "flagged": letters.count("f"),
            "failed": letters.count("x"),
            "excluded": run.excluded,
            "evidence_verdict": run.evidence_verdict,
            "heat": letters,
        }
    )


def evidence_of(session: Session, study: Study, public_id: str) -> RunEvidence:
    """The verdict on a run, and why it is not `likely`."""
    run = find_run(session, study, public_id)
    judged = judge_run(session, run)
    reasons = reasons_against(judged, refused=has_refusals(session, run))
    return RunEvidence(verdict=judged.verdict, points=judged.points, reasons=reasons)


def stage_reached(run: Any) -> str:
    """The stage of a run or a count of runs.

    What a page reported last no longer counts once all is complete.
    """
    return "done" if run.status == "complete" else str(run.stage)


def _stages_without(experiment: Experiment) -> set[str]:
    """Stages that visits of this study do not have."""
    has = {
        "forms_before": any(form.when == "before" for form in experiment.forms),
        "calibration": experiment.display.calibrate != "off",
        "practice": experiment.practice.trials > 0,
        "forms_after": any(form.when == "after" for form in experiment.forms),
    }
    return {stage for stage, is_there in has.items() if not is_there}


def funnel(kinds: Sequence[RunCount], lacking: Collection[str] = ()) -> list[FunnelStep]:
    """How many runs reached each stage, in the order of a visit; without stages that the study lacks.

    A stage at which a run is, of a version that had it, is listed all the same.
    """
    reached = Counter[int]()
    for kind in kinds:
        reached[STAGES.index(stage_reached(kind))] += kind.runs
    return [
        FunnelStep(stage=stage, runs=sum(runs for far, runs in reached.items() if far >= position))
        for position, stage in enumerate(STAGES)
        if stage not in lacking or reached[position]
    ]


def expected_finish(
    complete: int, recent: int, first: datetime | None, quota: int | None, moment: datetime
) -> datetime | None:
    """When the quota will be full, at the pace of the `recent` runs, of which the `first` ended then."""
    missing = (quota or 0) - complete
    if quota is None or missing <= 0 or recent < 2 or first is None:
        return None
    return moment + missing * (moment - first) / recent


# Clips that participants could not see: which, for how many people of how many, and why.
#
# A trial has failed for a person where no play of it was better than `failed`: nobody saw the clip as a clip.

LATEST_RUNS = 500
"""Runs that are looked at, the latest: an alarm is about people who take part now."""
FEW = 2
ALARM_SHARE = 0.5
NOT_SEEN_IN_TRIAL = "x"
NOT_MET = "."


@dataclass
class _ClipFailures:
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
    runs = {run.id: run for run in monitor_repository.met_runs(session, study, origin, LATEST_RUNS)}
    with_failures = [run.id for run in runs.values() if NOT_SEEN_IN_TRIAL in run.heat]
    if not with_failures:
        return []
    failed = [
        play
        for play in monitor_repository.failed_plays(session, with_failures)
        if _letter(runs[play.run], play.trial_index) == NOT_SEEN_IN_TRIAL
    ]
    clips: dict[str, _ClipFailures] = {}
    for play in failed:
        for _, clip in play.blamed:
            seen = clips.setdefault(clip.sha256, _ClipFailures(clip.file, clip.cell))
            seen.failed_for.add(runs[play.run].participant)
            seen.rules[play.rule] += 1
    _add_who_met(session, runs, clips)
    _add_reasons(session, with_failures, clips)
    listed = [_failing_clip(sha256, seen) for sha256, seen in clips.items()]
    return sorted(listed, key=lambda clip: (not clip.alarm, -clip.failed_for, clip.file))


def _add_who_met(session: Session, runs: dict[int, MetRun], clips: dict[str, _ClipFailures]) -> None:
    for run, trial_index, sha256 in monitor_repository.trials_with_clips(session, list(runs), list(clips)):
        if _letter(runs[run], trial_index) != NOT_MET:
            clips[sha256].met_by.add(runs[run].participant)


def _add_reasons(session: Session, runs: list[int], clips: dict[str, _ClipFailures]) -> None:
    """What the pages said of clips that they could not show."""
    for data in monitor_repository.unavailable_clips(session, runs):
        named: Iterable[object] = [data.get("clip_sha256"), *_as_list(data.get("clips"))]
        for sha256 in {str(one) for one in named if one}:
            if sha256 in clips and data.get("reason"):
                clips[sha256].reasons[str(data["reason"])[:200]] += 1


def _as_list(value: object) -> list[object]:
    if isinstance(value, dict):
        return list(value.values())
    return value if isinstance(value, list) else []


def _letter(run: MetRun, trial_index: int) -> str:
    return run.heat[trial_index] if trial_index < len(run.heat) else NOT_MET


def _failing_clip(sha256: str, seen: _ClipFailures) -> FailingClip:
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
