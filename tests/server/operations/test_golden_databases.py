"""Golden databases of later revisions: upgraded in place or restored, they arrive complete, row for row."""

import csv
import gzip
import io
import json
import sqlite3
import uuid
from datetime import timedelta
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient
from sqlalchemy import select

from server.accounts.identity import OPERATOR
from server.app import create_app
from server.context import Services, open_services
from server.core.migrate import current_revision, newest_revision, upgrade
from server.core.settings import Settings
from server.core.values import derived_token
from server.exports.formats import FORMATS
from server.exports.schemas import Extract
from server.models import Rating, Study, StudyRun
from server.operations.restore import restore
from server.participation import returning
from server.participation.links import RUN_PURPOSE
from server.studies.lookup import find_study
from tests.helpers.admins import signed_in
from tests.helpers.databases import BACKENDS
from tests.helpers.golden_databases import (
    FOLDER,
    REVISIONS,
    SECRET_KEY,
    contents_of,
    golden_contents,
    golden_ratings,
    load_golden_database,
)
from tests.helpers.studies import Participant

both = pytest.mark.parametrize("empty_database_url", BACKENDS, indirect=True)
each = pytest.mark.parametrize("revision", REVISIONS)
KINDS = {"clip_rating", "continuous_rating", "paired_comparison", "threshold"}


def opened(url: str, folder: Path) -> Services:
    return open_services(Settings(database_url=url, data_folder=folder / "data", secret_key=SECRET_KEY))


def check_complete(services: Services, revision: str) -> None:
    """Every row of every table, and every study's ratings, as they were when the files were made."""
    assert current_revision(services.database) == newest_revision()
    known = golden_contents(revision)
    assert contents_of(services.database, known) == known
    ratings = golden_ratings(revision)
    for name, before in ratings.items():
        with services.database.read() as session:
            study = find_study(session, name, OPERATOR, "view")
            after = b"".join(FORMATS["csv"](session, study, Extract("all")))
        rows = table_rows(before)
        assert len(rows) > 5
        assert [{key: plain(row[key]) for key in rows[0]} for row in table_rows(after)] == [
            {key: plain(value) for key, value in row.items()} for row in rows
        ]


def plain(cell: str) -> Any:
    """A cell's value: SQLite and PostgreSQL write a list of numbers with other spaces."""
    return json.loads(cell) if cell.startswith("[") else cell


def table_rows(content: bytes) -> list[dict[str, Any]]:
    return list(csv.DictReader(io.StringIO(content.decode("utf-8-sig"), newline="")))


@each
def test_a_golden_database_has_answers_of_every_kind(revision: str, tmp_path: Path) -> None:
    load_golden_database(revision, f"sqlite:///{tmp_path / 'golden.sqlite'}")
    with sqlite3.connect(tmp_path / "golden.sqlite") as connection:
        kinds = {row[0] for row in connection.execute("SELECT DISTINCT kind FROM trial_ratings")}
    assert kinds >= KINDS


def test_there_are_golden_databases() -> None:
    assert REVISIONS


@both
@each
def test_an_upgrade_in_place_keeps_every_row(revision: str, empty_database_url: str, tmp_path: Path) -> None:
    load_golden_database(revision, empty_database_url)
    services = opened(empty_database_url, tmp_path)
    assert current_revision(services.database) == revision
    upgrade(services.database)
    check_complete(services, revision)
    services.database.close()


@both
@each
def test_a_restored_backup_has_every_row(revision: str, empty_database_url: str, tmp_path: Path) -> None:
    services = opened(empty_database_url, tmp_path)
    backup = tmp_path / f"{revision}.tar"
    backup.write_bytes(gzip.decompress((FOLDER / f"{revision}.tar.gz").read_bytes()))
    restore(
        services.database,
        services.settings,
        services.clips,
        backup,
        keys=FOLDER / f"{revision}.keys.json",
        despite_erasures=True,
    )
    check_complete(services, revision)
    services.database.close()


@each
def test_every_visit_opens_on_its_page(revision: str, tmp_path: Path) -> None:
    url = f"sqlite:///{tmp_path / 'golden.sqlite'}"
    load_golden_database(revision, url)
    services = opened(url, tmp_path)
    upgrade(services.database)
    statuses = {}
    with TestClient(create_app(services.settings)) as client:
        admin = signed_in(client, services, "owner", "harness")
        for study in golden_ratings(revision):
            rows = admin.get(f"/studies/{study}/runs?simulated=true&limit=100").json()["runs"]
            for row in rows:
                path = f"/studies/{study}/runs/{row['run']}"
                for ending in ("", "/replay", "/subject-access"):
                    statuses[path + ending] = admin.get(path + ending).status_code
    services.database.close()
    assert len(statuses) > 60
    assert {path: status for path, status in statuses.items() if status >= 500} == {}


@each
def test_a_page_left_open_over_the_upgrade_delivers_its_outbox(
    revision: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of the visit left half-way: what was kept is stored, once."""
    url = f"sqlite:///{tmp_path / 'golden.sqlite'}"
    load_golden_database(revision, url)
    services = opened(url, tmp_path)
    upgrade(services.database)
    of_run = select(StudyRun).join(Study).where(Study.name == "short", StudyRun.status == "active")
    with services.database.read() as session:
        run = session.scalars(of_run.where(StudyRun.consented_at.is_not(None))).one()
        arrived = session.scalars(select(Rating).where(Rating.study_run_id == run.id)).all()
        token, left_at = derived_token(services.settings.key, RUN_PURPOSE, run.public_id), run.last_seen_at
    # The files are of a fixed day, and a visit may be taken up again for 72 hours: it is still that day.
    monkeypatch.setattr(returning, "now", lambda: left_at + timedelta(hours=1))
    with TestClient(create_app(services.settings)) as client:
        page = Participant(client, "")
        page.token = token
        kept = {str(uuid.uuid4()): trial for trial in page.state()["trials"] if not trial["answered"]}
        for status in (201, 200):
            for name, trial in kept.items():
                assert page.rate(trial, rating_id=name, play=trial["plays_done"] + 1).status_code == status
        event = {"id": str(uuid.uuid4()), "type": "online", "data": {}}
        assert page.request("POST", "/events", {"events": [event]}).status_code == 200
        assert all(trial["answered"] for trial in page.state()["trials"])
    with services.database.read() as session:
        stored = session.scalars(select(Rating).where(Rating.study_run_id == run.id)).all()
        assert len(stored) == len(arrived) + len(kept) > len(arrived)
    services.database.close()
