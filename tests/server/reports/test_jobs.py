"""How work in the background ends: by an unforeseen error, with a database away, with its process."""

import logging
import subprocess
import sys
import time
from collections.abc import Callable
from datetime import timedelta
from typing import Any

import pytest
from sqlalchemy import update
from sqlalchemy.exc import OperationalError

from server.accounts.identity import OPERATOR
from server.context import Services
from server.core.values import now
from server.models import Job
from server.results import jobs
from server.studies.lookup import find_study
from tests.helpers.admins import Admin
from tests.helpers.databases import server_environment
from tests.helpers.studies import StudyInDatabase

HOLDS = """
import sys
from server.core.db import open_database
from server.core.locks import open_locks
from server.core.settings import Settings
settings = Settings()
with open_locks(settings, open_database(settings)).of_job(sys.argv[1]):
    print(flush=True)
    sys.stdin.read()
"""


@pytest.fixture
def job(services: Services, study: StudyInDatabase) -> str:
    """The public id of a report that waits."""
    with services.database.write() as session:
        known = find_study(session, "short", OPERATOR, "run")
        return jobs.begin_job(services.locks, session, known, "report", {}, OPERATOR, "").public_id


def ended(services: Services, public_id: str) -> tuple[str, str]:
    limit = time.monotonic() + 60
    while True:
        with services.database.read() as session:
            stored = session.query(Job).filter_by(public_id=public_id).one()
            if stored.status not in jobs.UNDER_WAY:
                return stored.status, stored.message
        assert time.monotonic() < limit
        time.sleep(0.02)


def raising(error: Exception) -> Callable[[], None]:
    def work() -> None:
        raise error

    return work


@pytest.mark.parametrize(
    ("error", "told"), [(OSError("disk full"), "disk full"), (KeyError("series"), jobs.UNFORESEEN)]
)
def test_any_error_ends_a_job_and_is_reported_or_logged(
    services: Services, job: str, caplog: pytest.LogCaptureFixture, error: Exception, told: str
) -> None:
    with caplog.at_level(logging.ERROR):
        jobs.in_background(services.database, services.locks, job, raising(error))
        assert ended(services, job) == ("failed", told)
    assert ("KeyError: 'series'" in caplog.text) == isinstance(error, KeyError)


def test_the_end_is_written_once_the_database_takes_it(
    services: Services, job: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    note, refusals = jobs.note, [OperationalError("UPDATE", {}, OSError("gone"))] * 3

    def away_at_first(*values: Any, **more: Any) -> None:
        if refusals:
            raise refusals.pop()
        note(*values, **more)

    monkeypatch.setattr(jobs, "note", away_at_first)
    monkeypatch.setattr(jobs, "WRITE_AGAIN_S", (0, 0, 0, 0))
    jobs.in_background(services.database, services.locks, job, raising(OSError("disk full")))
    assert ended(services, job) == ("failed", "disk full")


def test_what_has_ended_stays_as_it_ended(services: Services, job: str) -> None:
    jobs.note(services.database, job, status="cancelled", message="")
    jobs.note(services.database, job, status="done", message="late")
    assert ended(services, job) == ("cancelled", "")


def test_a_job_whose_process_was_killed_is_over_at_once(
    services: Services, job: str, experimenter: Admin
) -> None:
    with services.database.write() as session:  # long enough ago that its process has its lock, or none
        session.execute(update(Job).values(created_at=now() - timedelta(minutes=1)))
    holder, environment = [sys.executable, "-c", HOLDS, job], server_environment(services.settings)
    with subprocess.Popen(holder, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=environment) as other:
        assert other.stdout is not None
        other.stdout.readline()
        [shown] = experimenter.get("/studies/short/reports").json()
        assert shown["status"] == "queued"
        assert experimenter.send("POST", "/studies/short/reports", {}).status_code == 409
        other.kill()
    [shown] = experimenter.get("/studies/short/reports").json()
    assert (shown["status"], "server stopped" in shown["message"]) == ("failed", True)
    again = experimenter.send("POST", "/studies/short/reports", {})
    assert again.status_code == 202
    ended(services, again.json()["id"])
