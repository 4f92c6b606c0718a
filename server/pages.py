"""The built pages: the participant's page and the admin site, with their hashed assets."""

import mimetypes
from datetime import UTC, datetime, timedelta
from functools import lru_cache
from pathlib import Path

from fastapi import APIRouter, Response
from fastapi.responses import HTMLResponse, PlainTextResponse, RedirectResponse

from server.context import Services, ServicesDep, SettingsDep
from server.errors import ApiError, NotFound
from server.middleware import NONCE_PLACEHOLDER, content_security_policy, new_nonce

router = APIRouter(include_in_schema=False)
SECURITY_TXT_LASTS = timedelta(days=90)
IMMUTABLE = "public, max-age=31536000, immutable"
mimetypes.add_type("text/javascript", ".mjs")
mimetypes.add_type("application/wasm", ".wasm")


class PagesNotBuilt(ApiError):
    """The frontend has not been built on this machine."""

    status = 503
    code = "pages_not_built"


@router.get("/")
def home() -> RedirectResponse:
    """Send whoever comes without a link to the admin site."""
    return RedirectResponse("/admin/")


@router.get("/.well-known/security.txt")
def security_txt(settings: SettingsDep) -> PlainTextResponse:
    """Where weaknesses of this server are reported (RFC 9116); 404 where nobody is named."""
    if not settings.security_contact:
        raise NotFound("Nobody is named for reports of weaknesses; set PALPEBRA_SECURITY_CONTACT.")
    expires = (datetime.now(UTC) + SECURITY_TXT_LASTS).replace(microsecond=0, tzinfo=None)
    return PlainTextResponse(
        f"Contact: {settings.security_contact}\n"
        f"Expires: {expires.isoformat()}Z\n"
        "Preferred-Languages: en\n"
        f"Canonical: {settings.public_url}/.well-known/security.txt\n"
    )


@router.get("/run/{link_token}")
@router.head("/run/{link_token}", include_in_schema=False)
def participant_page(services: ServicesDep, link_token: str) -> Response:  # noqa: ARG001 - read by the page
    """The participant's page; it reads its link from the address."""
    return _page(services, "participant")


@router.get("/service-worker.js")
def service_worker(settings: SettingsDep) -> Response:
    """What keeps the participant's page for a reload without a connection; it serves /run/ alone."""
    path = settings.frontend_folder / "participant" / "service-worker.js"
    if not path.is_file():
        raise NotFound("There is no service worker; the participant's page is not built.")
    headers = {"cache-control": "no-cache"}
    return Response(_read(path, path.stat().st_mtime_ns), media_type="text/javascript", headers=headers)


@router.get("/admin")
@router.get("/admin/{rest:path}")
def admin_page(services: ServicesDep, rest: str = "") -> Response:  # noqa: ARG001 - read by the page
    """The admin site; its own router reads the address."""
    return _page(services, "admin")


@router.get("/assets/{site}/{name:path}")
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


def _file_within(folder: Path, asked: Path) -> Path | None:
    """The file asked for where it is one of this folder's; its name may be one that no file can have."""
    try:
        path = asked.resolve()
        return path if path.is_file() and path.is_relative_to(folder) else None
    except (OSError, ValueError):
        return None


def _page(services: Services, site: str) -> Response:
    index = services.settings.frontend_folder / site / "index.html"
    if not index.is_file():
        raise PagesNotBuilt(f"The page {site} is not built; run `make run`, or `npm run build` in frontend.")
    text = _read(index, index.stat().st_mtime_ns).decode("utf-8")
    headers = {"cache-control": "no-cache"}
    if NONCE_PLACEHOLDER in text:
        nonce = new_nonce()
        text = text.replace(NONCE_PLACEHOLDER, nonce)
        policy = content_security_policy(nonce, services.clips.origin())
        headers = {"cache-control": "no-store", "content-security-policy": policy}
    return HTMLResponse(text, headers=headers)


@lru_cache(maxsize=256)
def _read(path: Path, _changed_ns: int) -> bytes:
    return path.read_bytes()
