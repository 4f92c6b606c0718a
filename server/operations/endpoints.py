"""`/metrics` for Prometheus: with a token, or from only this machine; how the backups are, for owners."""

import hmac
from functools import partial

from fastapi import APIRouter, Request, Response
from prometheus_client import CONTENT_TYPE_LATEST
from pydantic import BaseModel, Field

from experiments.errors import InputError
from server.accounts.access import Owner, Viewer
from server.context import ServicesDep
from server.core.errors import ERROR_RESPONSES, ApiError
from server.core.requests import DatabaseDep, SettingsDep
from server.core.settings import Settings
from server.operations.doctor import findings_for_studies
from server.operations.metrics import exposition
from server.operations.watch import StudyWarning, warnings_shown
from server.operations.watched_backups import (
    OLD_AFTER_S,
    DrillResult,
    WatchedBackups,
    last_drill,
    watched_backups,
)

# What the admin site shows of the backups.


class BackupsOut(BaseModel):
    """How the backups are."""

    watched: bool = Field(description="Whether the settings specify their location (PALPEBRA_BACKUP_FOLDER).")
    address: str
    problem: str = Field(description="Why their store could not be reached; empty if it could.")
    number: int
    newest: str | None
    age_hours: float | None = Field(description="Of the newest.")
    old: bool = Field(description="There is no backup, or none from the last two days.")
    drill: DrillResult | None
    drilled_elsewhere: bool = Field(
        description="They are encrypted, and this server does not have the private key to test them."
    )


def backups_out(settings: Settings) -> BackupsOut:
    """Look at the backups."""
    problem, watched = "", None
    try:
        watched = watched_backups(settings)
    except InputError as error:
        problem = str(error)
    seen = watched or WatchedBackups(0, None, None, last_drill(settings))
    return BackupsOut(
        watched=watched is not None or problem != "",
        address=str(settings.backup_folder),
        problem=problem,
        number=seen.number,
        newest=seen.newest,
        age_hours=None if seen.age_s is None else seen.age_s / 3600,
        old=seen.age_s is None or seen.age_s > OLD_AFTER_S,
        drill=seen.drill,
        drilled_elsewhere=seen.drilled_elsewhere,
    )


admin_router = APIRouter(prefix="/api/admin", tags=["people"], responses=ERROR_RESPONSES)
router = APIRouter(tags=["health"], responses=ERROR_RESPONSES, include_in_schema=False)
THIS_MACHINE = frozenset({"127.0.0.1", "::1", "localhost"})


class MetricsNotForYou(ApiError, status=403, code="metrics_not_allowed"):
    """The counts are for the operator of the server."""


@router.get("/metrics")
def metrics(request: Request, database: DatabaseDep, settings: SettingsDep) -> Response:
    """Counts and times in Prometheus' text format."""
    if not _may_read_metrics(request, settings.metrics_token):
        raise MetricsNotForYou(
            "Metrics need `Authorization: Bearer` with PALPEBRA_METRICS_TOKEN; "
            "without that setting they are given to only this machine."
        )
    return Response(exposition(database, settings), media_type=CONTENT_TYPE_LATEST)


@admin_router.get("/backups")
def get_backups(settings: SettingsDep, _identity: Owner) -> BackupsOut:
    """How old the newest backup is, and how the last restore drill went."""
    return backups_out(settings)


@admin_router.get("/studies/{study}/warnings")
def list_study_warnings(services: ServicesDep, identity: Viewer, study: str) -> list[StudyWarning]:
    """What goes wrong with an open study, as sent to its owners: clips, drop-outs, plays, limit, server."""
    return warnings_shown(services.database, partial(findings_for_studies, services), study, identity)


def _may_read_metrics(request: Request, token: str) -> bool:
    if token:
        given = request.headers.get("authorization", "").removeprefix("Bearer ")
        return hmac.compare_digest(given.encode(), token.encode())
    # What comes through a proxy on this machine is not from this machine.
    forwarded = any(name in request.headers for name in ("forwarded", "x-forwarded-for", "x-real-ip"))
    return request.client is not None and request.client.host in THIS_MACHINE and not forwarded
