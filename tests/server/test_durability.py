"""A real server process is killed without warning while ratings arrive: what was acknowledged is there."""

import json
import os
import random
import signal
import subprocess
import sys
import time
import uuid

from sqlalchemy import text

from server.context import Services
from server.core.settings import Settings
from server.rehearsals.http import JsonClient
from server.rehearsals.person import Person, Rater
from tests.helpers.databases import server_environment
from tests.helpers.ports import free_port
from tests.helpers.studies import StudyInDatabase

KILLS = 3


def start(settings: Settings, port: int) -> subprocess.Popen[bytes]:
    """Start `server run` and wait until it answers."""
    command = [sys.executable, "-m", "server", "run", "--port", str(port)]
    process = subprocess.Popen(command, env=server_environment(settings), start_new_session=True)
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline:
        client = JsonClient(f"http://127.0.0.1:{port}")
        try:
            client.get("/healthz")
        except OSError:
            time.sleep(0.05)
        else:
            return process
        finally:
            client.close()
    raise TimeoutError("the server did not start")


def test_no_acknowledged_rating_is_lost_or_doubled(
    services: Services, settings: Settings, study: StudyInDatabase
) -> None:
    port, rng = free_port(), random.Random(5)
    services.database.engine.dispose()
    process = start(settings, port)
    acknowledged: dict[str, int] = {}
    sent = 0
    try:
        for number in range(KILLS):
            client = JsonClient(f"http://127.0.0.1:{port}")
            person = Person(client, Rater(number, 1, {}))
            person.begin(study.link_token)
            client.put("/api/run/consent", {"agreed": True})
            state = client.get("/api/run")
            last = rng.randrange(3, len(state["trials"]))
            for trial in state["trials"]:
                rating_id, body = str(uuid.uuid4()), person.rating(trial, state["trial"])
                if trial["trial_index"] == last:
                    # The request is under way when the server dies; the client sends it again afterwards.
                    client.send("PUT", f"/api/run/ratings/{rating_id}", body)
                    os.killpg(process.pid, signal.SIGKILL)
                    process.wait()
                    process = start(settings, port)
                    client.close()
                status, answer = client.call("PUT", f"/api/run/ratings/{rating_id}", body)
                assert status in (200, 201)
                sent += 1
                acknowledged[answer["receipt"]["rating_id"]] = body["answer"]["answers"]["rating"]["response"]
            client.close()
    finally:
        os.killpg(process.pid, signal.SIGTERM)
        assert process.wait(30) in (0, -signal.SIGTERM)
    with services.database.read() as session:
        stored = dict(map(tuple, session.execute(text("SELECT rating_id, payload FROM trial_ratings"))))
        if services.database.is_sqlite:
            assert session.scalar(text("PRAGMA integrity_check")) == "ok"
    answers = {ident: json.loads(text) if isinstance(text, str) else text for ident, text in stored.items()}
    assert answers == {ident: {"response": response} for ident, response in acknowledged.items()}
    assert len(stored) == sent == KILLS * 12
