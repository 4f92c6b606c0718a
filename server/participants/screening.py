"""Screening: a run ends as screened out where a declared rule says so. Its slot is then free again."""

from collections.abc import Mapping
from typing import Any, NamedTuple, assert_never

from sqlalchemy.orm import Session

from experiments.definition import Experiment
from experiments.rules import ScreenAttention, ScreenDevice, ScreenFormAnswer
from server.models import RunEvent, StudyRun
from server.participants.bounds import checked_data
from server.tokens import new_public_id
from server.trials.attention import EVENT


class _Declared(NamedTuple):
    """The rules of an experiment by the moment at which they are looked at."""

    answers: list[ScreenFormAnswer]
    devices: list[ScreenDevice]


def _declared(experiment: Experiment) -> _Declared:
    declared = _Declared([], [])
    for rule in experiment.screening:
        match rule:
            case ScreenFormAnswer():
                declared.answers.append(rule)
            case ScreenAttention():
                pass  # looked at with each check that is answered, by server.trials.attention
            case ScreenDevice():
                declared.devices.append(rule)
            case _:
                assert_never(rule)
    return declared


def screens_devices(experiment: Experiment) -> bool:
    """True where a browser or screen that will not do ends the run."""
    return bool(_declared(experiment).devices)


def by_form(
    session: Session, run: StudyRun, experiment: Experiment, form: str, answers: Mapping[str, Any]
) -> None:
    """End the run where a rule refuses one of these (checked) answers."""
    for rule in _declared(experiment).answers:
        if rule.form == form and rule.field in answers and rule.screens_out(answers[rule.field]):
            return _end(session, run, {"rule": rule.rule, "form": form, "field": rule.field})
    return None


def by_device(session: Session, run: StudyRun, reason: str, data: Mapping[str, Any]) -> None:
    """End the run of a browser or screen that cannot show the clips as declared."""
    _end(session, run, checked_data({**data, "rule": "device", "reason": reason}))


def by_full_group(session: Session, run: StudyRun, group: str) -> None:
    """End the run where every place of its group is taken."""
    _end(session, run, {"rule": "group_full", "group": group})


def _end(session: Session, run: StudyRun, data: dict[str, Any]) -> None:
    run.status = "screened_out"
    session.add(RunEvent(event_id=new_public_id(), study_run_id=run.id, type=EVENT, data=data))
