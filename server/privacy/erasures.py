"""Erasure on request: of a person's visits to a study, written down so that no restore brings them back."""

import secrets

from sqlalchemy.orm import Session

from experiments.assignment.groups import deciding_question
from server.accounts.audit import record
from server.accounts.identity import Identity, Operator
from server.accounts.repository import entries_on_run
from server.core.errors import Conflict, Invalid
from server.core.repository import run_called
from server.core.settings import Settings
from server.core.values import now
from server.models import NO_SLOT, Study, StudyRun
from server.participation import identity_repository as identities
from server.participation import visit_repository
from server.privacy.ledger import erasures_in_ledger, identifier_erasures_in_ledger, ledger_path, note_erased
from server.results.schemas import Erased, HeldReport
from server.studies.lookup import definition_of


def erase(
    session: Session,
    settings: Settings,
    study: Study,
    public_id: str,
    confirm: str,
    identity: Identity | Operator,
) -> Erased:
    """Delete one person's data for good, in all visits to the study that are known to be hers.

    Rows without content stay, so that counts stay right. The ledger is written before the database is
    committed: what it names a restore erases, though the commit may have failed.
    """
    run = visit_repository.find_run(session, study, public_id, lock=True)
    if confirm != public_id:
        raise Invalid(f"To erase this run, enter its identifier {public_id}; got '{confirm}'.")
    if run.erased_at is not None:
        raise Conflict("The data of this run were already erased.")
    every = visit_repository.every_visit(session, [run], lock=True)
    reports = [
        HeldReport(report=public, finished_at=finished)
        for public, finished in visit_repository.reports(session, study)
    ]
    for visit in every:
        ratings = forget(session, visit)
        record(session, identity, "run erased", "run", visit.public_id, study=study.name, ratings=ratings)
    session.flush()
    erased = [visit.public_id for visit in every]
    note_erased(settings, erased)
    return Erased(runs=erased, reports=reports, ledger=str(ledger_path(settings)))


def replay(session: Session, settings: Settings) -> int:
    """Erase again what the ledger names and the database holds; return how many runs that were."""
    erased = 0
    for public_id in erasures_in_ledger(settings):
        run = run_called(session, public_id)
        if run is not None and run.erased_at is None:
            forget(session, run)
            record(session, None, "run erased", "run", public_id, again=True)
            erased += 1
    for public_id in identifier_erasures_in_ledger(settings):
        run = run_called(session, public_id)
        if run is not None and run.erased_at is None and forget_identifiers(session, run):
            record(session, None, "identifiers erased", "run", public_id, again=True)
    return erased


def forget_identifiers(session: Session, run: StudyRun) -> bool:
    """Delete who the person of a run is and leave the answers; False if nothing identified them."""
    known = identities.drop_key(session, run)
    if run.completion_code:
        run.completion_code, known = "", True
    if run.link.kind == "personal" and run.link.label not in ("", "erased"):
        run.link.label, known = "erased", True
    return known


def forget(session: Session, run: StudyRun) -> int:
    """Delete what a run holds of its person; return how many ratings that were."""
    ratings = visit_repository.delete_personal_rows(session, run)
    run.participant, run.device = "erased", {}
    run.exclusion_reason, run.px_per_mm, run.viewing_distance_mm = None, None, None
    run.completion_code = ""
    if deciding_question(definition_of(run.version)) is not None:
        # The group, and the slot that it follows from, say what was answered.
        run.group_name, run.slot = "", NO_SLOT
    if run.link.kind == "personal":
        run.link.label = "erased"
    _forget_in_audit(session, run.public_id)
    # Nobody can go on with an erased run: its tokens fit nothing any more.
    run.token_hash, run.client_id = secrets.token_hex(32), secrets.token_hex(16)
    run.status = "withdrawn" if run.status == "active" else run.status
    run.erased_at = run.started_at = run.last_seen_at = now()
    run.consented_at = run.completed_at = run.excluded_at = None
    return ratings


def _forget_in_audit(session: Session, public_id: str) -> None:
    """Take from the audit log what was written about a person; that something was done stays."""
    for entry in entries_on_run(session, public_id):
        if "reason" in entry.details:
            entry.details, entry.details_salt = {**entry.details, "reason": "erased"}, None
