"""Proxies before the server that FORWARDED_ALLOW_IPS does not name: noted with requests, for the doctor.

Behind such a proxy every sign-in comes from the proxy's address, and one who guesses passwords makes all
others wait. What is kept is one address and the time of the last request, in a file of the data folder.
"""

import json
import time
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from ipaddress import ip_address
from pathlib import Path

from starlette.types import ASGIApp, Receive, Scope, Send

from experiments.errors import InputError
from experiments.files import whole_text
from server.core.settings import Settings

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
