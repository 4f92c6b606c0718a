"""Links into studies, and how many runs each has."""

import json
from collections.abc import Sequence
from typing import Any

from sqlalchemy import Select, case, func, insert, select
from sqlalchemy.orm import Session

from server.models import Link, Study, StudyRun


def add_links(session: Session, study: Study, rows: Sequence[dict[str, Any]]) -> None:
    """Store prepared links in one statement, so that raters do not wait for a statement a link."""
    session.execute(insert(Link), [row | {"study_id": study.id} for row in rows])


def find_link(session: Session, study: Study, public_id: str) -> Link | None:
    """The link of a study with this public id, withdrawn or not."""
    return session.scalar(select(Link).where(Link.study_id == study.id, Link.public_id == public_id))


def links_of(session: Session, study: Study) -> list[Link]:
    """The links of a study that have not been withdrawn, in the order they were made."""
    return list(session.scalars(_shown(study)))


def number_of_links(session: Session, study: Study) -> int:
    """How many links `links_of` would give."""
    return session.scalar(select(func.count()).select_from(_shown(study).order_by(None).subquery())) or 0


def links_after(session: Session, study: Study, link: Link | None, limit: int) -> list[Link]:
    """At most `limit` links in the order they were made, those behind `link`."""
    query = _shown(study).limit(limit)
    return list(session.scalars(query if link is None else query.where(Link.id > link.id)))


def runs_by_link(session: Session, links: Sequence[Link]) -> dict[int, tuple[int, int]]:
    """Number of a link -> (runs, complete runs); for one page of links."""
    complete = func.sum(case((StudyRun.status == "complete", 1), else_=0))
    query = select(StudyRun.link_id, func.count(), complete).group_by(StudyRun.link_id)
    rows = session.execute(query.where(StudyRun.link_id.in_([link.id for link in links])))
    return {link: (int(runs), int(done)) for link, runs, done in rows}


def first_general_link(session: Session, study: Study, group: str) -> Link | None:
    """The oldest general link for a group (empty: for none) that belongs to no recruiter."""
    query = _shown(study).where(Link.kind == "general", Link.recruiter.is_(None), Link.group_name == group)
    return session.scalar(query.limit(1))


def recruiters_of_links(session: Session, study: Study) -> list[dict[str, Any]]:
    """The recruiters that links of a study have for themselves, each once."""
    query = select(Link.recruiter).where(
        Link.study_id == study.id, Link.revoked_at.is_(None), Link.kind != "preview"
    )
    stored = (recruiter for recruiter in session.scalars(query.order_by(Link.id)) if recruiter)
    return list({json.dumps(recruiter, sort_keys=True): recruiter for recruiter in stored}.values())


def has_personal_links(session: Session, study: Study) -> bool:
    """Whether somebody was given a link that is theirs alone."""
    personal = _shown(study).where(Link.kind == "personal").limit(1)
    return session.scalar(personal) is not None


def _shown(study: Study) -> Select[Link]:
    query = select(Link).where(
        Link.study_id == study.id, Link.revoked_at.is_(None), Link.synthetic.is_(False)
    )
    return query.order_by(Link.id)
