"""A run from consent to completion: what the page gets, what it reports, forms, and its end."""

from collections.abc import Mapping
from datetime import datetime
from itertools import groupby
from typing import Any, Literal

from sqlalchemy.orm import Session

from experiments.assignment.groups import deciding_question, group_of_answer
from experiments.declaration.experiment import Experiment
from experiments.declaration.forms import Form, is_empty
from experiments.errors import did_you_mean
from experiments.kinds import KINDS
from experiments.rules import ExcludeAttention
from server.core.repository import insert_once
from server.core.settings import Settings
from server.core.values import new_public_id, now, storable_value
from server.models import NO_SLOT, Calibration, FormAnswer, RunEvent, Study, StudyRun
from server.participation import current_run, places, run_repository
from server.participation.answer_schemas import Tickets
from server.participation.current_run import find_run, open_run
from server.participation.intake import Intake, issue, tickets
from server.participation.judgement import judge_run
from server.participation.links import find_link, recruiter_of
from server.participation.places import assign_slot, shown_checks, trial_list
from server.participation.refusals import (
    ConsentMissing,
    FormInvalid,
    FormsMissing,
    FormUnknown,
    GroupDecided,
    LanguageUnknown,
    RatingsMissing,
    RunClosed,
    ScreeningUndeclared,
)
from server.participation.returning import refusal_to_resume, resumable_until, shown_code
from server.participation.run_schemas import (
    BlockInfo,
    CalibrationResult,
    CalibrationState,
    Completion,
    Event,
    RunState,
    Saved,
    ScreenOut,
    Stage,
    Unsupported,
)
from server.participation.versions import LoadedVersion, Versions
from server.participation.warnings import EVENT, RULE, failed_checks, in_language, waiting_warning

# Check a form's answers against its declaration.


def checked_answers(form: Form, answers: Mapping[str, Any]) -> dict[str, Any]:
    """The answers in declared order; FormInvalid names every field that does not fit."""
    names = [field.name for field in form.fields]
    problems = {
        name: f"the form has no field '{name}'{did_you_mean(name, names)}"
        for name in answers
        if name not in names
    }
    kept: dict[str, Any] = {}
    for field in form.fields:
        value = answers.get(field.name)
        problem = field.problem(value)
        if problem:
            problems[field.name] = problem
        elif not is_empty(value):
            kept[field.name] = value
    # The message names one field; the page marks all of them from `fields`.
    if problems:
        name, problem = next(iter(problems.items()))
        raise FormInvalid(f"Form {form.name}, field {name}: {problem}.", fields=problems)
    return kept


# The end of a run: complete, or screened out; the code and the way back.


def complete_run(versions: Versions, session: Session, token: str) -> Completion:
    """Close the run once everything is answered, and give the code; asking again gives the same."""
    # Lock the study first, as a start does: locking in different orders could deadlock.
    study = run_repository.lock_study_of_run(session, token)
    run = find_run(session, token, lock=True)
    loaded = versions.get(session, run.version_id)
    if run.status == "active":
        _need_everything(session, run, loaded)
        run.status, run.stage, run.completed_at = "complete", "debrief", now()
        # One moment for both: the two columns then agree exactly.
        run.last_seen_at = run.completed_at
        run.evidence_verdict = judge_run(session, run).verdict
        _close_when_full(session, study, run)
    if run.status == "screened_out":
        # Screening may have ended the run before anything was judged.
        run.evidence_verdict = run.evidence_verdict or judge_run(session, run).verdict
        return _screened_out(session, run, loaded.experiment)
    # Withdrawn: the code is for participation to the end.
    if run.status != "complete":
        raise RunClosed(f"This visit is over ({run.status}) and has no completion code.")
    code = completion_code(session, run, loaded)
    parameters = storable_value(run_repository.parameters(session, run))
    address = recruiter_of(run.link).redirect(code, run.public_id, parameters)
    return Completion(status="complete", completion_code=code, redirect_url=address)


def _need_everything(session: Session, run: StudyRun, loaded: LoadedVersion) -> None:
    # The list knows which trials an adaptive series no longer needs; a plain count does not.
    trials = [trial.trial_index for trial in trial_list(session, run, loaded) if not trial.answered]
    if trials:
        message = f"{len(trials)} of {run.trials_total} trials are still to be answered."
        raise RatingsMissing(message, missing=trials)
    answered = run_repository.answered_forms(session, run)
    forms = [name for name in _required_forms(loaded.experiment) if name not in answered]
    if forms:
        message = f"Expected answers to every required question; still to be answered: {', '.join(forms)}."
        raise FormsMissing(message, missing=forms)


def _required_forms(experiment: Experiment) -> list[str]:
    return [form.name for form in experiment.forms if any(field.required for field in form.fields)]


def completion_code(session: Session, run: StudyRun, loaded: LoadedVersion) -> str:
    """The code of a complete run: another one where it failed too many attention checks."""
    rules = [rule for rule in loaded.experiment.exclusions if isinstance(rule, ExcludeAttention)]
    outcome: Literal["complete", "failed_check"] = "complete"
    failed = failed_checks(session.connection(), run.id, loaded.experiment) if rules else 0
    if rules and failed > rules[0].more_than:
        outcome = "failed_check"
    return recruiter_of(run.link).code(outcome, run.completion_code)


def _screened_out(session: Session, run: StudyRun, experiment: Experiment) -> Completion:
    recruiter = recruiter_of(run.link)
    parameters = storable_value(run_repository.parameters(session, run))
    declared, careless = experiment.warnings, run_repository.ended_by(session, run, EVENT) == RULE
    if careless and declared.code == "failed_check" and recruiter.code_failed_check:
        code: str | None = recruiter.code_failed_check
        address = recruiter.redirect(recruiter.code_failed_check, run.public_id, parameters)
    else:
        code = recruiter.code_screened_out or None
        address = recruiter.redirect_screened_out_to(run.public_id, parameters)
    why = in_language(declared.end_text, run.language, experiment.languages) if careless else None
    return Completion(status="screened_out", completion_code=code, redirect_url=address, reason=why)


def _close_when_full(session: Session, study: Study | None, run: StudyRun) -> None:
    # Previews and simulated runs never fill the quota of a study.
    if study is None or study.quota is None or run.origin not in ("participant", "pilot"):
        return
    # The count below is a query: this run's completion must be in the database first.
    session.flush()
    if run_repository.complete_runs(session, study, run.origin) >= study.quota:
        study.status, study.closed_at = "closed", now()


# A run from consent to completion: what the page gets and what it reports.

BEFORE_CONSENT = ("consent",)


def run_state(
    settings: Settings, versions: Versions, intake: Intake, session: Session, token: str, moment: datetime
) -> RunState:
    """Everything the page needs to begin or to go on; refused where this run may not be taken up again."""
    run = find_run(session, token)
    if (refusal := refusal_to_resume(versions.get(session, run.version_id).experiment, run)) is not None:
        raise refusal
    return state_of(settings, versions, intake, session, run, moment)


def state_of(
    settings: Settings, versions: Versions, intake: Intake, session: Session, run: StudyRun, moment: datetime
) -> RunState:
    """The run as the page gets it."""
    loaded = versions.get(session, run.version_id)
    experiment = loaded.experiment
    calibration = run_repository.latest_calibration(session, run)
    trials = trial_list(session, run, loaded)
    blocks = [
        BlockInfo(block=block, trials=len(list(group))) for block, group in groupby(trials, lambda t: t.block)
    ]
    return RunState(
        run_id=run.public_id,
        status=run.status,
        stage=run.stage,
        origin=run.origin,
        language=run.language,
        languages=list(experiment.languages),
        texts=experiment.texts[run.language],
        forms=experiment.forms,
        trial=KINDS[experiment.trial.kind].shown(experiment),
        display=experiment.display,
        playback=experiment.playback,
        break_seconds_min=experiment.blocks.break_seconds_min,
        consented_at=run.consented_at,
        calibration=CalibrationState.model_validate(calibration, from_attributes=True)
        if calibration
        else None,
        answered_forms=run_repository.answered_forms(session, run),
        awaits_group=run.slot == NO_SLOT,
        blocks=blocks,
        trials=trials,
        checks=shown_checks(experiment, run.language),
        elapsed_ms_before=run.elapsed_ms,
        # The code is a secret of complete runs: an open page must not hold it.
        completion_code=completion_code(session, run, loaded) if run.status == "complete" else None,
        resumable_until=resumable_until(experiment, run),
        resume_code=shown_code(
            settings.key, experiment, run_repository.link_kind(session, run), run.public_id
        ),
        server_time=moment,
        tickets=_tickets(intake, run, loaded, moment),
        # After the end a warning has no trial to be shown before.
        warning=waiting_warning(session.connection(), run.id, experiment) if run.status == "active" else None,
    )


def _tickets(intake: Intake, run: StudyRun, loaded: LoadedVersion, moment: datetime) -> Tickets | None:
    # Older pages start without asking for evidence, and closed runs answer nothing.
    if run.evidence != "asked" or run.status != "active":
        return None
    batch = issue(intake.key, run.public_id, moment)
    intake.clips.prepare(run.version_id, [(clip.sha256, clip.bytes) for clip in loaded.clips.values()])
    # A failed play may be repeated so often, and every play needs its ticket.
    plays = [1 + loaded.experiment.playback.max_repeats] * run.trials_total
    return Tickets(batch=batch.text, by_trial=tickets(intake.key, batch, plays))


def saved_response(run: StudyRun) -> Saved:
    """The answer to a write."""
    return Saved(saved_at=now(), stage=run.stage, status=run.status)


def save_consent(versions: Versions, session: Session, token: str, agreed: bool) -> Saved:
    """Store when the participant agreed; a refusal ends the run."""
    run = open_run(session, token)
    if not agreed:
        run.status = "withdrawn"
    # Sending consent again keeps the first moment.
    elif run.consented_at is None:
        experiment = versions.get(session, run.version_id).experiment
        before = any(form.when == "before" for form in experiment.forms)
        calibrates = experiment.display.calibrate != "off"
        run.consented_at = now()
        run.stage = "forms_before" if before else "calibration" if calibrates else "instructions"
    return saved_response(run)


def save_calibration(session: Session, token: str, result: CalibrationResult) -> Saved:
    """Add a calibration; the ratings that follow carry it."""
    run = open_run(session, token)
    current_run.check_calibrations(run_repository.calibrations(session, run))
    session.add(Calibration(study_run_id=run.id, **result.model_dump()))
    # Copied to the run: ratings take it from there.
    run.px_per_mm, run.viewing_distance_mm = result.px_per_mm, result.viewing_distance_mm
    return saved_response(run)


def save_device(session: Session, token: str, device: dict[str, Any]) -> Saved:
    """Add what the page found out about browser and screen to what is known."""
    run = open_run(session, token)
    # Later findings win; earlier ones that are not sent again stay.
    run.device = current_run.checked_device({**run.device, **device})
    return saved_response(run)


def screen_out_device(versions: Versions, session: Session, token: str, body: ScreenOut) -> Saved:
    """End the run because its browser or screen will not do, where the study screens devices."""
    run = open_run(session, token)
    if not current_run.screens_devices(versions.get(session, run.version_id).experiment):
        raise ScreeningUndeclared("This study declares no screening by device; the run goes on.")
    current_run.by_device(session, run, body.reason, body.data)
    return saved_response(run)


def save_stage(session: Session, token: str, stage: Stage) -> Saved:
    """Store where the participant is; beyond consent only after consent, also after completion.

    Where a run ended early it stays where it ended.
    """
    run = find_run(session, token, lock=True)
    if stage not in BEFORE_CONSENT and run.status == "active":
        need_consent(run)
    # Pages after completion (debrief, done) still report where they are.
    if run.status in ("active", "complete"):
        run.stage, run.last_seen_at = stage, now()
    return saved_response(run)


def save_language(versions: Versions, session: Session, token: str, language: str) -> Saved:
    """Change the language of the run."""
    run = open_run(session, token)
    languages = versions.get(session, run.version_id).experiment.languages
    if language not in languages:
        raise LanguageUnknown(f"The study has no texts in '{language}'{did_you_mean(language, languages)}.")
    run.language = language
    return saved_response(run)


def need_consent(run: StudyRun) -> None:
    """ConsentMissing where the participant has not agreed."""
    if run.consented_at is None:
        raise ConsentMissing("Nothing is stored before the participant has agreed; send the consent first.")


def save_events(session: Session, token: str, events: list[Event], moment: datetime) -> int:
    """Store events, each once; also after the run's end."""
    run = find_run(session, token, lock=True)
    run.last_seen_at = moment
    # Before anything is added: events come in batches, and a batch is stored whole or not.
    current_run.check_event_types(event.type for event in events)
    current_run.check_events([event.data for event in events], run_repository.events(session, run))
    rows = [
        {
            "event_id": str(event.id),
            "study_run_id": run.id,
            "type": event.type,
            "at_client": _with_zone(event),
            "received_at": run.last_seen_at,
            "data": event.data,
        }
        for event in events
    ]
    insert_once(session, RunEvent, rows)
    return len(rows)


def _with_zone(event: Event) -> Any:
    # A clock without a zone is taken as UTC, since the column has zones.
    return event.at if event.at is None or event.at.tzinfo else event.at.replace(tzinfo=now().tzinfo)


def save_unsupported(session: Session, report: Unsupported) -> None:
    """Store why a browser was turned away before a run began."""
    # There is no run yet, so the event belongs to the link.
    link = find_link(session, report.link_token)
    data = current_run.checked_data({"reason": report.reason, **report.data})
    session.add(RunEvent(event_id=new_public_id(), link_id=link.id, type="unsupported", data=data))


def withdraw(session: Session, token: str) -> Saved:
    """End the run at the participant's wish; what was stored is kept and marked."""
    run = find_run(session, token, lock=True)
    # A run that has ended keeps the status it ended with.
    if run.status == "active":
        run.status, run.last_seen_at = "withdrawn", now()
        run.evidence_verdict = judge_run(session, run).verdict
    return saved_response(run)


# A form's answers stored; one of them may end the run, or decide its group.


def save_form(
    settings: Settings,
    versions: Versions,
    intake: Intake,
    session: Session,
    token: str,
    name: str,
    answers: dict[str, Any],
    moment: datetime,
) -> Saved:
    """Store a form's answers once they fit the declaration; sending it again replaces them."""
    # Read without a lock, which is taken below in the order study, run.
    loaded = versions.get(session, find_run(session, token).version_id)
    asked = deciding_question(loaded.experiment)
    decides = asked is not None and asked.form == name
    if decides:
        # Lock the study first, as a start does: locking in different orders could deadlock.
        run_repository.lock_study_of_run(session, token)
    run = open_run(session, token)
    need_consent(run)
    checked = _checked_answers(loaded, name, answers)
    # The trials of the run are already chosen from the first answer.
    if asked is not None and decides and run.slot != NO_SLOT:
        _refuse_another_group(loaded, run, asked.field, checked)
    _store(session, run, name, checked)
    current_run.by_form(session, run, loaded.experiment, name, checked)
    # `by_form` may just have screened the run out.
    if asked is not None and decides and run.status == "active" and run.slot == NO_SLOT:
        _assign_slot_of(session, run, loaded, group_of_answer(loaded.experiment, checked[asked.field]))
    if not decides or run.status != "active":
        return saved_response(run)
    # The state below is read by queries, which must see the new slot.
    session.flush()
    return saved_response(run).model_copy(
        update={"run": state_of(settings, versions, intake, session, run, moment)}
    )


def _checked_answers(loaded: LoadedVersion, name: str, answers: Mapping[str, Any]) -> dict[str, Any]:
    forms = {form.name: form for form in loaded.experiment.forms}
    if name not in forms:
        raise FormUnknown(f"The study declares no form '{name}'{did_you_mean(name, forms)}.")
    return checked_answers(forms[name], answers)


def _store(session: Session, run: StudyRun, name: str, checked: dict[str, Any]) -> None:
    stored = run_repository.form_answer(session, run, name)
    if stored is None:
        session.add(FormAnswer(study_run_id=run.id, form=name, answers=checked))
    else:
        stored.answers, stored.saved_at = checked, now()


def _assign_slot_of(session: Session, run: StudyRun, loaded: LoadedVersion, group: str) -> None:
    """The run's place in its group; where none is left the run is screened out."""
    turns = places.open_turns(session, loaded.experiment, run.version_id, run.origin, group)
    if turns:
        assign_slot(session, run, loaded, turns)
    else:
        current_run.by_full_group(session, run, group)


def _refuse_another_group(
    loaded: LoadedVersion, run: StudyRun, field: str, checked: Mapping[str, Any]
) -> None:
    if group_of_answer(loaded.experiment, checked[field]) != run.group_name:
        raise GroupDecided(f"Expected the answer to '{field}' as it was given: the trials follow from it.")
