"""The live monitor: runs, presence, funnel and expected finish of one study."""

from datetime import datetime, timedelta

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from server.clock import now
from server.models import Link, RunEvent, Study, StudyRun
from server.models.runs import STAGES
from server.monitor.heat import HeatMap
from server.monitor.schemas import FunnelStep, MonitoredRun, MonitorSnapshot

HERE_WITHIN = timedelta(minutes=1)
PACE_OVER = timedelta(days=1)


def snapshot(session: Session, study: Study, heat: HeatMap, lease: timedelta) -> MonitorSnapshot:
    """The monitor of `study` at this moment; previews are not shown."""
    heat.update(session, study.id)
    query = select(StudyRun).where(StudyRun.study_id == study.id, StudyRun.preview.is_(False))
    runs = list(session.scalars(query.order_by(StudyRun.id)))
    moment = now()
    shown = [monitored(run, heat, moment, lease) for run in runs]
    return MonitorSnapshot(
        study=study.name,
        study_status=study.status,
        quota=study.quota,
        server_time=moment,
        complete=sum(run.status == "complete" for run in runs),
        active=sum(run.presence in ("here", "away") for run in shown),
        dropped=sum(run.presence == "dropped" for run in shown),
        refused_browsers=_refused(session, study),
        funnel=funnel(runs),
        expected_finish=expected_finish(runs, study.quota, moment),
        runs=shown,
    )


def monitored(run: StudyRun, heat: HeatMap, moment: datetime, lease: timedelta) -> MonitoredRun:
    """One line of the monitor's table."""
    letters = heat.row(run.id, run.trials_total)
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
            "synthetic": run.synthetic,
            "status": run.status,
            "stage": run.stage,
            "presence": presence,
            "started_at": run.started_at,
            "last_seen_at": run.last_seen_at,
            "answered": len(letters) - letters.count("."),
            "trials": run.trials_total,
            "flagged": letters.count("f"),
            "failed": letters.count("x"),
            "excluded": run.excluded,
            "heat": letters,
        }
    )


def funnel(runs: list[StudyRun]) -> list[FunnelStep]:
    """How many runs reached each stage, in the order of a visit."""
    reached = [STAGES.index("done" if run.status == "complete" else run.stage) for run in runs]
    return [
        FunnelStep(stage=stage, runs=sum(far >= position for far in reached))
        for position, stage in enumerate(STAGES)
    ]


def expected_finish(runs: list[StudyRun], quota: int | None, moment: datetime) -> datetime | None:
    """When the quota will be full, at the pace of the last day."""
    finished = sorted(run.completed_at for run in runs if run.status == "complete" and run.completed_at)
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
