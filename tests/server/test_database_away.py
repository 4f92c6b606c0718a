"""An unreachable database is reported by 503, so that pages send again, and by one line in the log."""

import logging
import sqlite3
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path

import pytest
from fastapi.testclient import TestClient
from sqlalchemy import text
from sqlalchemy.exc import DBAPIError
from sqlalchemy.exc import TimeoutError as PoolTimeout

from server import context
from server.app import create_app
from server.cli_common import refusal
from server.context import Services
from server.core import db
from server.core.db import Database, is_away
from server.core.settings import Settings
from tests.helpers.databases import run_server_command
from tests.helpers.studies import Participant, StudyInDatabase


def refused(url: str, statement: str = "SELECT 1") -> DBAPIError:
    database = Database(url)
    with pytest.raises(DBAPIError) as caught, database.engine.connect() as connection:
        connection.exec_driver_sql(statement)
    database.close()
    return caught.value


def test_what_cannot_be_reached_is_away(tmp_path: Path) -> None:
    assert is_away(refused("postgresql+psycopg://me@127.0.0.1:1/none"))
    assert is_away(refused(f"sqlite:///{tmp_path / 'no folder' / 'file'}"))
    assert not is_away(refused(f"sqlite:///{tmp_path / 'file'}", "SELECT nothing"))
    assert not is_away(ValueError())


def test_a_request_gets_503_and_the_log_one_line(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    settings = Settings(data_folder=tmp_path, database_url="postgresql://me@127.0.0.1:1/none")
    with caplog.at_level(logging.ERROR, "palpebra"), TestClient(create_app(settings)) as client:
        for path in ("/api/links/any", "/readyz"):
            answer = client.get(path)
            assert (answer.status_code, answer.json()["error"]["code"]) == (503, "database_away")
        assert client.get("/healthz").status_code == 200
    said = [record for record in caplog.records if record.name == "palpebra"]
    assert len(said) == 2
    assert all(record.exc_info is None for record in said)


@pytest.mark.parametrize(
    "database_url", [pytest.param("postgres", marks=pytest.mark.postgres)], indirect=True
)
def test_after_every_connection_was_cut_ratings_go_on(services: Services, participant: Participant) -> None:
    participant.agree()
    first, second, *_ = participant.state()["trials"]
    assert participant.rate(first).status_code == 201
    with services.database.engine.connect() as connection:
        cut = "SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE pid <> pg_backend_pid() "
        connection.execute(text(cut + "AND datname = current_database()"))
    assert participant.rate(second).status_code == 201


@pytest.fixture
def soon_busy(monkeypatch: pytest.MonkeyPatch) -> None:
    """A server whose requests wait for a locked database for a moment only; to be named before `client`."""
    monkeypatch.setattr(context, "REQUEST_BUSY_S", 0.5)


@pytest.mark.parametrize("database_url", ["sqlite"], indirect=True)
@pytest.mark.usefixtures("soon_busy")
def test_a_locked_database_is_distinguished_and_nobody_waits_in_a_queue(
    services: Services, participant: Participant
) -> None:
    participant.agree()
    trials = participant.state()["trials"][:4]
    path = services.settings.database_url.removeprefix("sqlite:///")
    with closing(sqlite3.connect(path, isolation_level=None)) as other, ThreadPoolExecutor(4) as pool:
        other.execute("BEGIN IMMEDIATE")
        ratings = list(pool.map(participant.rate, trials))
        consent = participant.request("PUT", "/consent", {"agreed": True})
    for answer in (*ratings, consent):
        assert (answer.status_code, answer.json()["error"]["code"]) == (503, "database_busy")
        assert int(answer.headers["retry-after"]) > 0
    assert [participant.rate(trial).status_code for trial in trials] == [201] * 4


def test_a_pool_that_is_used_up_is_not_another_program() -> None:
    said = refusal(PoolTimeout("QueuePool limit of size 1 overflow 1 reached")) or ""
    assert ("PALPEBRA_DATABASE_POOL" in said, "another program" in said) == (True, False)


@pytest.mark.parametrize("database_url", ["sqlite"], indirect=True)
@pytest.mark.usefixtures("soon_busy")
def test_a_command_on_a_locked_database_ends_in_one_line(
    settings: Settings, study: StudyInDatabase, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(db, "BUSY_TIMEOUT_S", 0.5)
    out, path = tmp_path / "short.csv", settings.database_url.removeprefix("sqlite:///")
    with closing(sqlite3.connect(path, isolation_level=None)) as other:
        other.execute("BEGIN EXCLUSIVE")
        called = run_server_command(settings, "export", "short", "--out", str(out))
    assert (called.returncode, out.exists()) == (2, False)
    assert called.stderr.count("\n") == 1, called.stderr
    assert "has locked the database" in called.stderr
