"""A run from consent to completion: what the page gets and what it reports."""

from datetime import datetime
from itertools import groupby
from typing import Any

from sqlalchemy.orm import Session

from experiments.errors import did_you_mean
from experiments.trials import KINDS
from server.clock import now
from server.context import Services
from server.evidence.schemas import Tickets
from server.evidence.service import judge_run
from server.evidence.tickets import issue, tickets
from server.models import NO_SLOT, Calibration, RunEvent, StudyRun
from server.participants import bounds, repository, screening
from server.participants.checks import shown_checks
from server.participants.completion import completion_code
from server.participants.links import find_link
from server.participants.lookup import find_run, open_run
from server.participants.refusals import (
    LanguageUnknown,
    ScreeningUndeclared,
)
from server.participants.returning import refusal_to_resume, resumable_until, shown_code
from server.participants.schemas import BlockInfo, CalibrationState, RunState, Saved, Stage
from server.participants.submissions import CalibrationResult, Event, ScreenOut, Unsupported
from server.participants.trial_list import trial_list
from server.repository import insert_once
from server.tokens import new_public_id
from server.trials.refusals import ConsentMissing
from server.trials.warnings import waiting
from server.versions import LoadedVersion

BEFORE_CONSENT = ("consent",)


def run_state(services: Services, session: Session, token: str, moment: datetime) -> RunState:
    """Everything the page needs to begin or to go on; refused where this run may not be taken up again."""
    run = find_run(session, token)
    if (
        refusal := refusal_to_resume(services.versions.get(session, run.version_id).experiment, run)
    ) is not None:
        raise refusal
    return state_of(services, session, run, moment)


def state_of(services: Services, session: Session, run: StudyRun, moment: datetime) -> RunState:
    """The run as the page gets it."""
    loaded = services.versions.get(session, run.version_id)
    experiment = loaded.experiment
    calibration = repository.latest_calibration(session, run)
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
        answered_forms=repository.answered_forms(session, run),
        awaits_group=run.slot == NO_SLOT,
        blocks=blocks,
        trials=trials,
        checks=shown_checks(experiment, run.language),
        elapsed_ms_before=run.elapsed_ms,
        completion_code=completion_code(session, run, loaded) if run.status == "complete" else None,
        resumable_until=resumable_until(experiment, run),
        resume_code=shown_code(
            services.settings.key, experiment, repository.link_kind(session, run), run.public_id
        ),
        server_time=moment,
        tickets=_tickets(services, run, loaded, moment),
        warning=waiting(session.connection(), run.id, experiment) if run.status == "active" else None,
    )


def _tickets(services: Services, run: StudyRun, loaded: LoadedVersion, moment: datetime) -> Tickets | None:
    if run.evidence != "asked" or run.status != "active":
        return None
    batch = issue(services.intake.key, run.public_id, moment)
    services.intake.clips.prepare(
        run.version_id, [(clip.sha256, clip.bytes) for clip in loaded.clips.values()]
    )
    plays = [1 + loaded.experiment.playback.max_repeats] * run.trials_total
    return Tickets(batch=batch.text, by_trial=tickets(services.intake.key, batch, plays))


def saved(run: StudyRun) -> Saved:
    """The answer to a write."""
    return Saved(saved_at=now(), stage=run.stage, status=run.status)


def save_consent(services: Services, session: Session, token: str, agreed: bool) -> Saved:
    """Store when the participant agreed; a refusal ends the run."""
    run = open_run(session, token)
    if not agreed:
        run.status = "withdrawn"
    elif run.consented_at is None:
        experiment = services.versions.get(session, run.version_id).experiment
        before = any(form.when == "before" for form in experiment.forms)
        calibrates = experiment.display.calibrate != "off"
        run.consented_at = now()
        run.stage = "forms_before" if before else "calibration" if calibrates else "instructions"
    return saved(run)


def save_calibration(session: Session, token: str, result: CalibrationResult) -> Saved:
    """Add a calibration; the ratings that follow carry it."""
    run = open_run(session, token)
    bounds.check_calibrations(repository.calibrations(session, run))
    session.add(Calibration(study_run_id=run.id, **result.model_dump()))
    run.px_per_mm, run.viewing_distance_mm = result.px_per_mm, result.viewing_distance_mm
    return saved(run)


def save_device(session: Session, token: str, device: dict[str, Any]) -> Saved:
    """Add what the page found out about browser and screen to what is known."""
    run = open_run(session, token)
    run.device = bounds.checked_device({**run.device, **device})
    return saved(run)


def screen_out_device(services: Services, session: Session, token: str, body: ScreenOut) -> Saved:
    """End the run because its browser or screen will not do, where the study screens devices."""
    run = open_run(session, token)
    if not screening.screens_devices(services.versions.get(session, run.version_id).experiment):
        raise ScreeningUndeclared("This study declares no screening by device; the run goes on.")
    screening.by_device(session, run, body.reason, body.data)
    return saved(run)


def save_stage(session: Session, token: str, stage: Stage) -> Saved:
    """Store where the participant is; beyond consent only after consent, also after completion.

    Where a run ended early it stays where it ended.
    """
    run = find_run(session, token, lock=True)
    if stage not in BEFORE_CONSENT and run.status == "active":
        need_consent(run)
    if run.status in ("active", "complete"):
        run.stage, run.last_seen_at = stage, now()
    return saved(run)


def save_language(services: Services, session: Session, token: str, language: str) -> Saved:
    """Change the language of the run."""
    run = open_run(session, token)
    languages = services.versions.get(session, run.version_id).experiment.languages
    if language not in languages:
        raise LanguageUnknown(f"The study has no texts in '{language}'{did_you_mean(language, languages)}.")
    run.language = language
    return saved(run)


def need_consent(run: StudyRun) -> None:
    """ConsentMissing where the participant has not agreed."""
    if run.consented_at is None:
        raise ConsentMissing("Nothing is stored before the participant has agreed; send the consent first.")


def save_events(session: Session, token: str, events: list[Event], moment: datetime) -> int:
    """Store events, each once; also after the run's end."""
    run = find_run(session, token, lock=True)
    run.last_seen_at = moment
    bounds.check_event_types(event.type for event in events)
    bounds.check_events([event.data for event in events], repository.events(session, run))
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
    data = bounds.checked_data({"reason": report.reason, **report.data})
    session.add(RunEvent(event_id=new_public_id(), link_id=link.id, type="unsupported", data=data))


def withdraw(session: Session, token: str) -> Saved:
    """End the run at the participant's wish; what was stored is kept and marked."""
    run = find_run(session, token, lock=True)
    if run.status == "active":
        run.status, run.last_seen_at = "withdrawn", now()
        run.evidence_verdict = judge_run(session, run).verdict
    return saved(run)
