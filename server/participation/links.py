"""What a link leads to, and how a run begins or is taken up again."""

import secrets
from datetime import timedelta
from typing import Literal
from uuid import UUID

from sqlalchemy.orm import Session

from experiments.assignment.groups import deciding_question
from experiments.declaration.experiment import Experiment
from experiments.declaration.tables import Display
from experiments.errors import did_you_mean
from experiments.kinds import expected_minutes
from server.core.settings import Settings
from server.core.values import derived_token, hash_token, new_public_id, new_token, now
from server.models import NO_SLOT, Link, Study, StudyRun
from server.participation import identity_repository as identities
from server.participation import places, returning, run_repository
from server.participation.current_run import checked_device, screens_devices
from server.participation.identity_keys import ParticipantIdentity
from server.participation.intake import ENFORCED_ORIGINS, Intake
from server.participation.places import assign_slot
from server.participation.recruiter import (
    Recruiter,
    refuse_other_recruiter,
    stored_recruiter,
    without_signature,
)
from server.participation.refusals import (
    LanguageUnknown,
    LinkExpired,
    LinkUnknown,
    StudyClosed,
    StudyFull,
    StudyPaused,
)
from server.participation.run_schemas import Gates, LinkedStudy, LinkState, Origin, RunStart, RunStarted
from server.participation.versions import LoadedVersion, Versions

RUN_PURPOSE = "run"
SEED_BITS = 53  # so that a seed survives JSON in every program
_REFUSALS = {
    "expired": (LinkExpired, "This link has expired; please ask the person who invited you for a new one."),
    "closed": (StudyClosed, "This study does not accept more participants."),
    "paused": (StudyPaused, "This study is paused. Please come back later."),
    "full": (StudyFull, "All slots of this study are taken. Please come back later."),
}


# Decision 0161: Tokens are derived from the secret key.
def new_seed() -> int:
    """A random seed of a run: what is shown to it, in what order, with which checks, follows from it."""
    return secrets.randbits(SEED_BITS)


def find_link(session: Session, token: str) -> Link:
    """The link with this token, or LinkUnknown."""
    link = run_repository.link_by_token(session, token)
    if link is None:
        raise LinkUnknown("This link is unknown. Please check that the address is complete.")
    return link


def recruiter_of(link: Link) -> Recruiter:
    """The recruiter of a link, or of its study."""
    # A link may have its own recruiter.
    return stored_recruiter(link.recruiter or link.study.recruiter)


def link_state(versions: Versions, session: Session, token: str) -> LinkState:
    """What a visitor sees before a run begins."""
    link = find_link(session, token)
    version_id = run_repository.active_version_id(session, link.study)
    experiment = versions.get(session, version_id).experiment
    # Only a personal link is of one person, whose run it can show.
    run = run_repository.latest_run(session, link) if link.kind == "personal" else None
    resumable = (
        run is not None and run.status == "active" and returning.refusal_to_resume(experiment, run) is None
    )
    # A run that must restart leaves the link open.
    over = run is not None and not resumable and not returning.must_restart(experiment, run)
    status = _status(session, link, link.study, version_id, experiment)
    return LinkState(
        study=LinkedStudy(
            name=link.study.name,
            title=experiment.title_for(experiment.languages[0]),
            titles={language: experiment.title_for(language) for language in experiment.languages},
            languages=list(experiment.languages),
            background=experiment.display.background,
            expected_minutes=expected_minutes(experiment),
        ),
        # A run under way goes on, even where no new one may begin.
        status="open" if resumable else "used" if over else status,
        kind=link.kind,
        resumable=resumable,
        screens_devices=screens_devices(experiment),
        way_back=recruiter_of(link).way_back(),
        gates=_gates(experiment.display),
    )


def _gates(display: Display) -> Gates:
    return Gates(
        minimum_width_px=display.minimum_width_px,
        minimum_height_px=display.minimum_height_px,
        allow_touch=display.allow_touch,
        full_screen=display.full_screen,
        calibrate=display.calibrate,
        viewing_distance=display.viewing_distance,
        inter_ocular_mm=display.inter_ocular_mm,
    )


def start_run(
    settings: Settings, versions: Versions, intake: Intake, session: Session, token: str, start: RunStart
) -> RunStarted:
    """Begin a run, or give back the one this browser, person or personal link already has."""
    link = find_link(session, token)
    # Lock the study first, as `complete_run` does: locking in different orders could deadlock.
    study = run_repository.lock_study(session, link.study_id)
    # By client id, personal link or the recruiter's ID: asking twice gives one run.
    known = returning.known_run(settings, versions, session, link, recruiter_of(link), start)
    if known is not None:
        experiment = versions.get(session, known.version_id).experiment
        if not returning.must_restart(experiment, known):
            return _resume_run(settings, experiment, known, start.client_id)
        with session.begin_nested():  # should a new visit be refused, the old one stays as it is
            known.status = "withdrawn"
            # Client ids are unique; the new run needs this one.
            known.client_id = f"{known.client_id}:{known.public_id}"
            session.flush()
            return _begin_run(settings, versions, intake, session, link, study, start)
    return _begin_run(settings, versions, intake, session, link, study, start)


def _begin_run(
    settings: Settings,
    versions: Versions,
    intake: Intake,
    session: Session,
    link: Link,
    study: Study,
    start: RunStart,
) -> RunStarted:
    """A new visit, or the reason why there is none."""
    version_id = run_repository.active_version_id(session, study)
    loaded = versions.get(session, version_id)
    places.check_parameter(loaded.experiment, link, start.query)
    status = _status(session, link, study, version_id, loaded.experiment)
    if status != "open":
        refusal, message = _REFUSALS[status]
        raise refusal(message)
    # A personal link names its person already, and simulated people come from no recruiter.
    if link.kind == "general" and not link.synthetic:
        refuse_other_recruiter(recruiter_of(link), start.query)
    if start.language not in loaded.experiment.languages:
        near = did_you_mean(start.language, loaded.experiment.languages)
        raise LanguageUnknown(f"The study has no texts in '{start.language}'{near}.")
    run, run_token = _new_run(settings, intake, session, link, study, version_id, loaded, start)
    return RunStarted(run_token=run_token, run_id=run.public_id, resumed=False)


Status = Literal["open", "closed", "expired", "full", "paused"]


def _status(session: Session, link: Link, study: Study, version_id: int, experiment: Experiment) -> Status:
    """Whether a new run may begin: open, or the reason why not."""
    # Before all else: an expired link is closed for previews as well.
    if link.expires_at is not None and link.expires_at <= now():
        return "expired"
    # Previews and simulations take no place and need no live study.
    if link.kind == "preview" or link.synthetic:
        return "open"
    if study.status not in ("pilot", "live") or places.leads_nowhere(experiment, link):
        return "closed"
    if study.paused:
        return "paused"
    # A run that is silent for longer gives its place to others.
    lease = timedelta(minutes=experiment.session.lease_minutes)
    for quota, column, ident in (
        (link.quota, StudyRun.link_id, link.id),
        (study.quota, StudyRun.study_id, study.id),
    ):
        if quota is not None:
            taken = run_repository.places_taken(session, column, ident, _origin(link, study), lease)
            if taken >= quota:
                return "full"
    turns = places.open_turns(session, experiment, version_id, _origin(link, study), _group(experiment, link))
    return "open" if turns else "full"


def _group(experiment: Experiment, link: Link) -> str:
    """The group that a link is for; empty where it decides none."""
    return link.group_name if experiment.groups.by == "link" else ""


def _origin(link: Link, study: Study) -> Origin:
    """Where the answers of a run come from that begins through this link at this moment."""
    if link.kind == "preview":
        return "preview"
    if link.synthetic:
        return "simulated"
    return "participant" if study.status == "live" else "pilot"


def _resume_run(settings: Settings, experiment: Experiment, run: StudyRun, client_id: UUID) -> RunStarted:
    refusal = returning.refusal_to_resume(experiment, run)
    if refusal is not None:
        raise refusal
    run.last_seen_at = now()
    # Derived: the same run has the same token, which is stored as a hash only.
    token = derived_token(settings.key, RUN_PURPOSE, run.public_id)
    run.token_hash = hash_token(token)
    # The same browser before consent has seen nothing yet: to it the run is new.
    again = run.client_id != str(client_id) or run.consented_at is not None
    return RunStarted(run_token=token, run_id=run.public_id, resumed=again)


def _new_run(
    settings: Settings,
    intake: Intake,
    session: Session,
    link: Link,
    study: Study,
    version_id: int,
    loaded: LoadedVersion,
    start: RunStart,
) -> tuple[StudyRun, str]:
    """Draw a seed, store the run, and give it its place, unless an answer is to decide its group."""
    origin, phase = _origin(link, study), "live" if study.status == "live" else "pilot"
    if origin == "preview":
        # Decision 0163: Previews are stored for a day and counted nowhere.
        keep = timedelta(hours=settings.preview_keep_hours)
        run_repository.delete_previews(session, study, now() - keep)
    public_id = new_public_id()
    token = derived_token(settings.key, RUN_PURPOSE, public_id)
    recruiter = recruiter_of(link)
    identifier = returning.settled_id(session, link, recruiter, start.query)
    evidence = _evidence(intake, origin, start)
    run = StudyRun(
        public_id=public_id,
        study_id=study.id,
        version_id=version_id,
        link_id=link.id,
        client_id=str(start.client_id),
        token_hash=hash_token(token),
        participant=returning.name_of(link, study, identifier) or public_id,
        phase=phase,
        origin=origin,
        language=start.language,
        seed=new_seed(),
        slot=NO_SLOT,
        trials_total=0,
        completion_code=new_token()[:10],
        device=checked_device(start.device),
        evidence=evidence,
        # The study's recruiter may be another one later.
        recruiter=recruiter.kind if identifier and not link.synthetic else "",
        view_tickets=start.view_tickets or evidence == "asked",
    )
    # The rows below refer to the number of this one.
    run_repository.add_all(session, [run])
    if start.query:
        written = recruiter.participant(start.query) or ""
        known_as = ParticipantIdentity(written, without_signature(recruiter, start.query))
        identities.store_identity(session, run, study.pseudonym_key, known_as, identifier)
    # Otherwise the group, and with it the slot, follows from an answer.
    if deciding_question(loaded.experiment) is None:
        group = _group(loaded.experiment, link)
        assign_slot(
            session, run, loaded, places.open_turns(session, loaded.experiment, version_id, origin, group)
        )
    return run, token


def _evidence(intake: Intake, origin: Origin, start: RunStart) -> Literal["none", "asked"]:
    """Whether evidence is asked for: of people always, of others where their page brings it."""
    enforced = origin in ENFORCED_ORIGINS or intake.rehearses
    return "asked" if start.evidence or enforced else "none"
