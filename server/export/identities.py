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
            person.known_as.identifier,
            person.label if person.link_kind == "personal" else "",
            json.dumps(dict(person.known_as.parameters), sort_keys=True, ensure_ascii=False),
        ]


def check_readable(session: Session, study: Study) -> None:
    """See that every id opens before the first is given.

    Raises
    ------
    UnreadableError
        A key is under another secret key.
    """
    for _ in repository.known_people(session, study):
        pass
