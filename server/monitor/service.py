"""The live monitor: runs, presence, funnel and expected finish of one study."""

from collections import Counter
from collections.abc import Sequence
from datetime import datetime, timedelta
from typing import Any

from sqlalchemy.orm import Session

from experiments.assignment.groups import names
from experiments.definition import Experiment
from server.clock import now
from server.models import Study
from server.models.runs import STAGES
from server.monitor import repository
from server.monitor.repository import RunCount
from server.monitor.schemas import FunnelStep, GroupCount, MonitoredRun, MonitorSnapshot
from server.participants.schemas import Origin

HERE_WITHIN = timedelta(minutes=1)
PACE_OVER = timedelta(days=1)
MAX_LISTED = 500
"""Runs that are listed, the latest; all are counted."""


def snapshot(
    session: Session, study: Study, experiment: Experiment, chosen: Origin | None = None
) -> MonitorSnapshot:
    """The monitor of `study` at this moment.

    It is of one origin: where none is wanted, the pilot while the study is one, else participants.
    Of the others only their number is told, of previews nothing.
    """
    lease = timedelta(minutes=experiment.session.lease_minutes)
    moment = now()
    origin: Origin = chosen or ("pilot" if study.status == "pilot" else "participant")
    every = repository.run_counts(session, study)
    counted = [kind for kind in every if kind.origin == origin]
    by_status = Counter[str]()
    for kind in counted:
        by_status[kind.status] += kind.runs
    active = repository.under_way(session, study, origin, moment - lease)
    recent = repository.completed_since(session, study, origin, moment - PACE_OVER)
    runs = repository.latest_runs(session, study, origin, MAX_LISTED)
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
        others=others(every, origin),
        refused_browsers=repository.refused_browsers(session, study),
        groups=group_counts(session, study, experiment, origin, moment - lease),
        funnel=funnel(counted),
        expected_finish=expected_finish(by_status["complete"], *recent, study.quota, moment),
        total=sum(kind.runs for kind in counted),
        runs=[monitored(run, moment, lease) for run in runs],
    )


def others(every: Sequence[RunCount], origin: str) -> dict[str, int]:
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
    complete, active = repository.by_group(session, study, origin, seen_after)
    return [
        GroupCount(name=name, quota=quotas.get(name), complete=complete[name], active=active[name])
        for name in every
    ]


def monitored(run: Any, moment: datetime, lease: timedelta) -> MonitoredRun:
    """One line of the monitor's table."""
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
            "uncertain": letters.count("u"),
            "flagged": letters.count("f"),
            "failed": letters.count("x"),
            "excluded": run.excluded,
            "evidence_verdict": run.evidence_verdict,
            "heat": letters,
        }
    )


def stage_reached(run: Any) -> str:
    """The stage of a run or a count of runs; what a page told last stays behind once all is complete."""
    return "done" if run.status == "complete" else str(run.stage)


def funnel(kinds: Sequence[RunCount]) -> list[FunnelStep]:
    """How many runs reached each stage, in the order of a visit."""
    reached = Counter[int]()
    for kind in kinds:
        reached[STAGES.index(stage_reached(kind))] += kind.runs
    return [
        FunnelStep(stage=stage, runs=sum(runs for far, runs in reached.items() if far >= position))
        for position, stage in enumerate(STAGES)
    ]


def expected_finish(
    complete: int, recent: int, first: datetime | None, quota: int | None, moment: datetime
) -> datetime | None:
    """When the quota will be full, at the pace of the `recent` runs, of which the `first` ended then."""
    missing = (quota or 0) - complete
    if quota is None or missing <= 0 or recent < 2 or first is None:
        return None
    return moment + missing * (moment - first) / recent
