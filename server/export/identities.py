"""Recruiters' ids beside the pseudonyms: an export of its own, for owners."""

import json
from collections.abc import Iterator
from typing import Any

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from experiments.columns.identities import IDENTITY_COLUMNS
from server.models import Link, RecruiterIdentity, Study, StudyRun

AT_ONCE = 500


def identity_count(session: Session, study: Study) -> int:
    """Rows that `identity_rows` gives below the header."""
    return session.scalar(_known(study).with_only_columns(func.count()).order_by(None)) or 0


def identity_rows(session: Session, study: Study) -> Iterator[list[Any]]:
    """Header and one row a visit whose person is known to the recruiter, or by the label of a link."""
    yield [column.name for column in IDENTITY_COLUMNS]
    for row in session.execute(_known(study).execution_options(yield_per=AT_ONCE)):
        label = row.label if row.kind == "personal" else ""
        yield [
            study.name,
            row.public_id,
            row.participant,
            row.identifier or "",
            label,
            json.dumps(row.parameters or {}, sort_keys=True, ensure_ascii=False),
        ]


def _known(study: Study) -> Any:
    columns = (
        StudyRun.public_id,
        StudyRun.participant,
        Link.kind,
        Link.label,
        RecruiterIdentity.identifier,
        RecruiterIdentity.parameters,
    )
    query = (
        select(*columns)
        .join(Link, Link.id == StudyRun.link_id)
        .outerjoin(RecruiterIdentity, RecruiterIdentity.study_run_id == StudyRun.id)
        .where(StudyRun.study_id == study.id, StudyRun.origin != "preview", StudyRun.erased_at.is_(None))
    )
    named = (Link.kind == "personal") | RecruiterIdentity.study_run_id.is_not(None)
    return query.where(named).order_by(StudyRun.id)
