"""Snapshots of SQLite: whole copies of one moment while ratings go on, thinned with age, and gone back to."""

import asyncio
import os
import sqlite3
import stat
import subprocess
import sys
import threading
from contextlib import closing
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from fastapi.testclient import TestClient
from hypothesis import given
from hypothesis import strategies as st
from sqlalchemy import func, select

from server.context import Services, open_services
from server.core.locks import file_lock
from server.core.settings import Settings
from server.core.values import now
from server.models import AuditEntry, IdentityKey, Rating, StudyRun
from server.operations import doctor
from server.operations.snapshots import (
    ALL_OF,
    DAILY_OF,
    HOURLY_OF,
    LOCK,
    SnapshotUnderWayError,
    database_file,
    is_due,
    set_aside,
    snapshots_of,
    snapshots_taken,
    superfluous_snapshots,
    take_due_snapshot,
    take_snapshot,
)
from server.participation.identity_keys import ParticipantIdentity
from server.participation.identity_repository import store_identity
from server.privacy.ledger import note_erased
from tests.helpers.admins import Admin
from tests.helpers.databases import run_server_command
from tests.helpers.studies import Participant, StudyInDatabase
from tests.helpers.waiting import run_in_own_loop

NOON = datetime(2026, 11, 24, 12, tzinfo=UTC)
ON_SQLITE = pytest.mark.parametrize("database_url", ["sqlite"], indirect=True)


def ratings_in(path: Path) -> int:
    with closing(sqlite3.connect(path)) as connection:
        assert connection.execute("PRAGMA integrity_check").fetchone() == ("ok",)
        (count,) = connection.execute("SELECT count(*) FROM trial_ratings").fetchone()
    return int(count)


def closed(services: Services) -> None:
    """As when the server was stopped."""
    services.group_commit.close()
    services.database.close()


def stored(services: Services) -> int:
    with services.database.read() as session:
        return session.scalar(select(func.count()).select_from(Rating)) or 0


@ON_SQLITE
class TestTaking:
    def test_it_holds_what_was_committed_and_is_for_its_owner_alone(
        self, services: Services, participant: Participant
    ) -> None:
        participant.agree().rate_all()
        snapshot = take_snapshot(services.settings)
        assert ratings_in(snapshot.path) == stored(services) > 0
        assert stat.S_IMODE(snapshot.path.stat().st_mode) == 0o600
        assert {path.name for path in snapshot.path.parent.iterdir()} == {snapshot.path.name, LOCK}
        assert snapshots_of(services.settings) == [snapshot]

    def test_while_another_program_writes_it_is_of_one_moment(self, services: Services) -> None:
        with services.database.write_connection() as connection:
            connection.exec_driver_sql("CREATE TABLE pairs (a INTEGER, b INTEGER)")
        done = threading.Event()

        def write() -> None:
            number = 0
            while not done.is_set():
                with services.database.write_connection() as connection:
                    number += 1
                    connection.exec_driver_sql("INSERT INTO pairs VALUES (?, NULL)", (number,))
                    connection.exec_driver_sql("UPDATE pairs SET b = a WHERE a = ?", (number,))

        writer = threading.Thread(target=write)
        writer.start()
        try:
            taken = []
            for _ in range(3):
                path = take_snapshot(services.settings).path
                with closing(sqlite3.connect(path)) as connection:
                    rows = "SELECT count(*), max(a), count(b) FROM pairs"
                    taken.append(connection.execute(rows).fetchone())
        finally:
            done.set()
            writer.join()
        for count, latest, whole in taken:
            assert count == (latest or 0) == whole  # no hole, and no half transaction

    def test_what_a_killed_process_left_goes(self, services: Services) -> None:
        folder = services.settings.data_folder / "snapshots"
        folder.mkdir(parents=True)
        (folder / ".palpebra-2026-01-01T000000Z.sqlite").write_bytes(b"half")
        take_snapshot(services.settings)
        assert not list(folder.glob(".palpebra*"))

    def test_two_at_once_are_one(self, services: Services) -> None:
        with (
            file_lock(services.settings.data_folder / "snapshots" / LOCK),
            pytest.raises(SnapshotUnderWayError),
        ):
            take_snapshot(services.settings)

    def test_a_damaged_database_makes_none(self, services: Services, study: StudyInDatabase) -> None:
        closed(services)
        path = database_file(services.settings)
        content = bytearray(path.read_bytes())
        content[8192:40960] = os.urandom(32768)
        path.write_bytes(content)
        done = run_server_command(services.settings, "database", "snapshot")
        assert done.returncode == 2
        assert len(done.stderr.strip().splitlines()) == 1, done.stderr
        assert snapshots_of(services.settings) == []

    def test_postgresql_is_given_where_to_look(self, services: Services) -> None:
        settings = Settings(
            database_url="postgresql://me@localhost/lab", data_folder=services.settings.data_folder
        )
        for command in (("snapshot",), ("snapshots",), ("go-back", "newest")):
            done = run_server_command(settings, "database", *command)
            assert done.returncode == 2
            assert "deploy/point-in-time.sh" in done.stderr


@ON_SQLITE
class TestSchedule:
    def test_one_is_due_when_the_time_is_up_and_something_was_written(self, services: Services) -> None:
        settings = services.settings.model_copy(update={"snapshot_minutes": 10.0})
        assert is_due(settings, now())
        taken = take_snapshot(settings)
        later = taken.taken_at + timedelta(minutes=11)
        path = database_file(settings)
        os.utime(path, (taken.taken_at.timestamp() - 5,) * 2)
        (wal := path.with_name(path.name + "-wal")).exists() and os.utime(
            wal, (taken.taken_at.timestamp() - 5,) * 2
        )
        assert not is_due(settings, later)
        os.utime(path, (taken.taken_at.timestamp() + 60,) * 2)
        assert is_due(settings, later)
        assert not is_due(settings, taken.taken_at + timedelta(minutes=9))

    def test_the_server_takes_them_while_it_runs(self, services: Services) -> None:
        settings = services.settings.model_copy(update={"snapshot_minutes": 0.001})

        async def run() -> None:
            async with snapshots_taken(settings, look_every_s=0.02):
                for _ in range(500):
                    await asyncio.sleep(0.02)
                    if snapshots_of(settings):
                        return

        run_in_own_loop(run())
        assert len(snapshots_of(settings)) >= 1

    def test_none_are_taken_unasked(self, services: Services) -> None:
        async def run() -> None:
            async with snapshots_taken(services.settings, look_every_s=0.01):
                await asyncio.sleep(0.1)

        run_in_own_loop(run())
        assert snapshots_of(services.settings) == []


class TestThinning:
    @pytest.mark.parametrize("every_min", [5, 15, 60])
    def test_a_week_of_them(self, every_min: int) -> None:
        moments = [NOON - timedelta(minutes=every_min * number) for number in range(14 * 1440 // every_min)]
        gone = set(superfluous_snapshots(moments, NOON))
        left = [moment for moment in moments if moment not in gone]
        assert sum(moment >= NOON - ALL_OF for moment in left) == 60 // every_min + 1
        hours = {f"{moment:%dT%H}" for moment in left if NOON - HOURLY_OF <= moment < NOON - ALL_OF}
        assert len(hours) >= 23
        assert min(left) >= NOON - DAILY_OF
        assert len(left) <= 60 // every_min + 1 + 25 + 8
        assert left[0] == NOON

    @given(minutes=st.lists(st.integers(0, 20_000), min_size=1, max_size=60))
    def test_what_stays_stays_when_it_is_thinned_again(self, minutes: list[int]) -> None:
        moments = {NOON - timedelta(minutes=number) for number in minutes}
        left = moments - set(superfluous_snapshots(moments, NOON))
        assert max(moments) in left
        assert superfluous_snapshots(left, NOON) == []


@ON_SQLITE
class TestGoingBack:
    def test_a_deleted_study_is_there_again(
        self, services: Services, client: TestClient, study: StudyInDatabase, experimenter: Admin
    ) -> None:
        Participant(client, study.link_token).agree().rate_all()
        before = stored(services)
        taken = take_snapshot(services.settings)
        with services.database.write_connection() as connection:
            connection.exec_driver_sql("DELETE FROM trial_ratings")
        closed(services)
        done = run_server_command(services.settings, "database", "go-back", "newest")
        assert done.returncode == 0, done.stderr
        said = done.stdout.splitlines()
        (aside,) = set_aside(services.settings)
        assert said[0] == "0 runs erased again, by the ledger of erasures"
        assert said[1].endswith("with 1 run")
        assert said[2] == f"the previous database is kept at {aside}"
        assert stored(services) == before
        assert ratings_in(aside) == 0
        with services.database.read() as session:
            last = session.scalars(select(AuditEntry).order_by(AuditEntry.id.desc()).limit(1)).one()
        assert (last.action, last.target[:16]) == ("database taken back", f"{taken.taken_at:%Y-%m-%dT%H:%M}")
        assert run_server_command(services.settings, "audit", "verify").returncode == 0
        finding = list(doctor.snapshots(services))[-1]
        assert finding.verdict == "warning"
        assert str(aside) in finding.advice

    def test_while_a_program_has_the_database_open_nothing_is_changed(
        self, services: Services, study: StudyInDatabase
    ) -> None:
        take_snapshot(services.settings)
        path = database_file(services.settings)
        program = (
            "import sqlite3, sys; c = sqlite3.connect(sys.argv[1]); c.execute('SELECT count(*) FROM studies')"
        )
        program += ".fetchone(); print('open', flush=True); sys.stdin.read()"
        command = [sys.executable, "-c", program, str(path)]
        with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as other:
            assert other.stdout is not None
            other.stdout.readline()
            done = run_server_command(services.settings, "database", "go-back", "newest")
            other.communicate()
        assert done.returncode == 2
        assert "stop the server first. Nothing was changed" in done.stderr
        assert set_aside(services.settings) == []

    def test_a_database_that_is_none_any_more_is_set_aside(
        self, services: Services, study: StudyInDatabase
    ) -> None:
        take_snapshot(services.settings)
        closed(services)
        path = database_file(services.settings)
        for ending in ("-wal", "-shm"):
            path.with_name(path.name + ending).unlink(missing_ok=True)
        path.write_bytes(b"no database at all, but long enough to be looked at" * 20)
        done = run_server_command(services.settings, "database", "go-back", "newest")
        assert done.returncode == 0, done.stderr
        with services.database.read() as session:
            assert session.scalar(select(func.count()).select_from(StudyRun)) == 0
        assert len(set_aside(services.settings)) == 1

    @pytest.mark.parametrize(
        ("moment", "said"),
        [
            ("yesterday", "expected a time such as"),
            ("2020-01-01T00:00:00Z", "there is no snapshot up to 2020"),
        ],
    )
    def test_other_moments_are_refused(
        self, services: Services, study: StudyInDatabase, moment: str, said: str
    ) -> None:
        take_snapshot(services.settings)
        done = run_server_command(services.settings, "database", "go-back", moment)
        assert done.returncode == 2
        assert said in done.stderr


@ON_SQLITE
class TestErasures:
    def test_who_is_erased_is_erased_in_the_snapshots_too(
        self, services: Services, client: TestClient, experimenter: Admin, study: StudyInDatabase
    ) -> None:
        visit = Participant(client, study.link_token).agree()
        visit.rate_all()
        with services.database.write() as session:
            run = session.scalars(select(StudyRun)).one()
            store_identity(session, run, run.study.pseudonym_key, ParticipantIdentity("5a9d"))
        settings = services.settings.model_copy(update={"snapshot_minutes": 60.0})
        take_due_snapshot(settings)
        (taken,) = snapshots_of(settings)
        path = f"/studies/short/runs/{visit.run_id}/erase"
        assert experimenter.send("POST", path, {"confirm": visit.run_id}).status_code == 200
        assert ratings_in(taken.path) > 0
        take_due_snapshot(settings)
        assert snapshots_of(settings) == [taken]
        assert ratings_in(taken.path) == 0
        copy = open_services(settings.model_copy(update={"database_url": f"sqlite:///{taken.path}"}))
        with copy.database.read() as session:
            assert session.scalar(select(func.count()).select_from(IdentityKey)) == 0
        copy.database.close()

    def test_one_of_before_is_erased_again_when_it_comes_back(
        self, services: Services, participant: Participant
    ) -> None:
        participant.agree()
        take_snapshot(services.settings)
        note_erased(services.settings, [participant.run_id])
        closed(services)
        done = run_server_command(services.settings, "database", "go-back", "newest")
        assert done.stdout.splitlines()[0] == "1 run erased again, by the ledger of erasures"
        with services.database.read() as session:
            assert session.scalars(select(StudyRun)).one().erased_at is not None
