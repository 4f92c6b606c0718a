"""How a returning visitor is recognized, by code or address, and whether the visit may be continued."""

import hashlib
import hmac
from collections.abc import Mapping
from datetime import datetime, timedelta

from sqlalchemy.orm import Session

from experiments.declaration.experiment import Experiment
from server.core.limits import RateLimit
from server.core.settings import Settings
from server.core.values import hash_token, now
from server.models import NO_SLOT, Link, Study, StudyRun
from server.participation import identity_repository as identities
from server.participation import run_repository
from server.participation.recruiter import Recruiter, is_of, is_signed
from server.participation.refusals import (
    IdentifierInvalid,
    ResumeCodeNeeded,
    ResumeCodeWrong,
    RunLeft,
    RunTooOld,
    TakenPartAlready,
)
from server.participation.run_schemas import RunStart
from server.participation.versions import Versions

# Pseudonyms of participants, and the code by which a rater takes up a visit on another device.
#
# A participant's name in pages and exports is `p` and twelve hexadecimal digits of HMAC-SHA-256(k, id),
# with k the study's own key and id what the recruiter calls the person, or the personal link: the same for
# every visit of that person to the study, another in every other study, and not to be made or undone
# without the key.
#
# A resume code is twelve signs in three groups. The first four identify the visit (20 bits of its public id),
# the other eight (40 bits) are derived from the installation's key. A recruiter's ID identifies a person but
# does not let them in, because many people know it. Only the person who saw the page knows the code.

CODE_PURPOSE = "resume"
_SIGNS = "0123456789ABCDEFGHJKMNPQRSTVWXYZ"
"""Crockford's base 32: no I, L, O, U, so that a code can be read aloud and copied by hand."""
_READ_AS = str.maketrans({"I": "1", "L": "1", "O": "0"})
_GROUP, _SECRET_SIGNS, _BITS = 4, 8, 5
_HEX_DIGITS = _GROUP * _BITS // 4
CODE_SIGNS = _GROUP + _SECRET_SIGNS


def pseudonym(study_key: str, identifier: str) -> str:
    """The name of a person within one study."""
    digest = hmac.digest(
        # Addresses may hold halves of characters; a person who has one must still get a name.
        bytes.fromhex(study_key),
        identifier.encode("utf-8", "surrogatepass"),
        hashlib.sha256,
    )
    # 48 bits: among a million people the chance that two share a name is 0.2 %.
    return f"p{digest.hex()[:12]}"


def resume_code(key: bytes, public_id: str) -> str:
    """The code of the run with this public id, as the page shows it."""
    digest = hmac.digest(key, f"{CODE_PURPOSE}:{public_id}".encode(), hashlib.sha256)
    secret = int.from_bytes(digest[:8], "big") >> (64 - _SECRET_SIGNS * _BITS)
    signs = _code_text(int(public_id[:_HEX_DIGITS], 16), _GROUP) + _code_text(secret, _SECRET_SIGNS)
    return "-".join(signs[start : start + _GROUP] for start in range(0, CODE_SIGNS, _GROUP))


def run_prefix(typed: str) -> str | None:
    """How the public id of the run of a typed code begins; None if it is not a code."""
    signs = _signs(typed)
    if len(signs) != CODE_SIGNS or not set(signs) <= set(_SIGNS):
        return None
    number = 0
    for sign in signs[:_GROUP]:
        number = number << _BITS | _SIGNS.index(sign)
    return f"{number:0{_HEX_DIGITS}x}"


def code_fits(key: bytes, public_id: str, typed: str) -> bool:
    """Whether the typed code is that of this run."""
    # In constant time, as the code is a secret: the time of an answer must not show how much of it was
    # right.
    return hmac.compare_digest(_signs(resume_code(key, public_id)).encode(), _signs(typed).encode())


def _code_text(number: int, signs: int) -> str:
    return "".join(_SIGNS[number >> _BITS * start & 31] for start in reversed(range(signs)))


def _signs(typed: str) -> str:
    # Typed by hand: case, blanks and hyphens do not matter, nor do letters that look like digits.
    return "".join(typed.upper().replace("-", " ").split()).translate(_READ_AS)


# How a returning visitor is recognized, and whether the visit may be continued.
#
# A visit is continued by the secret its browser keeps (the client id), by a personal link, by the resume
# code that the page has shown, or by an address that was signed with the study's secret. A recruiter's ID
# identifies the visit but opens nothing: it is in addresses, lists and e-mails, and some recruiters number
# their IDs consecutively.


def name_of(link: Link, study: Study, identifier: str) -> str | None:
    """The study's pseudonym of the person who comes by this link; None where nothing tells people apart."""
    if link.kind == "personal":
        return pseudonym(study.pseudonym_key, f"link:{link.public_id}")
    return pseudonym(study.pseudonym_key, f"recruiter:{identifier}") if identifier else None


def settled_id(session: Session, link: Link, recruiter: Recruiter, parameters: Mapping[str, str]) -> str:
    """The id by which visits of one person are known; empty where the address names nobody.

    Earlier releases distinguished ids of different case: a person who is known under the id exactly as it is
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
    settings: Settings,
    versions: Versions,
    session: Session,
    link: Link,
    recruiter: Recruiter,
    start: RunStart,
) -> StudyRun | None:
    """The run that this visitor has shown to be theirs; None where one begins."""
    # From the strongest proof to the weakest; the browser's own secret needs nobody to type anything.
    run = run_repository.run_of_client(session, link, str(start.client_id))
    if run is None and start.resume_code is not None:
        return _run_of_code(settings, session, link, start.resume_code)
    if run is None and link.kind == "personal":
        run = run_repository.latest_run(session, link)
    return _run_of_id(settings, versions, session, link, recruiter, start) if run is None else run


def _run_of_id(
    settings: Settings,
    versions: Versions,
    session: Session,
    link: Link,
    recruiter: Recruiter,
    start: RunStart,
) -> StudyRun | None:
    """The run that began with this recruiter ID by this signed address; otherwise None."""
    # A personal link is the person: an id in its address must not lead to somebody else's visit.
    if link.kind == "personal":
        return None
    signed = is_signed(settings.key, link.study.pseudonym_key, recruiter, start.query)
    if recruiter.kind == "generic" and not signed:
        # Anybody can put any id into such an address: unsigned, it neither opens nor refuses a visit.
        return None
    identifier = settled_id(session, link, recruiter, start.query)
    name = name_of(link, link.study, identifier)
    other = run_repository.latest_run(session, link, name) if name else None
    if other is None:
        return None
    # A visit that began without a signature may belong to anybody who knew the id.
    if signed and is_of(recruiter, start.query, run_repository.parameters(session, other)):
        return other
    _refuse_by_id_alone(versions.get(session, other.version_id).experiment, other, start)
    return None


def count_code(resume_codes: RateLimit, link_token: str, typed: str) -> None:
    """Count a try of a resume code; refuse it if there were too many.

    Counted before the start's transaction, which the group commit may retry. Counted per visit, so that
    guessing one code does not block others.
    """
    resume_codes.hit(f"{hash_token(link_token)}:{run_prefix(typed)}")


def _run_of_code(settings: Settings, session: Session, link: Link, typed: str) -> StudyRun:
    prefix = run_prefix(typed)
    runs = run_repository.runs_beginning(session, link, prefix) if prefix else ()
    # The prefix may fit several visits: only the secret part decides which one is meant.
    run = next((run for run in runs if code_fits(settings.key, run.public_id, typed)), None)
    if run is None:
        raise ResumeCodeWrong("This link has no visit with this resume code. Please check the code.")
    return run


def _refuse_by_id_alone(experiment: Experiment, run: StudyRun, start: RunStart) -> None:
    """Refuse a person who has only the recruiter's ID of `run`, unless another visit may begin."""
    if run.status != "active":
        raise TakenPartAlready(
            "The visit with this sign-up is complete. Its resume code shows the last page again."
        )
    refusal = refusal_to_resume(experiment, run)
    if refusal is not None:
        raise refusal
    if not start.anew and experiment.session.resume != "restart":
        raise ResumeCodeNeeded(
            "A visit with this sign-up was started in another browser. Its resume code is required."
        )


def must_restart(experiment: Experiment, run: StudyRun) -> bool:
    """True if coming back starts over. Before consent there is nothing to start over."""
    return experiment.session.resume == "restart" and run.status == "active" and run.consented_at is not None


def refusal_to_resume(experiment: Experiment, run: StudyRun) -> RunLeft | RunTooOld | None:
    """Why this run may not be taken up again; None where it may, or where it is over and only looked at."""
    if run.status != "active" or run.origin == "preview":
        return None
    if now() > _too_old_at(experiment, run):
        hours = f"{experiment.session.maximum_age_hours:g}"
        return RunTooOld(f"This visit began more than {hours} hours ago and cannot be continued.")
    if experiment.session.resume == "block" and run.consented_at is not None:
        return RunLeft(
            "This study must be completed without interruption. A visit that was left cannot be continued."
        )
    return None


def resumable_until(experiment: Experiment, run: StudyRun) -> datetime | None:
    """Until when a reloaded page may go on by itself, without a connection; None where it must ask first."""
    kept = experiment.session.resume == "resume" and run.status == "active" and run.origin != "preview"
    kept = kept and run.slot != NO_SLOT  # only the server knows which clips follow from an answer
    return _too_old_at(experiment, run) if kept else None


def shown_code(key: bytes, experiment: Experiment, link_kind: str, run_id: str) -> str | None:
    """The resume code to show; None where the link itself resumes, or nothing does."""
    by_code = link_kind == "general" and experiment.session.resume == "resume"
    return resume_code(key, run_id) if by_code else None


def _too_old_at(experiment: Experiment, run: StudyRun) -> datetime:
    return run.started_at + timedelta(hours=experiment.session.maximum_age_hours)
