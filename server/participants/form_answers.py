"""A form's answers stored; one of them may end the run, or decide its group."""

from collections.abc import Mapping
from datetime import datetime
from typing import Any

from sqlalchemy.orm import Session

from experiments.assignment.grouping import deciding, group_of_answer
from experiments.errors import did_you_mean
from server.clock import now
from server.context import Services
from server.models import NO_SLOT, FormAnswer, StudyRun
from server.participants import grouping, repository, screening
from server.participants.forms import checked_answers
from server.participants.lookup import find_run, open_run
from server.participants.placing import assign_slot
from server.participants.refusals import FormUnknown, GroupDecided
from server.participants.runs import need_consent, saved, state_of
from server.participants.schemas import Saved
from server.versions import LoadedVersion


def save_form(
    services: Services, session: Session, token: str, name: str, answers: dict[str, Any], moment: datetime
) -> Saved:
    """Store a form's answers once they fit the declaration; sending it again replaces them."""
    loaded = services.versions.get(session, find_run(session, token).version_id)
    asked = deciding(loaded.experiment)
    decides = asked is not None and asked.form == name
    if decides:
        # The study first, as in a start: two requests that lock in two orders would wait for each other.
        repository.lock_study_of_run(session, token)
    run = open_run(session, token)
    need_consent(run)
    checked = _checked(loaded, name, answers)
    if asked is not None and decides and run.slot != NO_SLOT:
        _refuse_another_group(loaded, run, asked.field, checked)
    _store(session, run, name, checked)
    screening.by_form(session, run, loaded.experiment, name, checked)
    if asked is not None and decides and run.status == "active" and run.slot == NO_SLOT:
        _assign_slot_of(session, run, loaded, group_of_answer(loaded.experiment, checked[asked.field]))
    if not decides or run.status != "active":
        return saved(run)
    session.flush()
    return saved(run).model_copy(update={"run": state_of(services, session, run, moment)})


def _checked(loaded: LoadedVersion, name: str, answers: Mapping[str, Any]) -> dict[str, Any]:
    forms = {form.name: form for form in loaded.experiment.forms}
    if name not in forms:
        raise FormUnknown(f"The study declares no form '{name}'{did_you_mean(name, forms)}.")
    return checked_answers(forms[name], answers)


def _store(session: Session, run: StudyRun, name: str, checked: dict[str, Any]) -> None:
    stored = repository.form_answer(session, run, name)
    if stored is None:
        session.add(FormAnswer(study_run_id=run.id, form=name, answers=checked))
    else:
        stored.answers, stored.saved_at = checked, now()


def _assign_slot_of(session: Session, run: StudyRun, loaded: LoadedVersion, group: str) -> None:
    """The run's place in its group; where none is left the run is screened out."""
    turns = grouping.open_turns(session, loaded.experiment, run.version_id, run.origin, group)
    if turns:
        assign_slot(session, run, loaded, turns)
    else:
        screening.by_full_group(session, run, group)


def _refuse_another_group(
    loaded: LoadedVersion, run: StudyRun, field: str, checked: Mapping[str, Any]
) -> None:
    if group_of_answer(loaded.experiment, checked[field]) != run.group_name:
        raise GroupDecided(f"Expected the answer to '{field}' as it was given: the trials follow from it.")
