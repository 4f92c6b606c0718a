"""A run from consent to completion: what the page gets and what it reports."""

from itertools import groupby
from typing import Any, Literal

from sqlalchemy.orm import Session

from experiments.errors import did_you_mean
from experiments.rules import ExcludeAttention
from server.clock import now
from server.context import Services
from server.db import insert_once
from server.models import Calibration, FormAnswer, RunEvent, StudyRun
from server.participants import repository
from server.participants.forms import checked_answers
from server.participants.links import find_link, recruiter_of
from server.participants.refusals import (
    ConsentMissing,
    FormUnknown,
    LanguageUnknown,
    RatingsMissing,
    RunClosed,
    RunUnknown,
)
from server.participants.schemas import (
    BlockInfo,
    CalibrationResult,
    CalibrationState,
    Completion,
    Event,
    RunState,
    Saved,
    Stage,
    TrialInfo,
    Unsupported,
)
from server.tokens import new_public_id
from server.trials.verdict import is_settled
from server.versions import LoadedVersion

BEFORE_CONSENT = ("consent",)


def find_run(session: Session, token: str, *, lock: bool = False) -> StudyRun:
    """The run with this token, or RunUnknown."""
    run = repository.run_by_token(session, token, lock=lock)
    if run is None:
        raise RunUnknown(
            "This visit is not known; please open the link you were given again.",
            headers={"www-authenticate": "Bearer"},
        )
    return run


def open_run(session: Session, token: str) -> StudyRun:
    """The run with this token, marked as seen; RunClosed where it is over."""
    run = find_run(session, token, lock=True)
    if run.status != "active":
        raise RunClosed(f"This visit is over ({run.status.replace('_', ' ')}); nothing more is stored.")
    run.last_seen_at = now()
    return run


def run_state(services: Services, session: Session, token: str) -> RunState:
    """Everything the page needs to begin or to go on."""
    run = find_run(session, token)
    loaded = services.versions.get(session, run.version_id)
    experiment = loaded.experiment
    calibration = repository.latest_calibration(session, run)
    trials = _trials(session, run, loaded)
    blocks = [
        BlockInfo(block=block, trials=len(list(group))) for block, group in groupby(trials, lambda t: t.block)
    ]
    return RunState(
        run_id=run.public_id,
        status=run.status,
        stage=run.stage,
        preview=run.preview,
        synthetic=run.synthetic,
        language=run.language,
        languages=list(experiment.languages),
        texts=experiment.texts[run.language].model_dump(),
        forms=[form.model_dump(mode="json") for form in experiment.forms],
        trial=experiment.trial.model_dump(mode="json"),
        display=experiment.display.model_dump(mode="json"),
        playback=experiment.playback.model_dump(mode="json"),
        break_seconds_min=experiment.blocks.break_seconds_min,
        consented_at=run.consented_at,
        calibration=CalibrationState.model_validate(calibration, from_attributes=True)
        if calibration
        else None,
        answered_forms=repository.answered_forms(session, run),
        blocks=blocks,
        trials=trials,
        elapsed_ms_before=run.elapsed_ms,
        completion_code=_code(session, run, loaded) if run.status == "complete" else None,
        server_time=now(),
    )


def _trials(session: Session, run: StudyRun, loaded: LoadedVersion) -> list[TrialInfo]:
    done = repository.plays(session, run)
    most = loaded.experiment.playback.max_repeats
    trials = []
    for row in repository.trials(session, run):
        clip = loaded.clips[row.version_clip_id] if row.version_clip_id is not None else None
        plays = done.get(row.trial_index, [])
        settled = any(is_settled(row.kind, play, verdict, most) for play, verdict in plays)
        trials.append(
            TrialInfo(
                trial_index=row.trial_index,
                kind=row.kind,
                block=row.block,
                clip_sha256=clip.sha256 if clip else None,
                clip_url=f"/clips/{clip.sha256}.mp4" if clip else None,
                frames=clip.frames if clip else None,
                fps=clip.fps if clip else None,
                bytes=clip.bytes if clip else None,
                width_px=clip.width_px if clip else None,
                height_px=clip.height_px if clip else None,
                width_mm=clip.width_mm if clip else None,
                inter_ocular_px=loaded.inter_ocular_px if clip else None,
                prompt=_prompt(loaded, run.language, row.expected_response),
                plays_done=len(plays),
                plays_wanted=len(plays) if settled else len(plays) + 1,
                answered=settled,
            )
        )
    return trials


def _prompt(loaded: LoadedVersion, language: str, expected: int | None) -> str | None:
    if expected is None:
        return None
    texts = loaded.experiment.attention.text
    text = texts.get(language) or texts.get("en") or next(iter(texts.values()))
    return text.replace("{response}", str(expected))


def _saved(run: StudyRun) -> Saved:
    return Saved(saved_at=now(), stage=run.stage, status=run.status)


def save_consent(services: Services, session: Session, token: str, agreed: bool) -> Saved:
    """Store when the participant agreed; a refusal ends the run."""
    run = open_run(session, token)
    if not agreed:
        run.status, run.stage = "withdrawn", "done"
    elif run.consented_at is None:
        experiment = services.versions.get(session, run.version_id).experiment
        before = any(form.when == "before" for form in experiment.forms)
        calibrates = experiment.display.calibrate != "off"
        run.consented_at = now()
        run.stage = "forms_before" if before else "calibration" if calibrates else "instructions"
    return _saved(run)


def save_calibration(session: Session, token: str, result: CalibrationResult) -> Saved:
    """Add a calibration; the ratings that follow carry it."""
    run = open_run(session, token)
    session.add(Calibration(study_run_id=run.id, **result.model_dump()))
    run.px_per_mm, run.viewing_distance_mm = result.px_per_mm, result.viewing_distance_mm
    return _saved(run)


def save_device(session: Session, token: str, device: dict[str, Any]) -> Saved:
    """Add what the page found out about browser and screen to what is known."""
    run = open_run(session, token)
    run.device = {**run.device, **device}
    return _saved(run)


def save_form(services: Services, session: Session, token: str, name: str, answers: dict[str, Any]) -> Saved:
    """Store a form's answers once they fit the declaration; sending it again replaces them."""
    run = open_run(session, token)
    _need_consent(run)
    forms = {form.name: form for form in services.versions.get(session, run.version_id).experiment.forms}
    if name not in forms:
        raise FormUnknown(f"The study declares no form '{name}'{did_you_mean(name, forms)}.")
    checked = checked_answers(forms[name], answers)
    stored = repository.form_answer(session, run, name)
    if stored is None:
        session.add(FormAnswer(study_run_id=run.id, form=name, answers=checked))
    else:
        stored.answers, stored.saved_at = checked, now()
    return _saved(run)


def save_stage(session: Session, token: str, stage: Stage) -> Saved:
    """Store where the participant is; beyond consent only after consent, also after completion."""
    run = find_run(session, token, lock=True)
    if stage not in BEFORE_CONSENT and run.status == "active":
        _need_consent(run)
    run.stage, run.last_seen_at = stage, now()
    return _saved(run)


def save_language(services: Services, session: Session, token: str, language: str) -> Saved:
    """Change the language of the run."""
    run = open_run(session, token)
    languages = services.versions.get(session, run.version_id).experiment.languages
    if language not in languages:
        raise LanguageUnknown(f"The study has no texts in '{language}'{did_you_mean(language, languages)}.")
    run.language = language
    return _saved(run)


def _need_consent(run: StudyRun) -> None:
    if run.consented_at is None:
        raise ConsentMissing("Nothing is stored before the participant has agreed; send the consent first.")


def save_events(session: Session, token: str, events: list[Event]) -> int:
    """Store events, each once; also after the run's end."""
    run = find_run(session, token, lock=True)
    run.last_seen_at = now()
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
    return event.at if event.at is None or event.at.tzinfo else event.at.replace(tzinfo=now().tzinfo)


def save_unsupported(session: Session, report: Unsupported) -> None:
    """Store why a browser was turned away before a run began."""
    link = find_link(session, report.link_token)
    data = {"reason": report.reason, **report.data}
    session.add(RunEvent(event_id=new_public_id(), link_id=link.id, type="unsupported", data=data))


def complete_run(services: Services, session: Session, token: str) -> Completion:
    """Close the run once every trial is answered, and give the code; asking again gives the same."""
    run = find_run(session, token, lock=True)
    loaded = services.versions.get(session, run.version_id)
    if run.status == "active":
        missing = [trial.trial_index for trial in _trials(session, run, loaded) if not trial.answered]
        if missing:
            message = f"{len(missing)} of {run.trials_total} trials are still to be answered."
            raise RatingsMissing(message, missing=missing)
        run.status, run.stage, run.completed_at = "complete", "debrief", now()
        run.last_seen_at = run.completed_at
        _close_when_full(session, run)
    elif run.status != "complete":
        raise RunClosed(f"This visit is over ({run.status.replace('_', ' ')}) and has no completion code.")
    code = _code(session, run, loaded)
    address = recruiter_of(run.link).redirect(code, run.public_id, run.recruiter_parameters)
    return Completion(completion_code=code, redirect_url=address)


def _code(session: Session, run: StudyRun, loaded: LoadedVersion) -> str:
    rules = [rule for rule in loaded.experiment.exclusions if isinstance(rule, ExcludeAttention)]
    outcome: Literal["complete", "failed_check"] = "complete"
    if rules and repository.failed_checks(session, run) > rules[0].more_than:
        outcome = "failed_check"
    return recruiter_of(run.link).code(outcome, run.completion_code)


def _close_when_full(session: Session, run: StudyRun) -> None:
    study = repository.lock_study(session, run.study_id)
    if study.quota is None or study.status not in ("pilot", "live") or run.preview:
        return
    session.flush()
    if repository.complete_runs(session, study, run.phase) >= study.quota:
        study.status, study.closed_at = "closed", now()


def withdraw(session: Session, token: str) -> Saved:
    """End the run at the participant's wish; what was stored is kept and marked."""
    run = find_run(session, token, lock=True)
    if run.status == "active":
        run.status, run.stage, run.last_seen_at = "withdrawn", "done", now()
    return _saved(run)
