"""Subject access: everything that is stored of one person, in all visits known to be theirs."""

import json
from dataclasses import asdict
from typing import Any

from sqlalchemy.orm import Session

from server.accounts.audit import record
from server.accounts.identity import Identity, Operator
from server.accounts.repository import entries_on_run
from server.core.errors import Conflict, NotFound
from server.core.values import iso, now, storable_value
from server.models import Study, StudyRun
from server.participation.identity_keys import UnreadableError
from server.participation.identity_repository import known_as
from server.participation.visit_repository import every_visit, find_run
from server.privacy import repository

ABOUT = (
    "All data that this server stores about one person in this study, by table and column "
    "(docs/reference/columns.md explains the columns). It does not include secrets that open a visit, or "
    "completion codes of unfinished visits. Earlier downloads and reports are not included."
)


def visits_of(session: Session, study: Study, run: str, identifier: str) -> list[StudyRun]:
    """The visits of a person, identified by one of the runs or by the recruiter's ID.

    Raises
    ------
    NotFound
        Nobody is known so.
    Conflict
        The run is erased.
    """
    if not run:
        visits = repository.runs_known_as(session, study, identifier) if identifier else []
        if not visits:
            raise NotFound(f"The study '{study.name}' has no visit with this recruiter's ID.")
        return every_visit(session, visits)
    first = find_run(session, study, run)
    if first.erased_at is not None:
        raise Conflict("The data of this run were erased; nothing about the person remains.")
    return every_visit(session, [first])


def subject_access(
    session: Session, study: Study, visits: list[StudyRun], reader: Identity | Operator
) -> str:
    """The JSON of everything stored; that somebody took it is written down."""
    told = {
        "about": ABOUT,
        "study": study.name,
        "made_at": iso(now()),
        "visits": [_visit(session, visit) for visit in visits],
    }
    for visit in visits:
        record(session, reader, "subject access", "run", visit.public_id, study=study.name)
    return json.dumps(told, indent=1, ensure_ascii=False) + "\n"


def _visit(session: Session, run: StudyRun) -> dict[str, Any]:
    try:
        known = known_as(session, run)
    except UnreadableError as error:
        raise Conflict(f"{error}.") from error
    entries = [
        {"at": iso(entry.at), "action": entry.action, "details": storable_value(entry.details)}
        for entry in entries_on_run(session, run.public_id)
    ]
    return {
        "run": run.public_id,
        "recruiter": storable_value(asdict(known)) if known else None,
        "stored": repository.stored_rows(session, run),
        "audit": entries,
    }
