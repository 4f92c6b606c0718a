"""Recruiters' ids beside the pseudonyms: an export of its own, for owners."""

import json
from collections.abc import Iterator
from typing import Any

from sqlalchemy.orm import Session

from experiments.columns.identities import IDENTITY_COLUMNS
from server.export import repository
from server.models import Study


def identity_rows(session: Session, study: Study) -> Iterator[list[Any]]:
    """Header and one row a visit whose person is known to the recruiter, or by the label of a link."""
    yield [column.name for column in IDENTITY_COLUMNS]
    for person in repository.known_people(session, study):
        yield [
            study.name,
            person.run,
            person.participant,
            person.identifier or "",
            person.label if person.link_kind == "personal" else "",
            json.dumps(person.parameters or {}, sort_keys=True, ensure_ascii=False),
        ]
