"""SIGTERM while people rate: the server leaves by itself, and what it acknowledged is there."""

import os
import signal
import threading
import time
import uuid

from sqlalchemy import text

from server.context import Services
from server.core.settings import Settings
from server.rehearsals.http import JsonClient
from server.rehearsals.person import Person, Rater
from tests.helpers.ports import free_port
from tests.helpers.studies import StudyInDatabase
from tests.server.test_durability import start

RATERS = 4


def rate_until_refused(port: int, link: str, number: int, acknowledged: set[str]) -> None:
    client = JsonClient(f"http://127.0.0.1:{port}")
    person = Person(client, Rater(number, 1, {}))
    try:
        person.begin(link)
        client.put("/api/run/consent", {"agreed": True})
        state = client.get("/api/run")
        for trial in state["trials"]:
            rating_id = str(uuid.uuid4())
            client.put(f"/api/run/ratings/{rating_id}", person.rating(trial, state["trial"]))
            acknowledged.add(rating_id)
            time.sleep(0.02)
    except OSError:
        return
    finally:
        client.close()


def test_what_was_acknowledged_before_the_end_is_stored_and_visits_go_on(
    services: Services, settings: Settings, study: StudyInDatabase
) -> None:
    port = free_port()
    process = start(settings, port)
    acknowledged: set[str] = set()
    raters = [
        threading.Thread(target=rate_until_refused, args=(port, study.link_token, number, acknowledged))
        for number in range(RATERS)
    ]
    for rater in raters:
        rater.start()
    deadline = time.monotonic() + 60
    while len(acknowledged) < 3 * RATERS and time.monotonic() < deadline:
        time.sleep(0.01)
    os.kill(process.pid, signal.SIGTERM)
    assert process.wait(30) in (0, -signal.SIGTERM)
    for rater in raters:
        rater.join(30)
    with services.database.read() as session:
        stored = set(session.execute(text("SELECT rating_id FROM trial_ratings")).scalars())
    assert len(acknowledged) >= 3 * RATERS
    assert acknowledged <= stored
