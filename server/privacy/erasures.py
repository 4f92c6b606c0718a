"""Erasure on request, and the ledger of erasures, replayed at every restore."""

import json
import logging
import os
import secrets
from contextlib import suppress
from pathlib import Path
from typing import IO

from sqlalchemy.orm import Session

from experiments.assignment.groups import deciding
from experiments.files import whole_private_file
from server.accounts.audit import record
from server.accounts.identity import Identity, Operator
from server.accounts.repository import entries_on_run
from server.core.errors import Conflict, Invalid
from server.core.repository import run_called
from server.core.settings import Settings
from server.core.values import iso, now
from server.models import NO_SLOT, Study, StudyRun
from server.participation import identity_repository as identities
from server.participation import visit_repository
from server.results.schemas import Erased, HeldReport
from server.studies.lookup import definition_of

# The ledger of erasures: a file beside the database and outside its backups, replayed at every restore.
#
# It names runs by their public ids, which say nothing of a person.

LOG = logging.getLogger(__name__)
NAME = "erasures.ndjson"
KNOWN_FROM, KNOWN_UNTIL = "known_from", "known_until"


# Decision 0541: A ledger of erasures outside the backups.
def ledger(settings: Settings) -> Path:
    """The file; it may be missing where nobody was erased yet."""
    return settings.common_folder / NAME


def note(settings: Settings, runs: list[str]) -> None:
    """Write down that these runs (public ids) are erased; on disk when this returns."""
    _append(settings, "run", runs)


def note_identifiers(settings: Settings, runs: list[str]) -> None:
    """Write down that it is erased who these runs' persons are; their answers stay."""
    _append(settings, "identifiers_of", runs)


def begin_ledger(settings: Settings) -> None:
    """Make a ledger where there is none, which knows of erasures from now on: an older one may be lost."""
    path = ledger(settings)
    path.parent.mkdir(parents=True, exist_ok=True)
    with suppress(FileExistsError):
        handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        with os.fdopen(handle, "wb") as stream:
            stream.write(json.dumps({KNOWN_FROM: iso(now())}).encode() + b"\n")


def known_from(ledger_lines: bytes) -> str:
    """The first moment from which a ledger knows who was erased; empty where it was there from the start."""
    return _latest(ledger_lines, KNOWN_FROM)


def known_until(ledger_lines: bytes) -> str:
    """The last moment of which a copy knows who was erased; empty where it says none."""
    return _latest(ledger_lines, KNOWN_UNTIL, "erased_at")


def _latest(ledger_lines: bytes, *keys: str) -> str:
    """The latest moment under these keys; a line that a crash cut off is passed over."""
    moments = [""]
    for line in ledger_lines.splitlines():
        try:
            entry = json.loads(line)
            moments += [str(entry.get(key) or "") for key in keys]
        except (ValueError, AttributeError):
            continue
    return max(moments)


def _append(settings: Settings, key: str, runs: list[str]) -> None:
    lines = "".join(json.dumps({key: run, "erased_at": iso(now())}) + "\n" for run in runs)
    path = ledger(settings)
    path.parent.mkdir(parents=True, exist_ok=True)
    with os.fdopen(os.open(path, os.O_RDWR | os.O_APPEND | os.O_CREAT, 0o600), "r+b") as stream:
        stream.write(_end_of_torn_line(stream, path) + lines.encode())
        stream.flush()
        os.fsync(stream.fileno())


def _end_of_torn_line(stream: IO[bytes], path: Path) -> bytes:
    """What a line that a crash cut off lacks, so that it does not swallow the next one."""
    if stream.seek(0, os.SEEK_END) == 0:
        return b""
    stream.seek(-1, os.SEEK_END)
    if stream.read(1) == b"\n":
        return b""
    LOG.warning("%s: its last line was cut off; whether its run was erased the database tells", path)
    return b"\n"


def content(settings: Settings) -> bytes:
    """The ledger as it is; empty where nobody was erased."""
    path = ledger(settings)
    return path.read_bytes() if path.is_file() else b""


def merged(one: bytes, other: bytes) -> bytes:
    """The lines of both ledgers, each once; a line that a crash cut off is ended."""
    lines = dict.fromkeys(line for line in (one + b"\n" + other).splitlines() if line.strip())
    return b"".join(line + b"\n" for line in lines if KNOWN_UNTIL.encode() not in line)


def copy_for_backup(settings: Settings, before: bytes, moment: str) -> bytes:
    """The ledger as it is kept next to backups: what an earlier copy names too, and until when it knows."""
    return merged(before, content(settings)) + json.dumps({KNOWN_UNTIL: moment}).encode() + b"\n"


def take_over(settings: Settings, further: bytes) -> None:
    """Add what another copy of the ledger names.

    Parameters
    ----------
    further : bytes
        The copy, as a backup has it beside it.
    """
    both = merged(content(settings), further)
    if both == content(settings):
        return
    path = ledger(settings)
    path.parent.mkdir(parents=True, exist_ok=True)
    with whole_private_file(path) as stream:
        stream.write(both)


def noted(settings: Settings) -> list[str]:
    """The runs that were erased; a line that a crash cut off is passed over."""
    return _named(settings, "run")


def noted_identifiers(settings: Settings) -> list[str]:
    """The runs of which it was erased who took part."""
    return _named(settings, "identifiers_of")


def _named(settings: Settings, key: str) -> list[str]:
    path = ledger(settings)
    if not path.is_file():
        return []
    runs: dict[str, None] = {}
    for line in path.read_text(encoding="utf-8").splitlines():
        try:
            runs[json.loads(line)[key]] = None
        except (ValueError, KeyError, TypeError):
            continue
    return list(runs)


# Erasure on request: of a person's visits to a study, written down so that no restore brings them back.


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
        raise Invalid(f"To erase this run, confirm with its identifier {public_id}; got '{confirm}'.")
    if run.erased_at is not None:
        raise Conflict("This run's data were erased already.")
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
    note(settings, erased)
    return Erased(runs=erased, reports=reports, ledger=str(ledger(settings)))


def replay(session: Session, settings: Settings) -> int:
    """Erase again what the ledger names and the database holds; return how many runs that were."""
    erased = 0
    for public_id in noted(settings):
        run = run_called(session, public_id)
        if run is not None and run.erased_at is None:
            forget(session, run)
            record(session, None, "run erased", "run", public_id, again=True)
            erased += 1
    for public_id in noted_identifiers(settings):
        run = run_called(session, public_id)
        if run is not None and run.erased_at is None and forget_identifiers(session, run):
            record(session, None, "identifiers erased", "run", public_id, again=True)
    return erased


def forget_identifiers(session: Session, run: StudyRun) -> bool:
    """Delete who the person of a run is and leave the answers; False where nothing told."""
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
    if deciding(definition_of(run.version)) is not None:
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
