"""Links into a study, and how the recruiter's side signs its addresses."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any, Literal, NamedTuple
from urllib.parse import urlencode

from sqlalchemy.orm import Session

from experiments.assignment.groups import names
from experiments.declaration.experiment import Experiment
from experiments.errors import did_you_mean
from server.accounts.audit import record
from server.accounts.identity import Identity
from server.core.errors import Invalid, NotFound
from server.core.values import derived_token, hash_token, new_public_id, now
from server.models import Link, Study
from server.participation.recruiter import signature_of, signing_secret, stored_recruiter
from server.studies import repository
from server.studies.lookup import active_definition, must_not_be_archived
from server.studies.schemas import Signing

# Links into a study. A link's token is derived from the server's key, so that it can be shown again.

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


RunsOfLink = tuple[int, int]
"""Runs, and complete runs."""


class LinksPage(NamedTuple):
    """Some links with their runs, how many links there are, and after which one the rest follows."""

    links: list[tuple[Link, RunsOfLink]]
    total: int
    next: str | None


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
        raise Invalid(
            f"Expected a link without a group, got '{group[:60]}'; links do not decide groups in this study."
        )
    if group and group not in known:
        raise Invalid(
            f"There is no group '{group[:60]}'{did_you_mean(group, known)}; there are: {', '.join(known)}."
        )
    if by_link and not group and kind != "preview":
        raise Invalid(f"Expected the group of the link, one of {', '.join(known)}; got none.")


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


def page_of_links(session: Session, study: Study, after: str | None, limit: int) -> LinksPage:
    """At most `limit` links in the order they were made, those behind the link `after`."""
    last = None if after is None else repository.find_link(session, study, after)
    if after is not None and last is None:
        raise NotFound(f"There is no link '{after[:40]}' in the study '{study.name}'.")
    links = repository.links_after(session, study, last, limit + 1)
    shown = links[:limit]
    return LinksPage(
        _with_runs(session, shown),
        repository.number_of_links(session, study),
        shown[-1].public_id if len(links) > limit else None,
    )


def _with_runs(session: Session, links: Sequence[Link]) -> list[tuple[Link, RunsOfLink]]:
    runs = repository.runs_by_link(session, links)
    return [(link, runs.get(link.id, (0, 0))) for link in links]


def make_links(
    session: Session, study: Study, kind: LinkKind, group: str, rows: Sequence[dict[str, Any]]
) -> None:
    """Store prepared links, all of one kind and group; Conflict where the study is in the archive."""
    must_not_be_archived(study)
    check_group(active_definition(session, study), kind, group)
    repository.add_links(session, study, rows)


def link_in_use(session: Session, study: Study, public_id: str) -> Link:
    """The link of a study with this public id. NotFound where there is none, or no more."""
    link = repository.find_link(session, study, public_id)
    if link is None or link.revoked_at is not None:
        raise NotFound("There is no such link.")
    return link


def withdraw(session: Session, study: Study, public_id: str) -> Link:
    """Withdraw a link; runs that began with it go on. NotFound where there is none, or no more."""
    link = link_in_use(session, study, public_id)
    link.revoked_at = now()
    return link


def links_with_runs(
    session: Session, study: Study, limit: int, kind: LinkKind | None = None
) -> Iterator[tuple[Link, int, int]]:
    """Every link (of one kind) with its runs and complete runs, read `limit` at a time."""
    last = None
    while links := repository.links_after(session, study, last, limit):
        yield from ((link, *runs) for link, runs in _with_runs(session, links) if kind in (None, link.kind))
        last = links[-1]


def general_links(session: Session, key: bytes, study: Study) -> list[Link]:
    """The study's first general link, one per group where links decide groups; made where there is none."""
    experiment = active_definition(session, study)
    groups = names(experiment) if experiment.groups.by == "link" else [""]
    return [_general_link(session, key, study, group) for group in groups]


def _general_link(session: Session, key: bytes, study: Study, group: str) -> Link:
    return repository.first_general_link(session, study, group) or create_link(
        session, key, study, "general", label=group or "general", group_name=group
    )


# How the recruiter's side signs addresses of a study, for its owners.

EXAMPLE_ID = "P-0001"
USUAL_PARAMETER = "signature"
PYTHON = (
    "import hashlib, hmac\n\n"
    'secret = bytes.fromhex("{secret}")\n'
    'print(hmac.new(secret, "{identifier}".encode(), hashlib.sha256).hexdigest())'
)
SHELL = "printf %s '{identifier}' | openssl dgst -sha256 -mac HMAC -macopt hexkey:{secret}"


def signing_of(
    session: Session,
    key: bytes,
    study: Study,
    name: str | None,
    identity: Identity | None,
    link: Link | None = None,
) -> Signing:
    """The secret of a study with examples of its use; that somebody looked is written down.

    Parameters
    ----------
    name : str or None
        Of the secret; that of the recruiter where None.
    link : Link, optional
        Whose recruiter it is, where it has its own; the study's where None.
    """
    recruiter = stored_recruiter((link.recruiter if link else None) or study.recruiter)
    used = recruiter.secret_name if name is None else name
    record(session, identity, "signing secret read", "study", study.name, secret_name=used)
    secret = signing_secret(key, study.pseudonym_key, used)
    filled = {"secret": secret.hex(), "identifier": EXAMPLE_ID}
    signature = signature_of(secret, EXAMPLE_ID)
    parameter = recruiter.signature_parameter or USUAL_PARAMETER
    return Signing(
        declared=bool(recruiter.signature_parameter),
        parameter=parameter,
        secret_name=used,
        secret=secret.hex(),
        identifier=EXAMPLE_ID,
        signature=signature,
        query=urlencode({recruiter.id_name: EXAMPLE_ID, parameter: signature}),
        python=PYTHON.format(**filled),
        shell=SHELL.format(**filled),
    )
