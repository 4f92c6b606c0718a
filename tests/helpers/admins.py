"""Signed-in experimenters for tests of the admin API."""

import time
from dataclasses import dataclass
from typing import Any

import pyotp
import pytest
from fastapi.testclient import TestClient
from starlette.testclient import TestClient as StarletteClient

from server.accounts import invitations
from server.context import Services
from server.core.settings import Settings
from server.models import Role

PASSWORD = "correct horse battery"


@dataclass
class Admin:
    """One account's browser."""

    client: StarletteClient
    name: str

    def get(self, path: str, **options: Any) -> Any:
        """GET under /api/admin."""
        return self.client.get(f"/api/admin{path}", **options)

    def send(self, method: str, path: str, body: Any = None, **options: Any) -> Any:
        """A change under /api/admin with a JSON body."""
        return self.client.request(method, f"/api/admin{path}", json=body, **options)


def fresh_browser(client: TestClient, settings: Settings) -> TestClient:
    """Another browser of the same application: no cookies.

    It asks in the same event loop, as all browsers of a server do; with none given, a client begins a thread
    and a loop for each request.
    """
    fresh = TestClient(
        client.app,
        base_url=settings.public_url,
        raise_server_exceptions=False,
        headers={"sec-fetch-site": "same-origin"},
    )
    fresh.portal = client.portal
    return fresh


def signed_in(client: TestClient, services: Services, role: Role, name: str = "") -> Admin:
    """A new account of this role, signed in through a one-time link in a separate browser."""
    name = name or f"the {role}"
    client = fresh_browser(client, services.settings)
    _, token = invitations.invite(services.database, role, "", None)
    made = client.post(f"/api/admin/invitations/{token}/account", json={"name": name, "password": PASSWORD})
    assert made.status_code == 201, made.text
    return Admin(client, name)


def wrong_code(secret: str) -> str:
    """Six digits that are not a code of this second factor within the next minutes."""
    moment, totp = int(time.time()), pyotp.TOTP(secret)
    right = {totp.at(moment + seconds) for seconds in range(-60, 300, 30)}
    return next(code for code in map("{:06}".format, range(1000)) if code not in right)


@pytest.fixture
def owner(client: TestClient, services: Services) -> Admin:
    """A signed-in owner."""
    return signed_in(client, services, "owner")


@pytest.fixture
def experimenter(client: TestClient, services: Services) -> Admin:
    """A signed-in experimenter."""
    return signed_in(client, services, "experimenter")


@pytest.fixture
def viewer(client: TestClient, services: Services) -> Admin:
    """A signed-in viewer."""
    return signed_in(client, services, "viewer")
