"""The end of a run: complete, or screened out; the code and the way back."""

from typing import Literal

from sqlalchemy.orm import Session

from experiments.definition import Experiment
from experiments.rules import ExcludeAttention
from server.clock import now
from server.context import Services
from server.evidence.service import judge_run
from server.models import Study, StudyRun
from server.participants import places_repository, repository
from server.participants.links import recruiter_of
from server.participants.lookup import find_run
from server.participants.refusals import FormsMissing, RatingsMissing
from server.participants.schemas import Completion
from server.participants.trial_list import trial_list
from server.text import visible
from server.trials.attention import EVENT, failed_checks
from server.trials.refusals import RunClosed
from server.trials.warnings import RULE, in_language
from server.versions import LoadedVersion


def complete_run(services: Services, session: Session, token: str) -> Completion:
    """Close the run once everything is answered, and give the code; asking again gives the same."""
    # The study first, as in a start: two requests that lock in two orders would wait for each other.
    study = repository.lock_study_of_run(session, token)
    run = find_run(session, token, lock=True)
    loaded = services.versions.get(session, run.version_id)
    if run.status == "active":
        _need_everything(session, run, loaded)
        run.status, run.stage, run.completed_at = "complete", "debrief", now()
        run.last_seen_at = run.completed_at
        run.evidence_verdict = judge_run(session, run).verdict
        _close_when_full(session, study, run)
    if run.status == "screened_out":
        run.evidence_verdict = run.evidence_verdict or judge_run(session, run).verdict
        return _screened_out(session, run, loaded.experiment)
    if run.status != "complete":
        raise RunClosed(f"This visit is over ({run.status}) and has no completion code.")
    code = completion_code(session, run, loaded)
    parameters = visible(repository.parameters(session, run))
    address = recruiter_of(run.link).redirect(code, run.public_id, parameters)
    return Completion(status="complete", completion_code=code, redirect_url=address)


def _need_everything(session: Session, run: StudyRun, loaded: LoadedVersion) -> None:
    trials = [trial.trial_index for trial in trial_list(session, run, loaded) if not trial.answered]
    if trials:
        message = f"{len(trials)} of {run.trials_total} trials are still to be answered."
        raise RatingsMissing(message, missing=trials)
    answered = repository.answered_forms(session, run)
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
    parameters = visible(repository.parameters(session, run))
    declared, careless = experiment.warnings, repository.ended_by(session, run, EVENT) == RULE
    if careless and declared.code == "failed_check" and recruiter.code_failed_check:
        code: str | None = recruiter.code_failed_check
        address = recruiter.redirect(recruiter.code_failed_check, run.public_id, parameters)
    else:
        code = recruiter.code_screened_out or None
        address = recruiter.redirect_screened_out_to(run.public_id, parameters)
    why = in_language(declared.end_text, run.language, experiment.languages) if careless else None
    return Completion(status="screened_out", completion_code=code, redirect_url=address, reason=why)


def _close_when_full(session: Session, study: Study | None, run: StudyRun) -> None:
    if study is None or study.quota is None or run.origin not in ("participant", "pilot"):
        return
    session.flush()
    if places_repository.complete_runs(session, study, run.origin) >= study.quota:
        study.status, study.closed_at = "closed", now()
