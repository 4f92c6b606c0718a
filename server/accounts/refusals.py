"""Refusals that are written down: rights that somebody has not, others' studies, unknown tokens."""

import logging

from fastapi import Request
from fastapi.concurrency import run_in_threadpool
from sqlalchemy.exc import SQLAlchemyError

from server.accounts.audit import NOBODY, record
from server.context import Services, services_of
from server.errors import ApiError
from server.logs import described

log = logging.getLogger("palpebra")
ADMIN = "/api/admin/"


async def note_refusal(request: Request, refusal: ApiError) -> None:
    """Put a refusal of the admin API into the audit log, so many a minute; the rest are counted.

    Where it cannot be written the refusal is answered all the same, and the log has a line.
    """
    services = services_of(request)
    if request.url.path.startswith(ADMIN):
        route = str(getattr(request.scope.get("route"), "path", "unmatched"))
        try:
            await run_in_threadpool(_note, services, request, route, refusal)
        except (SQLAlchemyError, OSError, ValueError) as error:
            log.error("a refusal could not be put into the audit log: %s", described(error))


def _note(services: Services, request: Request, route: str, refusal: ApiError) -> None:
    actor = getattr(request.state, "identity", None) or NOBODY
    name, records = (NOBODY, services.strangers) if actor == NOBODY else (actor.name, services.refusals)
    unwritten = records.written(f"{name} {request.method} {route} {refusal.code}")
    if unwritten is None:
        return
    details = {"code": refusal.code, "status": refusal.status}
    details |= {"not_written_before": unwritten} if unwritten else {}
    # No column of PostgreSQL holds a NUL.
    study = str(request.path_params.get("study", "")).replace("\0", "\ufffd")
    with services.database.write() as session:
        record(
            session, actor, "refused", "study" if study else "route", study or f"{request.method} {route}",
            **details, **({"route": f"{request.method} {route}"} if study else {}),
        )  # fmt: skip
