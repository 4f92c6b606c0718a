"""Links into a study. A link's token is derived from the server's key, so that it can be shown again."""

from datetime import datetime
from typing import Any, Literal

from sqlalchemy import select
from sqlalchemy.orm import Session

from server.models import Link, Study
from server.tokens import derived_token, hash_token, new_public_id

LinkKind = Literal["general", "personal", "preview"]
PURPOSE = "link"


def create_link(
    session: Session,
    key: bytes,
    study: Study,
    kind: LinkKind,
    *,
    label: str = "",
    synthetic: bool = False,
    quota: int | None = None,
    expires_at: datetime | None = None,
    recruiter: dict[str, Any] | None = None,
    created_by: int | None = None,
) -> Link:
    """Add a link to `study`."""
    public_id = new_public_id()
    link = Link(
        public_id=public_id,
        study_id=study.id,
        kind=kind,
        token_hash=hash_token(derived_token(key, PURPOSE, public_id)),
        label=label,
        synthetic=synthetic,
        quota=quota,
        expires_at=expires_at,
        recruiter=recruiter,
        created_by=created_by,
    )
    session.add(link)
    session.flush()
    return link


def link_url(public_url: str, key: bytes, link: Link) -> str:
    """The address a participant opens."""
    return f"{public_url}/run/{derived_token(key, PURPOSE, link.public_id)}"


def links_of(session: Session, study: Study) -> list[Link]:
    """The links of a study that have not been withdrawn, in the order they were made."""
    query = select(Link).where(
        Link.study_id == study.id, Link.revoked_at.is_(None), Link.synthetic.is_(False)
    )
    return list(session.scalars(query.order_by(Link.id)))


def general_link(session: Session, key: bytes, study: Study) -> Link:
    """The study's first general link, made where there is none."""
    for link in links_of(session, study):
        if link.kind == "general" and link.recruiter is None:
            return link
    return create_link(session, key, study, "general", label="general")
