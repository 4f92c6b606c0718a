"""Links on the dashboard."""

from datetime import timedelta
from typing import Annotated, Any

from fastapi import APIRouter, Query, Response

from experiments.spreadsheet import guarded_table
from server.accounts.audit import record
from server.accounts.permission import Myself, Writer
from server.clock import now
from server.context import Services, ServicesDep
from server.errors import ERROR_RESPONSES
from server.models import Link
from server.studies.fields import Label
from server.studies.launch_checks import refuse_recruiter
from server.studies.link_schemas import LinkOut, LinkPage, NewLinks, Signing
from server.studies.links import (
    LinkOptions,
    link_in_use,
    link_url,
    links_with_runs,
    make_links,
    numbered_labels,
    page_of_links,
    prepared_links,
    withdraw,
)
from server.studies.lookup import find_study
from server.studies.signing import signing

router = APIRouter(prefix="/api/admin/studies/{study}/links", tags=["links"], responses=ERROR_RESPONSES)


Limit = Annotated[int, Query(ge=1, le=1000)]
LINKS_READ_AT_ONCE = 1000
_SHOWN = ("kind", "label", "group_name", "quota", "expires_at", "created_at", "recruiter")


def _link_out(services: Services, row: Link | dict[str, Any], runs: int = 0, complete: int = 0) -> LinkOut:
    values = row if isinstance(row, dict) else vars(row)
    own = {name: values[name] for name in _SHOWN}
    url = link_url(services.settings.public_url, services.settings.key, values["public_id"])
    return LinkOut(id=values["public_id"], url=url, runs=runs, complete=complete, **own)


@router.get("")
def list_links(
    services: ServicesDep, identity: Writer, study: str, after: str | None = None, limit: Limit = 100
) -> LinkPage:
    """The links of a study in the order they were made, a page at a time: go on with `after` = `next`."""
    with services.database.read() as session:
        known = find_study(session, study, identity, "run")
        page = page_of_links(session, known, after, limit)
        return LinkPage(
            links=[_link_out(services, link, *runs) for link, runs in page.links],
            total=page.total,
            next=page.next,
        )


@router.post("", status_code=201)
def create_links(services: ServicesDep, identity: Writer, study: str, body: NewLinks) -> list[LinkOut]:
    """Make a general or preview link, or many personal ones: by their labels, or `count` numbered ones."""
    labels = [body.label]
    if body.kind == "personal":
        labels = body.labels or numbered_labels(body.label, body.count)
    options = LinkOptions(
        body.kind,
        group_name=body.group,
        quota=body.quota,
        expires_at=now() + timedelta(days=body.days) if body.days else None,
        recruiter=body.recruiter.model_dump() if body.recruiter else None,
        created_by=identity.account_id,
    )
    rows = prepared_links(services.settings.key, options, labels)
    with services.database.write() as session:
        known = find_study(session, study, identity, "run")
        refuse_recruiter(known, body.recruiter, "Links")
        make_links(session, known, body.kind, body.group, rows)
        record(session, identity, "links made", "study", study, links=body.kind, number=len(rows))
    return [_link_out(services, row) for row in rows]


@router.get("/signing")
def get_signing(
    services: ServicesDep,
    identity: Myself,
    study: str,
    secret_name: Label | None = None,
    link: Label | None = None,
) -> Signing:
    """The secret for signed addresses, with examples; for owners alone, each look is in the audit log.

    Where a link has a recruiter of its own, give its id as `link`; the study's recruiter counts without.
    """
    with services.database.write() as session:
        known = find_study(session, study, identity, "own")
        of_link = None if link is None else link_in_use(session, known, link)
        return signing(session, services.settings.key, known, secret_name, identity, of_link)


@router.get("/personal.csv", response_class=Response)
def download_personal_links(services: ServicesDep, identity: Writer, study: str) -> Response:
    """The personal links as CSV: label, link, runs, complete, group."""
    rows: list[tuple[Any, ...]] = [("label", "url", "runs", "complete", "group")]
    with services.database.read() as session:
        known = find_study(session, study, identity, "run")
        for link, runs, complete in links_with_runs(session, known, LINKS_READ_AT_ONCE, "personal"):
            url = link_url(services.settings.public_url, services.settings.key, link.public_id)
            rows.append((link.label, url, runs, complete, link.group_name))
    with services.database.write() as session:
        record(session, identity, "personal links downloaded", "study", study)
    headers = {"content-disposition": f'attachment; filename="{study}-links.csv"'}
    return Response(guarded_table(rows), media_type="text/csv; charset=utf-8", headers=headers)


@router.delete("/{link}", status_code=204)
def revoke_link(services: ServicesDep, identity: Writer, study: str, link: str) -> None:
    """Withdraw a link; runs that began with it go on."""
    with services.database.write() as session:
        known = find_study(session, study, identity, "run")
        withdrawn = withdraw(session, known, link)
        # A personal link's label is a person's name, which an erasure could not take out of the log's chain.
        record(
            session, identity, "link withdrawn", "study", study, link=withdrawn.public_id, kind=withdrawn.kind
        )
