"""Everything that is stored of a visit, whatever table it is in."""

from collections.abc import Iterator
from typing import Any

from sqlalchemy import Table, select
from sqlalchemy.orm import Session

from server.identities.sealing import identifier_hash
from server.models import Base, Link, RecruiterIdentity, RunEvent, Study, StudyRun, View, ViewClip
from server.operations.rows import time_text
from server.participants.recruiter import Recruiter
from server.runs.repository import of_personal_link
from server.text import visible

RUN = "study_run_id"
KEYS = frozenset({"token_hash", "client_id", "sealed", "wrapped_key", "identifier_hash"})
"""Columns that open a visit or are the encrypted form of what is told in the open beside them."""
OF_LINKS = frozenset({"public_id", "kind", "created_at", "label"})
"""Of a link the rest is the study's: what it pays by, its key, its quota."""


def runs_known_as(session: Session, study: Study, identifier: str) -> list[StudyRun]:
    """The visits to a study under a recruiter's id, however written, erased ones left out.

    They are found by the keyed hash of the id.
    """
    written = {identifier, *(Recruiter(kind=kind).same_id(identifier) for kind in ("generic", "mturk"))}
    hashed = [identifier_hash(study.pseudonym_key, one) for one in sorted(written)]
    query = select(StudyRun).join(RecruiterIdentity, RecruiterIdentity.study_run_id == StudyRun.id)
    query = query.where(
        StudyRun.study_id == study.id, StudyRun.erased_at.is_(None), StudyRun.origin != "preview"
    )
    return list(
        session.scalars(query.where(RecruiterIdentity.identifier_hash.in_(hashed)).order_by(StudyRun.id))
    )


def stored(session: Session, run: StudyRun) -> dict[str, list[dict[str, Any]]]:
    """Table -> the rows that hang on a visit, its own and its link's included; empty tables are left out.

    Codes that pay are told once the visit is complete.
    """
    views = select(View.id).where(View.study_run_id == run.id)
    tables = {
        "study_runs": _rows(session, StudyRun.__table__, StudyRun.id == run.id),
        "links": _rows(session, Link.__table__, Link.id == run.link_id),
        "view_clips": _rows(session, ViewClip.__table__, ViewClip.view.in_(views)),
    }
    for table in Base.metadata.sorted_tables:
        if RUN in table.columns:
            of_run = table.columns[RUN] == run.id
            events = of_run | of_personal_link(run) if table is RunEvent.__table__ else of_run
            tables[table.name] = _rows(session, table, events)
    told = {name: list(rows) for name, rows in tables.items()}
    if run.status != "complete":
        told["study_runs"][0].pop("completion_code")
    personal = run.link.kind == "personal"
    told["links"] = [
        {name: row[name] for name in row if name in OF_LINKS and (personal or name != "label")}
        for row in told["links"]
    ]
    return {name: rows for name, rows in told.items() if rows}


def _rows(session: Session, table: Any, condition: Any) -> Iterator[dict[str, Any]]:
    known: Table = table
    for row in session.execute(select(known).where(condition).order_by(*known.primary_key)).mappings():
        kept = {name: value for name, value in row.items() if name not in KEYS}
        if kept.keys() - {RUN}:
            yield {
                name: time_text(value) if hasattr(value, "isoformat") else visible(value)
                for name, value in kept.items()
            }
