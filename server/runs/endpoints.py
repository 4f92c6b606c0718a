"""Participants of a study: list, timeline, exclude, erase."""

from typing import Annotated

from fastapi import APIRouter, Query

from server.accounts.audit import record
from server.accounts.permission import Eraser, Myself, PersonalReader, Writer
from server.context import ServicesDep
from server.errors import ERROR_RESPONSES
from server.runs import service
from server.runs.erasure import erase
from server.runs.schemas import Erase, Erased, Exclude, RunIdentity, RunPage, Show, Timeline
from server.studies.lookup import find_study

router = APIRouter(prefix="/api/admin/studies/{study}/runs", tags=["participants"], responses=ERROR_RESPONSES)


@router.get("")
def list_runs(
    services: ServicesDep,
    identity: PersonalReader,
    study: str,
    show: Show = "everybody",
    simulated: Annotated[bool, Query(description="List simulated people too.")] = False,
    search: Annotated[str, Query(max_length=200, description="Part of participant or run.")] = "",
    before: Annotated[str | None, Query(max_length=40)] = None,
    limit: Annotated[int, Query(ge=1, le=1000)] = 100,
) -> RunPage:
    """The runs, the latest first, a page at a time: go on with `before` = `next`."""
    with services.database.read() as session:
        known = find_study(session, study, identity, "export")
        shown = service.page(session, known, show, search, before, limit, simulated=simulated)
    with services.database.write() as session:
        record(session, identity, "participants listed", "study", study, number=len(shown.runs))
    return shown


@router.get("/{run}")
def get_timeline(services: ServicesDep, identity: PersonalReader, study: str, run: str) -> Timeline:
    """One run: each trial with its frames and rating, forms, calibrations, events."""
    with services.database.write() as session:
        timeline = service.timeline(session, find_study(session, study, identity, "export"), run)
        record(session, identity, "personal data read", "run", run, study=study)
        return timeline


@router.get("/{run}/identity")
def get_identity(services: ServicesDep, identity: Myself, study: str, run: str) -> RunIdentity:
    """Who the participant is to the recruiter; for owners of the study, and each look is in the audit log."""
    with services.database.write() as session:
        return service.identity(session, find_study(session, study, identity, "own"), run, identity)


@router.put("/{run}/exclusion", status_code=204)
def exclude_run(services: ServicesDep, identity: Writer, study: str, run: str, body: Exclude) -> None:
    """Exclude a run from exports' `excluded = 0` and from the analysis; its data stay."""
    with services.database.write() as session:
        service.exclude(session, find_study(session, study, identity, "run"), run, body.reason, identity)


@router.delete("/{run}/exclusion", status_code=204)
def include_run(services: ServicesDep, identity: Writer, study: str, run: str) -> None:
    """Undo an exclusion."""
    with services.database.write() as session:
        service.include(session, find_study(session, study, identity, "run"), run, identity)


@router.post("/{run}/erase")
def erase_run(services: ServicesDep, identity: Eraser, study: str, run: str, body: Erase) -> Erased:
    """Delete one person's data for good (a request under data protection law)."""
    with services.database.write() as session:
        known = find_study(session, study, identity, "edit")
        return erase(session, services.settings, known, run, body.confirm, identity)
