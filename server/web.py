"""What every request passes through, the built pages, and whether the server lives."""

import mimetypes
import secrets
import shutil
import sqlite3
from collections.abc import Mapping
from contextlib import closing
from datetime import UTC, datetime, timedelta
from functools import lru_cache
from pathlib import Path

from fastapi import APIRouter, Response
from fastapi.responses import HTMLResponse, PlainTextResponse, RedirectResponse
from pydantic import BaseModel
from starlette.datastructures import MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from server.context import ServicesDep
from server.core.db import Database
from server.core.errors import ERROR_RESPONSES, ApiError, NotFound
from server.core.migrate import current_revision, newest_revision
from server.core.repository import newest_clip
from server.core.requests import SettingsDep
from server.core.row_security import request_scope
from server.core.settings import Settings
from server.core.storage import ClipStore

# What every request passes through: security headers, and for whom it acts.
#
# Written as plain ASGI because Starlette's BaseHTTPMiddleware costs as much as a whole rating.

NONCE_PLACEHOLDER = "__CSP_NONCE__"
"""Where a page makes style elements by script, its index.html carries this; each answer replaces it."""


def content_security_policy(nonce: str | None = None, clips_from: str | None = None) -> str:
    """The policy: this server's own files, and clips from their store; inline style only with the nonce."""
    clips = f" {clips_from}" if clips_from else ""
    style = f"style-src 'self' 'nonce-{nonce}'" if nonce else "style-src 'self'"
    return (
        f"default-src 'none'; script-src 'self'; {style}; img-src 'self' blob: data:; "
        f"media-src 'self' blob:{clips}; connect-src 'self'{clips}; worker-src 'self'; font-src 'self'; "
        "manifest-src 'self'; base-uri 'none'; frame-ancestors 'none'; form-action 'self'"
    )


def new_nonce() -> str:
    """A fresh nonce for one page."""
    return secrets.token_urlsafe(16)


def security_headers(settings: Settings, clips_from: str | None = None) -> Mapping[str, str]:
    """Headers of every answer. Cross-origin isolation also gives the page its finest clock."""
    headers = {
        "content-security-policy": content_security_policy(clips_from=clips_from),
        "x-content-type-options": "nosniff",
        "referrer-policy": "no-referrer",
        "x-frame-options": "DENY",
        "cross-origin-opener-policy": "same-origin",
        "cross-origin-embedder-policy": "require-corp",
        "cross-origin-resource-policy": "same-origin",
        "permissions-policy": "camera=(), microphone=(), geolocation=(), payment=(), fullscreen=(self)",
    }
    if settings.is_https:
        headers["strict-transport-security"] = "max-age=31536000; includeSubDomains"
    return headers


class SecurityHeaders:
    """Add the security headers to every answer; `no-store` where the answer says nothing of caching."""

    def __init__(self, app: ASGIApp, settings: Settings, clips_from: str | None = None) -> None:
        self.app = app
        self.headers = {**security_headers(settings, clips_from), "cache-control": "no-store"}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return

        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in self.headers.items():
                    headers.setdefault(name, value)
            await send(message)

        await self.app(scope, receive, send_with_headers)


class RowSecurity:
    """Each request acts for nobody until an account is recognised (`server.core.row_security`)."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request."""
        with request_scope():
            await self.app(scope, receive, send)


# The built pages: the participant's page and the admin site, with their hashed assets.

page_router = APIRouter(include_in_schema=False)
SECURITY_TXT_LASTS = timedelta(days=90)
IMMUTABLE = "public, max-age=31536000, immutable"
mimetypes.add_type("text/javascript", ".mjs")
mimetypes.add_type("application/wasm", ".wasm")


class PagesNotBuilt(ApiError, status=503, code="pages_not_built"):
    """The frontend has not been built on this machine."""


@page_router.get("/")
def home() -> RedirectResponse:
    """Send visitors without a link to the admin site."""
    return RedirectResponse("/admin/")


@page_router.get("/.well-known/security.txt")
def security_txt(settings: SettingsDep) -> PlainTextResponse:
    """Where weaknesses of this server are reported (RFC 9116); 404 where nobody is named."""
    if not settings.security_contact:
        raise NotFound("No contact for security reports is set. Set PALPEBRA_SECURITY_CONTACT.")
    expires = (datetime.now(UTC) + SECURITY_TXT_LASTS).replace(microsecond=0, tzinfo=None)
    return PlainTextResponse(
        f"Contact: {settings.security_contact}\n"
        f"Expires: {expires.isoformat()}Z\n"
        "Preferred-Languages: en\n"
        f"Canonical: {settings.public_url}/.well-known/security.txt\n"
    )


@page_router.get("/run/{link_token}")
@page_router.head("/run/{link_token}", include_in_schema=False)
def participant_page(services: ServicesDep, link_token: str) -> Response:  # noqa: ARG001 - read by the page
    """The participant's page; it reads its link from the address."""
    return _page(services.settings, services.clips, "participant")


@page_router.get("/service-worker.js")
def service_worker(settings: SettingsDep) -> Response:
    """What keeps the participant's page for a reload without a connection; it serves /run/ alone."""
    path = settings.frontend_folder / "participant" / "service-worker.js"
    if not path.is_file():
        raise NotFound("There is no service worker, because the participant's page is not built.")
    headers = {"cache-control": "no-cache"}
    return Response(_read(path, path.stat().st_mtime_ns), media_type="text/javascript", headers=headers)


@page_router.get("/admin")
@page_router.get("/admin/{rest:path}")
def admin_page(services: ServicesDep, rest: str = "") -> Response:  # noqa: ARG001 - read by the page
    """The admin site; its own router reads the address."""
    return _page(services.settings, services.clips, "admin")


@page_router.get("/assets/{site}/{name:path}")
def asset(settings: SettingsDep, site: str, name: str) -> Response:
    """A file of a built page; its name carries a hash, so it may be cached for ever."""
    folder = settings.frontend_folder.resolve()
    for candidate in (
        folder / site / "assets" / site / name,
        folder / site / "assets" / name,
        folder / site / name,
    ):
        if (path := _file_within(folder, candidate)) is not None:
            kind = mimetypes.guess_type(path.name)[0] or "application/octet-stream"
            return Response(
                _read(path, path.stat().st_mtime_ns), media_type=kind, headers={"cache-control": IMMUTABLE}
            )
    raise NotFound(f"There is no file {name[:200]}.")


DOCS_NOT_BUILT = """<!doctype html>
<html lang="en">
<title>Documentation</title>
<meta http-equiv="refresh" content="10">
<h1>The documentation is not ready</h1>
<p>In a checkout, <code>make run</code> builds it in the background; this page looks for it every ten seconds.
If it does not appear within two minutes, <code>build/docs.log</code> says why, and <code>make docs</code>
waits for it or builds it again. A container is made without it.
You can also read the files in its folder <code>docs</code>.</p>
</html>
"""


NO_SUCH_PAGE = """<!doctype html>
<html lang="en">
<title>Page not found</title>
<h1>The documentation has no such page</h1>
<p>Look it up in <a href="/docs/how-to/index.html">How do I ...?</a>, which lists all questions, use the
<a href="/docs/search.html">search</a>, or begin at the <a href="/docs/">first page</a>.</p>
</html>
"""


@page_router.get("/docs")
def docs_home() -> RedirectResponse:
    """Pages of the documentation link one another relative to /docs/."""
    return RedirectResponse("/docs/")


@page_router.get("/docs/{name:path}")
def documentation(settings: SettingsDep, name: str) -> Response:
    """A file of the documentation site; a folder shows its index."""
    folder = (settings.frontend_folder / "docs").resolve()
    if not (folder / "index.html").is_file():
        return HTMLResponse(DOCS_NOT_BUILT, status_code=503)
    path = _file_within(folder, folder / name) or _file_within(folder, folder / name / "index.html")
    if path is None:
        return HTMLResponse(NO_SUCH_PAGE, status_code=404)
    kind = mimetypes.guess_type(path.name)[0] or "application/octet-stream"
    content = _read(path, path.stat().st_mtime_ns)
    return Response(content, media_type=kind, headers={"cache-control": "no-cache"})


def _file_within(folder: Path, asked: Path) -> Path | None:
    """The file asked for where it is one of this folder's; its name may be one that no file can have."""
    try:
        path = asked.resolve()
        return path if path.is_file() and path.is_relative_to(folder) else None
    except (OSError, ValueError):
        return None


def _page(settings: Settings, clips: ClipStore, site: str) -> Response:
    index = settings.frontend_folder / site / "index.html"
    if not index.is_file():
        raise PagesNotBuilt(
            f"The page {site} is not built; run `make run` in the checkout, or install Palpebra again."
        )
    text = _read(index, index.stat().st_mtime_ns).decode("utf-8")
    headers = {"cache-control": "no-cache"}
    if NONCE_PLACEHOLDER in text:
        nonce = new_nonce()
        text = text.replace(NONCE_PLACEHOLDER, nonce)
        policy = content_security_policy(nonce, clips.origin())
        headers = {"cache-control": "no-store", "content-security-policy": policy}
    return HTMLResponse(text, headers=headers)


@lru_cache(maxsize=256)
def _read(path: Path, _changed_ns: int) -> bytes:
    return path.read_bytes()


# Whether the server lives, and whether it can serve.

LOCKED_AFTER_S = 3.0
"""This server's own transactions are over long before."""

health_router = APIRouter(tags=["health"], responses=ERROR_RESPONSES)


class Health(BaseModel):
    """A short word."""

    status: str


class NotReady(ApiError, status=503, code="not_ready"):
    """The server runs but cannot serve yet."""


def no_room(settings: Settings) -> str | None:
    """What is wrong where the disk of the data folder is full, or nearly so."""
    needed = settings.free_megabytes_min * 1_000_000
    free = shutil.disk_usage(settings.data_folder if settings.data_folder.exists() else Path()).free
    if free >= needed:
        return None
    room = f"{free / 1e6:.0f} MB free, {needed / 1e6:.0f} MB needed"
    return f"The disk of the data folder is full: {room}. Free disk space."


def is_locked(database: Database) -> bool:
    """Whether a SQLite file cannot be written to within LOCKED_AFTER_S, as this server waits for longer."""
    if not database.url.database:
        return False
    with closing(
        sqlite3.connect(database.url.database, timeout=LOCKED_AFTER_S, isolation_level=None)
    ) as probe:
        try:
            probe.execute("BEGIN IMMEDIATE")
        except sqlite3.OperationalError as error:
            if error.sqlite_errorcode & 0xFF == sqlite3.SQLITE_BUSY:
                return True
            raise NotReady(f"The database cannot be written to: {error}.") from error
        probe.execute("ROLLBACK")
        return False


@health_router.head("/healthz", include_in_schema=False)
@health_router.get("/healthz")
async def healthz() -> Health:
    """The process answers."""
    return Health(status="ok")


@health_router.head("/readyz", include_in_schema=False)
@health_router.get("/readyz", responses={503: ERROR_RESPONSES["4XX"]})
def readyz(services: ServicesDep) -> Health:
    """The database answers, is writable and has the newest revision; the disk has room, clips are read."""
    revision, expected = current_revision(services.database), newest_revision()
    if revision != expected:
        raise NotReady(
            f"The database has revision {revision}, expected {expected}; run `server database upgrade`."
        )
    if problem := no_room(services.settings):
        raise NotReady(problem)
    if services.database.is_sqlite and is_locked(services.database):
        raise NotReady(
            f"Another program has kept the database locked for {LOCKED_AFTER_S:g} s; end it, or wait for it."
        )
    with services.database.read() as session:
        clip = newest_clip(session)
    if problem := services.clips.problem(clip):
        raise NotReady(f"Clips cannot be read: {problem}; run `server doctor` for advice.")
    return Health(status="ready")
