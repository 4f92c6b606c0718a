"""Screening: a run ends as screened out where a declared rule says so. Its slot is then free again."""

from collections.abc import Mapping
from typing import Any

from sqlalchemy import Connection
from sqlalchemy.orm import Session

from experiments.definition import Experiment
from experiments.rules import ScreenAttention, ScreenDevice, ScreenFormAnswer
from server.clock import now
from server.models import RunEvent, StudyRun
from server.tokens import new_public_id
from server.trials import repository as trials

EVENT = "screened_out"


def screens_devices(experiment: Experiment) -> bool:
    """True where a browser or screen that will not do ends the run."""
    return any(isinstance(rule, ScreenDevice) for rule in experiment.screening)


def by_form(
    session: Session, run: StudyRun, experiment: Experiment, form: str, answers: Mapping[str, Any]
) -> None:
    """End the run where a rule refuses one of these (checked) answers."""
    for rule in experiment.screening:
        if not isinstance(rule, ScreenFormAnswer) or rule.form != form or rule.field not in answers:
            continue
        if rule.screens_out(answers[rule.field]):
            return _end(session, run, {"rule": rule.rule, "form": form, "field": rule.field})
    return None


def by_device(session: Session, run: StudyRun, reason: str, data: Mapping[str, Any]) -> None:
    """End the run of a browser or screen that cannot show the clips as declared."""
    _end(session, run, {**data, "rule": "device", "reason": reason})


def _end(session: Session, run: StudyRun, data: dict[str, Any]) -> None:
    run.status = "screened_out"
    session.add(RunEvent(event_id=new_public_id(), study_run_id=run.id, type=EVENT, data=data))


def by_attention(connection: Connection, run_id: int, experiment: Experiment) -> bool:
    """End the run where too many attention checks have failed; True where it did."""
    limits = [rule.more_than for rule in experiment.screening if isinstance(rule, ScreenAttention)]
    failed = trials.failed_checks(connection, run_id) if limits else 0
    if not limits or failed <= min(limits):
        return False
    trials.end_run(connection, run_id, "screened_out")
    data = {"rule": "attention_checks_failed", "failed": failed}
    trials.add_event(connection, run_id, new_public_id(), EVENT, data, now())
    return True
