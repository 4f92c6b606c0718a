"""What is counted for Prometheus, and the observer of every request that counts it."""

import json
import logging
import os
import time
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from importlib.metadata import version
from ipaddress import ip_address
from pathlib import Path

from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram, generate_latest
from prometheus_client.core import GaugeMetricFamily
from prometheus_client.multiprocess import MultiProcessCollector
from prometheus_client.registry import Collector
from starlette.requests import ClientDisconnect
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from experiments.errors import InputError
from experiments.files import whole_text
from server.core.db import Database
from server.core.settings import Settings
from server.core.values import now
from server.operations.repository import run_counts
from server.operations.snapshots import snapshots_of
from server.operations.watched_backups import watched_backups

# What is counted for Prometheus: answers by route, how long they took, how many are under way.
#
# Labels are route templates, never addresses: a real address holds a participant's token. With several
# workers the counts of all are added up, by way of files in PROMETHEUS_MULTIPROC_DIR (set by `server run`).

MULTIPROCESS_VARIABLE = "PROMETHEUS_MULTIPROC_DIR"
BUCKETS_S = (0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 10.0)

REGISTRY = CollectorRegistry()
ANSWERS = Counter(
    "palpebra_answers",
    "Responses, by route and status.",
    ("method", "route", "status"),
    registry=REGISTRY,
)
SECONDS = Histogram(
    "palpebra_answer_seconds",
    "Time from the request to the start of the response.",
    ("route",),
    buckets=BUCKETS_S,
    registry=REGISTRY,
)
UNDER_WAY = Gauge(
    "palpebra_requests_under_way",
    "Requests in progress.",
    multiprocess_mode="livesum",
    registry=REGISTRY,
)


class StoredCounts(Collector):
    """Counts taken from the database at the moment they are asked for: the same from every worker."""

    def __init__(self, database: Database, settings: Settings) -> None:
        self.database = database
        self.settings = settings

    def collect(self) -> Iterable[GaugeMetricFamily]:
        """Runs by study and status; the version of the program."""
        runs = GaugeMetricFamily(
            "palpebra_runs", "Stored runs, without previews.", labels=("study", "phase", "origin", "status")
        )
        with self.database.read() as session:
            for *labels, count in run_counts(session):
                runs.add_metric(list(map(str, labels)), count)
        yield runs
        build = GaugeMetricFamily("palpebra_build_info", "The running program.", labels=("version",))
        build.add_metric((version("palpebra"),), 1)
        yield build
        yield from _backups(self.settings)
        yield from _snapshots(self.settings)


def _backups(settings: Settings) -> Iterable[GaugeMetricFamily]:
    """Age of the newest backup and how the last drill went, where they are watched."""
    try:
        watched = watched_backups(settings)
    except InputError:
        yield GaugeMetricFamily("palpebra_backups_reachable", "0 if their store does not respond.", 0)
        return
    if watched is None:
        return
    yield GaugeMetricFamily("palpebra_backups_reachable", "0 if their store does not respond.", 1)
    yield GaugeMetricFamily("palpebra_backups", "Number of backups.", watched.number)
    if watched.age_s is not None:
        yield GaugeMetricFamily("palpebra_backup_age_seconds", "Age of the newest backup.", watched.age_s)
    if watched.drill is not None:
        passed, ended = float(watched.drill.passed), watched.drill.at
        yield GaugeMetricFamily("palpebra_restore_drill_passed", "1 if the last drill passed.", passed)
        age_s = (now() - ended).total_seconds()
        yield GaugeMetricFamily("palpebra_restore_drill_age_seconds", "Time since the last drill.", age_s)


def _snapshots(settings: Settings) -> Iterable[GaugeMetricFamily]:
    """Age of the newest snapshot, where the settings ask for them."""
    taken = snapshots_of(settings) if settings.snapshot_minutes else []
    if taken:
        age_s = (now() - taken[-1].taken_at).total_seconds()
        yield GaugeMetricFamily("palpebra_snapshots", "Number of snapshots of the database.", len(taken))
        yield GaugeMetricFamily("palpebra_snapshot_age_seconds", "Age of the newest snapshot.", age_s)


def exposition(database: Database, settings: Settings) -> bytes:
    """Everything in Prometheus' text format."""
    counted = REGISTRY
    if folder := os.environ.get(MULTIPROCESS_VARIABLE):
        counted = CollectorRegistry()
        MultiProcessCollector(counted, path=folder)  # type: ignore[no-untyped-call]
    stored = CollectorRegistry()
    stored.register(StoredCounts(database, settings))
    return generate_latest(counted) + generate_latest(stored)


# Watches every request: counts it, times it, and logs those that failed or took long.

log = logging.getLogger("palpebra.requests")
CLIENT_GONE = 499
"""Counted where nobody is left to answer: the client left, or sent what is not HTTP and was cut off."""
METHODS = frozenset({"GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS"})


class Observer:
    """Plain ASGI, outside all else that is ours; it never sees an internet address."""

    def __init__(self, app: ASGIApp, settings: Settings) -> None:
        self.app = app
        self.which, self.slow_s = settings.log_requests, settings.log_slow_ms / 1000

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        began, seconds, status = time.perf_counter(), None, 500

        async def watched(message: Message) -> None:
            nonlocal seconds, status
            if message["type"] == "http.response.start":
                # Up to the beginning of the answer: a stream may last for an hour and is not slow for that.
                seconds, status = time.perf_counter() - began, message["status"]
            await send(message)

        UNDER_WAY.inc()
        try:
            await self.app(scope, receive, watched)
            if seconds is None:
                status = CLIENT_GONE
        except ClientDisconnect:
            status = CLIENT_GONE
        finally:
            UNDER_WAY.dec()
            self._note(scope, status, time.perf_counter() - began if seconds is None else seconds)

    def _note(self, scope: Scope, status: int, seconds: float) -> None:
        method = scope["method"] if scope["method"] in METHODS else "other"
        route = route_template(scope)
        ANSWERS.labels(method, route, status).inc()
        SECONDS.labels(route).observe(seconds)
        logged = {"all": True, "none": False}.get(self.which, status >= 500 or seconds > self.slow_s)
        if logged:
            fields = {"method": method, "route": route, "status": status, "ms": round(1000 * seconds, 1)}
            log.log(logging.ERROR if status >= 500 else logging.INFO, "request", extra={"fields": fields})


def route_template(scope: Scope) -> str:
    """The address as declared, such as /api/links/{link_token}: without anybody's token."""
    return str(getattr(scope.get("route"), "path", "unmatched"))


# Proxies before the server that FORWARDED_ALLOW_IPS does not name: noted with requests, for the doctor.
#
# Behind such a proxy every sign-in comes from the proxy's address, and one who guesses passwords makes all
# others wait. What is kept is one address and the time of the last request, in a file of the data folder.

NAME = "unnamed-proxy.json"
HEADERS = frozenset({b"x-forwarded-for", b"forwarded"})
NOTE_EVERY_S = 3600.0
REPORTED_FOR = timedelta(days=1)
"""After it was last seen: by then a server that was set right has shown that it is."""


@dataclass(frozen=True)
class SeenProxy:
    """An address that forwarded requests, and when it was last seen to."""

    address: str
    seen_at: datetime


class ProxyWatch:
    """Plain ASGI: notes once an hour that an unnamed proxy forwards requests."""

    def __init__(self, app: ASGIApp, settings: Settings) -> None:
        self.app, self._path = app, settings.data_folder / NAME
        self._next_at = 0.0

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request."""
        if scope["type"] == "http" and (address := _unnamed_proxy(scope)) is not None:
            self._note(address)
        await self.app(scope, receive, send)

    def _note(self, address: str) -> None:
        if time.monotonic() < self._next_at:
            return
        self._next_at = time.monotonic() + NOTE_EVERY_S
        seen = {"address": address, "seen_at": datetime.now(UTC).isoformat()}
        try:
            with whole_text(self._path) as stream:
                stream.write(json.dumps(seen))
        except (OSError, InputError):  # a full disk keeps no request from its answer
            pass


def _unnamed_proxy(scope: Scope) -> str | None:
    """Where a forwarded request came from, if that is a machine nearby whose word uvicorn did not take.

    Anybody on the internet can send these headers; an address of a private network is a proxy's.
    """
    host, port = scope.get("client") or ("", 0)
    # uvicorn gives the address that a named proxy reports, without a port.
    if not port or not any(name in HEADERS for name, _ in scope["headers"]):
        return None
    try:
        return str(host) if ip_address(host).is_private else None
    except ValueError:
        return None


def seen_proxy(folder: Path) -> SeenProxy | None:
    """The unnamed proxy that was seen within the last day; None where there was none."""
    try:
        seen = json.loads((folder / NAME).read_text(encoding="utf-8"))
        proxy = SeenProxy(str(ip_address(seen["address"])), datetime.fromisoformat(seen["seen_at"]))
        return proxy if datetime.now(UTC) - proxy.seen_at < REPORTED_FOR else None
    except (OSError, ValueError, KeyError, TypeError):
        return None
