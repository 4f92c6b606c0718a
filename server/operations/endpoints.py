"""`/metrics` for Prometheus: with a token, or from this machine alone; how the backups are, for owners."""

import hmac

from fastapi import APIRouter, Request, Response
from prometheus_client import CONTENT_TYPE_LATEST

from server.accounts.permission import Owner
from server.context import ServicesDep
from server.errors import ERROR_RESPONSES, ApiError
from server.operations.metrics import exposition
from server.operations.schemas import BackupsOut, backups_out

admin_router = APIRouter(prefix="/api/admin", tags=["people"], responses=ERROR_RESPONSES)
router = APIRouter(tags=["health"], responses=ERROR_RESPONSES, include_in_schema=False)
THIS_MACHINE = frozenset({"127.0.0.1", "::1", "localhost"})


class MetricsNotForYou(ApiError):
    """The counts are for whoever operates the server."""

    status = 403
    code = "metrics_not_allowed"


@router.get("/metrics")
def metrics(request: Request, services: ServicesDep) -> Response:
    """Counts and times in Prometheus' text format."""
    if not _allowed(request, services.settings.metrics_token):
        raise MetricsNotForYou(
            "Metrics need `Authorization: Bearer` with PALPEBRA_METRICS_TOKEN; "
            "without that setting they are given to this machine alone."
        )
    return Response(exposition(services.database, services.settings), media_type=CONTENT_TYPE_LATEST)


@admin_router.get("/backups")
def get_backups(services: ServicesDep, _identity: Owner) -> BackupsOut:
    """How old the newest backup is, and how the last restore drill went."""
    return backups_out(services.settings)


def _allowed(request: Request, token: str) -> bool:
    if token:
        given = request.headers.get("authorization", "").removeprefix("Bearer ")
        return hmac.compare_digest(given.encode(), token.encode())
    # What comes through a proxy on this machine is not from this machine.
    forwarded = any(name in request.headers for name in ("forwarded", "x-forwarded-for", "x-real-ip"))
    return request.client is not None and request.client.host in THIS_MACHINE and not forwarded
