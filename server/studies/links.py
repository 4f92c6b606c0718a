"""Links into a study. A link's token is derived from the server's key, so that it can be shown again."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any, Literal

from sqlalchemy import Select, case, func, insert, select
from sqlalchemy.orm import Session

from experiments.assignment.groups import names
from experiments.definition import Experiment
from experiments.errors import did_you_mean
from server.clock import now
from server.errors import Invalid, NotFound
from server.models import Link, Study, StudyRun
from server.studies.lookup import active_definition
from server.tokens import derived_token, hash_token, new_public_id

LinkKind = Literal["general", "personal", "preview"]
PURPOSE = "link"


@dataclass(frozen=True)
class LinkOptions:
    """What all links made at once share; see `server.models.Link`."""

    kind: LinkKind
    synthetic: bool = False
    group_name: str = ""
    quota: int | None = None
    expires_at: datetime | None = None
    recruiter: dict[str, Any] | None = None
    created_by: int | None = None


def numbered_labels(label: str, count: int) -> list[str]:
    """`label` (P where there is none) with the numbers 001 to `count`."""
    return [f"{label or 'P'}{number:03d}" for number in range(1, count + 1)]


def prepared_links(key: bytes, options: LinkOptions, labels: Iterable[str]) -> list[dict[str, Any]]:
    """New links with these labels, all but their study: what can be made before the database is asked."""
    made_at, rows = now(), []
    for label in labels:
        public_id = new_public_id()
        token_hash = hash_token(derived_token(key, PURPOSE, public_id))
        rows.append(
            {
                **vars(options),
                "label": label,
                "public_id": public_id,
                "token_hash": token_hash,
                "created_at": made_at,
            }
        )
    return rows


def check_group(experiment: Experiment, kind: LinkKind, group: str) -> None:
    """Invalid unless a link for this group (empty: for none) leads into the study."""
    known, by_link = names(experiment), experiment.groups.by == "link"
    if group and not by_link:
        raise Invalid(f"Expected a link without a group, got '{group[:60]}': links decide no groups here.")
    if group and group not in known:
        raise Invalid(
            f"There is no group '{group[:60]}'{did_you_mean(group, known)}; there are: {', '.join(known)}."
        )
    if by_link and not group and kind != "preview":
        raise Invalid(f"Expected the group of the link, one of {', '.join(known)}; got none.")


def add_links(session: Session, study: Study, rows: Sequence[dict[str, Any]]) -> None:
    """Store prepared links in one statement, so that raters do not wait for a statement a link."""
    session.execute(insert(Link), [row | {"study_id": study.id} for row in rows])


def create_link(
    session: Session, key: bytes, study: Study, kind: LinkKind, *, label: str = "", **options: Any
) -> Link:
    """Add one link to `study`; `options` are those of `LinkOptions`."""
    [row] = prepared_links(key, LinkOptions(kind, **options), [label])
    link = Link(study_id=study.id, **row)
    session.add(link)
    session.flush()
    return link


def link_url(public_url: str, key: bytes, public_id: str) -> str:
    """The address a participant opens."""
    return f"{public_url}/run/{derived_token(key, PURPOSE, public_id)}"


def links_of(session: Session, study: Study) -> list[Link]:
    """The links of a study that have not been withdrawn, in the order they were made."""
    return list(session.scalars(_shown(study)))


def number_of_links(session: Session, study: Study) -> int:
    """How many links `links_of` would give."""
    return session.scalar(select(func.count()).select_from(_shown(study).order_by(None).subquery())) or 0


def page_of_links(session: Session, study: Study, after: str | None, limit: int) -> list[Link]:
    """At most `limit` links in the order they were made, those behind the link `after`."""
    query = _shown(study).limit(limit)
    if after is not None:
        number = session.scalar(select(Link.id).where(Link.study_id == study.id, Link.public_id == after))
        if number is None:
            raise NotFound(f"There is no link '{after[:40]}' in the study '{study.name}'.")
        query = query.where(Link.id > number)
    return list(session.scalars(query))


def runs_by_link(session: Session, links: Sequence[Link]) -> dict[int, tuple[int, int]]:
    """Number of a link -> (runs, complete runs); for one page of links."""
    complete = func.sum(case((StudyRun.status == "complete", 1), else_=0))
    query = select(StudyRun.link_id, func.count(), complete).group_by(StudyRun.link_id)
    rows = session.execute(query.where(StudyRun.link_id.in_([link.id for link in links])))
    return {link: (int(runs), int(done)) for link, runs, done in rows}


def links_with_runs(
    session: Session, study: Study, limit: int, kind: LinkKind | None = None
) -> Iterator[tuple[Link, int, int]]:
    """Every link (of one kind) with its runs and complete runs, read `limit` at a time."""
    after = None
    while links := page_of_links(session, study, after, limit):
        runs = runs_by_link(session, links)
        yield from ((link, *runs.get(link.id, (0, 0))) for link in links if kind in (None, link.kind))
        after = links[-1].public_id


def _shown(study: Study) -> Select[Link]:
    query = select(Link).where(
        Link.study_id == study.id, Link.revoked_at.is_(None), Link.synthetic.is_(False)
    )
    return query.order_by(Link.id)


def general_links(session: Session, key: bytes, study: Study) -> list[Link]:
    """The study's first general link, one a group where links decide groups; made where there is none."""
    experiment = active_definition(session, study)
    groups = names(experiment) if experiment.groups.by == "link" else [""]
    return [_general_link(session, key, study, group) for group in groups]


def _general_link(session: Session, key: bytes, study: Study, group: str) -> Link:
    query = _shown(study).where(Link.kind == "general", Link.recruiter.is_(None), Link.group_name == group)
    return session.scalar(query.limit(1)) or create_link(
        session, key, study, "general", label=group or "general", group_name=group
    )
