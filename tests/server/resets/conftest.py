"""A server that sends mail, and an account with an address."""

from collections.abc import Iterator

import pytest
from fastapi.testclient import TestClient

from server.context import Services
from server.core.settings import Settings
from tests.helpers.admins import PASSWORD, Admin, fresh_browser, signed_in
from tests.helpers.mail import ADDRESS, Letterbox, smtp_server


@pytest.fixture(scope="module")
def server() -> Iterator[tuple[Letterbox, int]]:
    with smtp_server() as running:
        yield running


@pytest.fixture
def box(server: tuple[Letterbox, int]) -> Letterbox:
    server[0].letters.clear()
    return server[0]


@pytest.fixture
def settings(settings: Settings, server: tuple[Letterbox, int]) -> Settings:
    return settings.model_copy(
        update={
            "smtp_host": "127.0.0.1",
            "smtp_port": server[1],
            "smtp_security": "none",
            "mail_from": "Palpebra <palpebra@lab.example>",
        }
    )


@pytest.fixture
def stranger(client: TestClient, settings: Settings) -> TestClient:
    return fresh_browser(client, settings)


@pytest.fixture
def ada(client: TestClient, services: Services, box: Letterbox) -> Admin:
    """An account whose address is confirmed."""
    made = signed_in(client, services, "owner", "ada")
    assert made.send("PUT", "/mail", {"address": ADDRESS, "password": PASSWORD}).status_code == 202
    assert made.get("/mail").json() == {"address": None}
    assert made.send("POST", "/session/mail", {"token": box.token()}).status_code == 204
    assert made.get("/mail").json() == {"address": ADDRESS}
    box.letters.clear()
    return made
