"""The monitor's stream: it reports changes, ends by itself, and does not hold up the server's end."""

import http.client
import json
import os
import signal
import time

import pytest
from fastapi.testclient import TestClient
from sqlalchemy import update

from server.cli_run import GRACE_S
from server.context import Services
from server.core.changes import Stopping
from server.core.settings import Settings
from server.core.values import now
from server.models import AdminSession
from tests.helpers.admins import Admin, signed_in
from tests.helpers.ports import free_port
from tests.helpers.studies import StudyInDatabase
from tests.server.test_durability import start

STREAM = "/studies/short/monitor/stream"


def read_token(admin: Admin) -> str:
    made = admin.send("POST", "/tokens", {"name": "monitor", "scopes": ["read"], "days": 1})
    assert made.status_code == 201, made.text
    return str(made.json()["token"])


@pytest.mark.parametrize("database_url", ["sqlite"], indirect=True)
def test_the_stream_ends_after_its_time_and_says_when_to_come_back(
    client: TestClient, services: Services, study: StudyInDatabase
) -> None:
    services.settings.monitor_stream_minutes = 0.01
    answer = signed_in(client, services, "viewer").get(STREAM)
    assert answer.headers["content-type"].startswith("text/event-stream")
    retry, *events = answer.text.strip().split("\n\n")
    assert retry == "retry: 1000"
    assert len(events) == 1
    assert json.loads(events[0].partition("data: ")[2])["study"] == "short"


@pytest.mark.parametrize("database_url", ["sqlite"], indirect=True)
def test_the_stream_ends_when_the_session_does(
    client: TestClient, services: Services, study: StudyInDatabase
) -> None:
    viewer = signed_in(client, services, "viewer")
    looks = iter(range(100))

    class SignOut(Stopping):
        """Ends every session at the stream's first look, in the place of somebody who signs out."""

        def __bool__(self) -> bool:
            if next(looks) == 0:
                with services.database.write() as session:
                    session.execute(update(AdminSession).values(revoked_at=now()))
            return False

    object.__setattr__(services, "stopping", SignOut())
    answer = viewer.get(STREAM)
    assert answer.text.count("event: monitor") == 1


@pytest.mark.parametrize("database_url", ["sqlite"], indirect=True)
def test_a_server_with_open_streams_ends_before_its_grace_is_over(
    client: TestClient, services: Services, settings: Settings, study: StudyInDatabase
) -> None:
    token, port = read_token(signed_in(client, services, "viewer")), free_port()
    process = start(settings, port)
    connections, streams = [], []
    try:
        for _ in range(3):
            connection = http.client.HTTPConnection("127.0.0.1", port, timeout=30)
            connections.append(connection)
            connection.request("GET", f"/api/admin{STREAM}", headers={"authorization": f"Bearer {token}"})
            answer = connection.getresponse()
            assert answer.status == 200
            assert answer.readline() == b"retry: 1000\n"
            streams.append(answer)
        told = time.monotonic()
        os.kill(process.pid, signal.SIGTERM)
        assert process.wait(60) in (0, -signal.SIGTERM)
        assert time.monotonic() - told < GRACE_S
    finally:
        process.kill()
    for connection, answer in zip(connections, streams, strict=True):
        assert b"event: monitor" in answer.read()
        connection.close()
