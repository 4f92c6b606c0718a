"""Links on the dashboard."""

import csv
import io
from datetime import timedelta

from fastapi import APIRouter, Response
from sqlalchemy import func, select
from sqlalchemy.orm import Session

from server.accounts.audit import record
from server.accounts.identity import Experimenter
from server.clock import now
from server.context import Services, ServicesDep
from server.errors import ERROR_RESPONSES, NotFound
from server.models import Link, Study, StudyRun
from server.studies.links import create_link, link_url, links_of
from server.studies.lookup import find_study
from server.studies.schemas import LinkOut, NewLinks

router = APIRouter(prefix="/api/admin/studies/{study}/links", tags=["links"], responses=ERROR_RESPONSES)


def _out(services: Services, session: Session, study: Study) -> list[LinkOut]:
    query = select(StudyRun.link_id, StudyRun.status, func.count()).where(StudyRun.study_id == study.id)
    rows = session.execute(query.group_by(StudyRun.link_id, StudyRun.status))
    counts = {(link, status): number for link, status, number in rows}
    return [
        LinkOut(
            id=link.public_id,
            kind=link.kind,
            label=link.label,
            url=link_url(services.settings.public_url, services.settings.key, link),
            quota=link.quota,
            expires_at=link.expires_at,
            created_at=link.created_at,
            runs=sum(n for (owner, _), n in counts.items() if owner == link.id),
            complete=counts.get((link.id, "complete"), 0),
            recruiter=link.recruiter,
        )
        for link in links_of(session, study)
    ]


@router.get("")
def list_links(services: ServicesDep, _who: Experimenter, study: str) -> list[LinkOut]:
    """The links of a study."""
    with services.database.read() as session:
        return _out(services, session, find_study(session, study))


@router.post("", status_code=201)
def create_links(services: ServicesDep, who: Experimenter, study: str, body: NewLinks) -> list[LinkOut]:
    """Make a general or preview link, or many personal ones: by their labels, or `count` numbered ones."""
    labels = [body.label]
    if body.kind == "personal":
        labels = body.labels or [f"{body.label or 'P'}{number:03d}" for number in range(1, body.count + 1)]
    with services.database.write() as session:
        found = find_study(session, study)
        made = [
            create_link(
                session,
                services.settings.key,
                found,
                body.kind,
                label=label,
                quota=body.quota,
                expires_at=now() + timedelta(days=body.days) if body.days else None,
                recruiter=body.recruiter.model_dump() if body.recruiter else None,
                created_by=who.account_id,
            ).public_id
            for label in labels
        ]
        record(session, who, "links made", "study", study, links=body.kind, number=len(made))
        fresh = set(made)
        return [link for link in _out(services, session, found) if link.id in fresh]


@router.get("/personal.csv", response_class=Response)
def download_personal_links(services: ServicesDep, _who: Experimenter, study: str) -> Response:
    """The personal links as CSV: label, link, runs, complete."""
    with services.database.read() as session:
        links = _out(services, session, find_study(session, study))
    stream = io.StringIO()
    writer = csv.writer(stream)
    writer.writerow(["label", "url", "runs", "complete"])
    writer.writerows(
        [link.label, link.url, link.runs, link.complete] for link in links if link.kind == "personal"
    )
    headers = {"content-disposition": f'attachment; filename="{study}-links.csv"'}
    return Response(stream.getvalue(), media_type="text/csv; charset=utf-8", headers=headers)


@router.delete("/{link}", status_code=204)
def revoke_link(services: ServicesDep, who: Experimenter, study: str, link: str) -> None:
    """Withdraw a link; runs that began with it go on."""
    with services.database.write() as session:
        found = find_study(session, study)
        row = session.scalar(select(Link).where(Link.study_id == found.id, Link.public_id == link))
        if row is None or row.revoked_at is not None:
            raise NotFound("There is no such link.")
        row.revoked_at = now()
        record(session, who, "link withdrawn", "study", study, label=row.label)
