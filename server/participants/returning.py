"""Who comes back to a visit, by what, and whether it may be taken up again.

A visit is taken up by the secret its browser keeps (the client id), by a personal link, by the resume code
that the page has shown, or by an address that was signed with the study's secret. A recruiter's id says whose
visit it is and opens nothing: it stands in addresses, lists and e-mails, and some recruiters count it up.
"""

from collections.abc import Mapping
from datetime import datetime, timedelta

from sqlalchemy.orm import Session

from experiments.definition import Experiment
from server.clock import now
from server.context import Services
from server.identities import repository as identities
from server.models import NO_SLOT, Link, Study, StudyRun
from server.participants import repository
from server.participants.identities import fits, pseudonym, resume_code, run_prefix
from server.participants.recruiter import Recruiter
from server.participants.refusals import (
    IdentifierInvalid,
    ResumeCodeNeeded,
    ResumeCodeWrong,
    RunLeft,
    RunTooOld,
    TakenPartAlready,
)
from server.participants.schemas import RunStart
from server.participants.signatures import is_of, is_signed
from server.tokens import hash_token


def name_of(link: Link, study: Study, identifier: str) -> str | None:
    """The study's pseudonym of the person who comes by this link; None where nothing tells people apart."""
    if link.kind == "personal":
        return pseudonym(study.pseudonym_key, f"link:{link.public_id}")
    return pseudonym(study.pseudonym_key, f"recruiter:{identifier}") if identifier else None


def settled_id(session: Session, link: Link, recruiter: Recruiter, parameters: Mapping[str, str]) -> str:
    """The id by which visits of one person are known; empty where the address names nobody.

    Earlier releases told ids of different case apart: a person who is known under the id exactly as it is
    written stays known under it. Previews take any id, since nobody is paid or counted by it.

    Raises
    ------
    IdentifierInvalid
        The id is not written as this recruiter writes its ids.
    """
    written = recruiter.participant(parameters)
    if written is None:
        return ""
    if link.kind == "preview":
        return recruiter.same_id(written)
    try:
        canonical = recruiter.canonical_id(parameters)
    except IdentifierInvalid:
        # Earlier releases took ids of any form.
        if identities.is_known(session, link.study.pseudonym_key, written):
            return written
        raise
    if canonical is None or canonical == written:
        return written
    return written if identities.is_known(session, link.study.pseudonym_key, written) else canonical


def known_run(
    services: Services, session: Session, link: Link, recruiter: Recruiter, start: RunStart
) -> StudyRun | None:
    """The run that this visitor has shown to be theirs; None where one begins."""
    run = repository.run_of_client(session, link, str(start.client_id))
    if run is None and start.resume_code is not None:
        return _run_of_code(services, session, link, start.resume_code)
    if run is None and link.kind == "personal":
        run = repository.latest_run(session, link)
    return _run_of_id(services, session, link, recruiter, start) if run is None else run


def _run_of_id(
    services: Services, session: Session, link: Link, recruiter: Recruiter, start: RunStart
) -> StudyRun | None:
    """The run of the recruiter's id where the address is signed that it began by; otherwise none."""
    if link.kind == "personal":
        return None
    signed = is_signed(services.settings.key, link.study.pseudonym_key, recruiter, start.query)
    if recruiter.kind == "generic" and not signed:
        return None
    identifier = settled_id(session, link, recruiter, start.query)
    name = name_of(link, link.study, identifier)
    other = repository.latest_run(session, link, name) if name else None
    if other is None:
        return None
    # Who began without a signature may be anybody who knew the id.
    if signed and is_of(recruiter, start.query, repository.parameters(session, other)):
        return other
    _refuse_by_id_alone(services.versions.get(session, other.version_id).experiment, other, start)
    return None


def count_code(services: Services, link_token: str, typed: str) -> None:
    """Count that a resume code was tried; refused where too many were.

    Before the transaction of the start, which may be tried again for the sake of others in its group. For
    each visit, so that who guesses at one keeps nobody from another.
    """
    services.resume_codes.hit(f"{hash_token(link_token)}:{run_prefix(typed)}")


def _run_of_code(services: Services, session: Session, link: Link, typed: str) -> StudyRun:
    prefix = run_prefix(typed)
    runs = repository.runs_beginning(session, link, prefix) if prefix else ()
    run = next((run for run in runs if fits(services.settings.key, run.public_id, typed)), None)
    if run is None:
        raise ResumeCodeWrong(
            "This is the resume code of no visit by this link; please compare it once more."
        )
    return run


def _refuse_by_id_alone(experiment: Experiment, run: StudyRun, start: RunStart) -> None:
    """Refuse who has only the recruiter's id of `run`, unless a visit beside it may begin."""
    if run.status != "active":
        raise TakenPartAlready("A visit under this sign-up is over; its resume code shows its end again.")
    refusal = refusal_to_resume(experiment, run)
    if refusal is not None:
        raise refusal
    if not start.anew and experiment.session.resume != "restart":
        raise ResumeCodeNeeded(
            "A visit under this sign-up has begun in another browser; its resume code is needed."
        )


def restarts(experiment: Experiment, run: StudyRun) -> bool:
    """True where coming back begins anew. Before consent there is nothing to begin anew."""
    return experiment.session.resume == "restart" and run.status == "active" and run.consented_at is not None


def refusal_to_resume(experiment: Experiment, run: StudyRun) -> RunLeft | RunTooOld | None:
    """Why this run may not be taken up again; None where it may, or where it is over and only looked at."""
    if run.status != "active" or run.origin == "preview":
        return None
    if now() > _oldest(experiment, run):
        hours = f"{experiment.session.maximum_age_hours:g}"
        return RunTooOld(f"This visit began more than {hours} hours ago and cannot be taken up again.")
    if experiment.session.resume == "block" and run.consented_at is not None:
        return RunLeft("This study must be done in one go; a visit that was left cannot be taken up again.")
    return None


def resumable_until(experiment: Experiment, run: StudyRun) -> datetime | None:
    """Until when a reloaded page may go on by itself, without a connection; None where it must ask first."""
    kept = experiment.session.resume == "resume" and run.status == "active" and run.origin != "preview"
    kept = kept and run.slot != NO_SLOT  # only the server knows which clips follow from an answer
    return _oldest(experiment, run) if kept else None


def shown_code(key: bytes, experiment: Experiment, link_kind: str, run_id: str) -> str | None:
    """The resume code to show; None where the link itself resumes, or nothing does."""
    by_code = link_kind == "general" and experiment.session.resume == "resume"
    return resume_code(key, run_id) if by_code else None


def _oldest(experiment: Experiment, run: StudyRun) -> datetime:
    return run.started_at + timedelta(hours=experiment.session.maximum_age_hours)
