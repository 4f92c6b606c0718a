"""Signed-in experimenters for tests of the admin API."""

from dataclasses import dataclass
from typing import Any

import pytest
from fastapi.testclient import TestClient
from starlette.testclient import TestClient as StarletteClient

from server.accounts import service
from server.accounts.identity import Role
from server.app import create_app
from server.context import Services
from server.settings import Settings

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


def signed_in(settings: Settings, services: Services, role: Role) -> Admin:
    """A new account of this role, signed in through a one-time link."""
    client = TestClient(create_app(settings), base_url=settings.public_url, raise_server_exceptions=False)
    _, token = service.invite(services.database, role, "", None)
    made = client.post(
        f"/api/admin/invitations/{token}/account", json={"name": f"the {role}", "password": PASSWORD}
    )
    assert made.status_code == 201, made.text
    return Admin(client, f"the {role}")


@pytest.fixture
def owner(settings: Settings, services: Services) -> Admin:
    """A signed-in owner."""
    return signed_in(settings, services, "owner")


@pytest.fixture
def experimenter(settings: Settings, services: Services) -> Admin:
    """A signed-in experimenter."""
    return signed_in(settings, services, "experimenter")


@pytest.fixture
def viewer(settings: Settings, services: Services) -> Admin:
    """A signed-in viewer."""
    return signed_in(settings, services, "viewer")
