"""The live monitor: runs, presence, funnel and expected finish of one study."""

from collections import Counter
from collections.abc import Sequence
from datetime import datetime, timedelta
from typing import Any

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from server.clock import now
from server.models import Link, RunEvent, Study, StudyRun
from server.models.runs import STAGES
from server.monitor.heat import HeatMap
from server.monitor.schemas import FunnelStep, MonitoredRun, MonitorSnapshot

HERE_WITHIN = timedelta(minutes=1)
PACE_OVER = timedelta(days=1)
# Whole objects would take several times as long: this is asked every two seconds, of hundreds of runs.
SHOWN = (
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
)


def snapshot(session: Session, study: Study, heat: HeatMap, lease: timedelta) -> MonitorSnapshot:
    """The monitor of `study` at this moment; previews are not shown.

    What is counted has one origin: the pilot's runs where the study is a pilot, else participants'.
    """
    heat.update(session, study.id)
    query = select(*SHOWN).where(StudyRun.study_id == study.id, StudyRun.origin != "preview")
    runs = session.execute(query.order_by(StudyRun.id)).all()
    moment = now()
    shown = [monitored(run, heat, moment, lease) for run in runs]
    origin = "pilot" if study.status == "pilot" else "participant"
    counted = [run for run in runs if run.origin == origin]
    present = [line for line in shown if line.origin == origin]
    return MonitorSnapshot(
        study=study.name,
        study_status=study.status,
        quota=study.quota,
        server_time=moment,
        origin=origin,
        complete=sum(run.status == "complete" for run in counted),
        active=sum(line.presence in ("here", "away") for line in present),
        dropped=sum(line.presence == "dropped" for line in present),
        screened_out=sum(run.status == "screened_out" for run in counted),
        withdrawn=sum(run.status == "withdrawn" for run in counted),
        others=Counter(run.origin for run in runs if run.origin != origin),
        refused_browsers=_refused(session, study),
        funnel=funnel(counted),
        expected_finish=expected_finish(counted, study.quota, moment),
        runs=shown,
    )


def monitored(run: Any, heat: HeatMap, moment: datetime, lease: timedelta) -> MonitoredRun:
    """One line of the monitor's table."""
    # What a map has read of a run before it was erased stays in memory, not on the page.
    letters = "." * run.trials_total if run.erased_at else heat.row(run.public_id, run.trials_total)
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
            "stage": run.stage,
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


def funnel(runs: Sequence[Any]) -> list[FunnelStep]:
    """How many runs reached each stage, in the order of a visit."""
    reached = [STAGES.index("done" if run.status == "complete" else run.stage) for run in runs]
    return [
        FunnelStep(stage=stage, runs=sum(far >= position for far in reached))
        for position, stage in enumerate(STAGES)
    ]


def expected_finish(runs: Sequence[Any], quota: int | None, moment: datetime) -> datetime | None:
    """When the quota will be full, at the pace of the last day."""
    ends: list[datetime] = [run.completed_at for run in runs if run.status == "complete" and run.completed_at]
    finished = sorted(ends)
    missing = (quota or 0) - len(finished)
    recent = [at for at in finished if moment - at <= PACE_OVER]
    if quota is None or missing <= 0 or len(recent) < 2:
        return None
    return moment + missing * (moment - recent[0]) / len(recent)


def _refused(session: Session, study: Study) -> int:
    query = (
        select(func.count())
        .select_from(RunEvent)
        .join(Link, Link.id == RunEvent.link_id)
        .where(Link.study_id == study.id, RunEvent.study_run_id.is_(None))
    )
    return session.scalar(query) or 0
