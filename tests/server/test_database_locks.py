"""Locks, limits and changes in PostgreSQL: for all processes and threads, and gone with their process."""

import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from functools import partial
from typing import Any

import psycopg
import pytest
from sqlalchemy import make_url, text

from server.context import Services
from server.core.changes import Changes, heard_changes
from server.core.db import Database, kept_alive
from server.core.errors import TooManyRequests
from server.core.limits import RateLimit, SharedCounts
from server.core.locks import DatabaseLocks, LockTaken
from server.core.settings import Settings
from tests.helpers.databases import server_environment
from tests.helpers.waiting import until

PATIENCE_S = 20.0
soon = partial(until, limit_s=PATIENCE_S)
HOLDS = """
import sys
from server.core.locks import DatabaseLocks
from server.core.db import open_database
from server.core.settings import Settings
with DatabaseLocks(open_database(Settings())).held("one"):
    print(flush=True)
    sys.stdin.read()
"""
pytestmark = pytest.mark.parametrize(
    "database_url", [pytest.param("postgres", marks=pytest.mark.postgres)], indirect=True
)


@pytest.fixture
def locks(services: Services) -> DatabaseLocks:
    return DatabaseLocks(services.database)


def cut_lines_of_locks(services: Services) -> None:
    with services.database.write() as session:
        cut = (
            "SELECT pg_terminate_backend(pid) FROM pg_locks "
            "WHERE locktype = 'advisory' AND pid <> pg_backend_pid()"
        )
        assert session.execute(text(cut)).all()


def test_a_lock_is_held_against_other_processes_and_ones_own_threads(
    services: Services, locks: DatabaseLocks
) -> None:
    other = DatabaseLocks(services.database)
    assert not other.is_held("one")
    with locks.held("one"), locks.held("two"):
        assert other.is_held("one")
        for one in (other, locks):
            with pytest.raises(LockTaken), one.held("one"):
                pass
        with other.held("three"):
            pass
    assert not other.is_held("one")
    with other.held("one"):
        pass


def test_a_refused_lock_leaves_no_connection_open(services: Services, locks: DatabaseLocks) -> None:
    def connections() -> int:
        with services.database.engine.connect() as connection:  # each looks in a transaction of its own
            query = "SELECT count(*) FROM pg_stat_activity WHERE datname = current_database()"
            return int(connection.scalar(text(query)) or 0)

    with locks.held("one"):
        before = connections()
        with pytest.raises(LockTaken), DatabaseLocks(services.database).held("one"):
            pass
        soon(lambda: connections() == before)


def test_a_lock_ends_with_a_process_that_is_killed(
    settings: Settings, services: Services, locks: DatabaseLocks
) -> None:
    with subprocess.Popen(
        [sys.executable, "-c", HOLDS],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        env=server_environment(settings),
    ) as holder:
        assert holder.stdout is not None
        holder.stdout.readline()
        assert locks.is_held("one")
        holder.kill()
    soon(lambda: not locks.is_held("one"))
    with locks.held("one"):
        pass


def test_locks_are_taken_again_where_the_connection_was_cut(services: Services, locks: DatabaseLocks) -> None:
    other = DatabaseLocks(services.database)
    with locks.held("one"):
        cut_lines_of_locks(services)
        soon(lambda: not other.is_held("one"))
        with locks.held("two"):
            assert other.is_held("one")
    assert not other.is_held("one")


def test_locks_are_regained_without_being_asked(
    services: Services,
    locks: DatabaseLocks,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    monkeypatch.setattr("server.core.locks.HEARTBEAT_S", 0.2)
    other = DatabaseLocks(services.database)
    with locks.held("one"), locks.held("two"):
        for _ in range(2):
            cut_lines_of_locks(services)
            soon(lambda: other.is_held("one") and other.is_held("two"))
        assert "lost" not in caplog.text
    assert not other.is_held("one")


def test_a_lock_that_another_took_meanwhile_is_reported(
    services: Services,
    locks: DatabaseLocks,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    monkeypatch.setattr("server.core.locks.HEARTBEAT_S", 1.0)
    monkeypatch.setattr("server.core.locks.OWN_LINE_S", 1.5)
    other = DatabaseLocks(services.database)
    with locks.held("one"):
        cut_lines_of_locks(services)
        soon(lambda: not other.is_held("one"))
        with other.held("one"):
            soon(lambda: "another process holds it now" in caplog.text)


def test_a_lock_that_the_line_of_before_still_held_is_regained_when_that_ends(
    services: Services,
    locks: DatabaseLocks,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    monkeypatch.setattr("server.core.locks.HEARTBEAT_S", 1.0)
    before, other = DatabaseLocks(services.database), DatabaseLocks(services.database)
    with locks.held("one"):
        cut_lines_of_locks(services)
        soon(lambda: not other.is_held("one"))
        with before.held("one"):  # as a backend that has not noticed the cut
            old = locks._connection
            soon(lambda: locks._connection is not old and locks._connection is not None)
            assert locks.is_held("one")
            locks._changing.acquire()
        try:
            assert not locks.is_held("one")
        finally:
            locks._changing.release()
        soon(lambda: other.is_held("one"))
        assert locks.is_held("one")
        assert "another process" not in caplog.text
    assert not other.is_held("one")


def test_a_silent_host_is_noticed_by_every_line(
    services: Services, locks: DatabaseLocks, monkeypatch: pytest.MonkeyPatch
) -> None:
    expected = {"keepalives_idle": "20", "keepalives_interval": "10", "keepalives_count": "3"}
    expected |= {"tcp_user_timeout": "30000"}
    with closing(heard_changes(services.database, 0.1)) as listening, monkeypatch.context() as patched:
        connect, lines = psycopg.connect, list[psycopg.Connection[Any]]()
        patched.setattr("psycopg.connect", lambda *of, **by: lines.append(connect(*of, **by)) or lines[-1])
        next(listening)
        assert expected.items() <= lines[0].info.get_parameters().items()
    for engine in (services.database.engine, services.database.counting_engine, locks._engine):
        with engine.connect() as connection:
            line = connection.connection.driver_connection
            assert line is not None
            assert expected.items() <= line.info.get_parameters().items()
    by_hand = kept_alive(make_url("postgresql://me@host/name?keepalives_idle=7"))
    assert by_hand.query["keepalives_idle"] == "7"


def test_counting_needs_no_connection_of_a_pool_that_is_used_up(services: Services) -> None:
    database = Database(services.database.url.render_as_string(hide_password=False), pool=1)
    limit = RateLimit(3, name="x", shared=SharedCounts(database, lambda: b"key"))
    try:
        # Its one and its one more.
        with database.engine.connect(), database.engine.connect(), ThreadPoolExecutor(8) as threads:
            done = [threads.submit(limit.hit, f"key {number}") for number in range(8)]
            for one in done:
                one.result(timeout=PATIENCE_S)
    finally:
        database.close()


def test_a_share_is_one_for_all_processes(services: Services) -> None:
    counts = SharedCounts(services.database, lambda: b"key")
    one, other = (RateLimit(3, name="x", shared=counts) for _ in range(2))
    one.hit("a")
    other.hit("a")
    one.hit("a")
    with pytest.raises(TooManyRequests):
        other.hit("a")
    RateLimit(3, name="y", shared=counts).hit("a")
    with services.database.write() as session:
        session.execute(text("UPDATE shared_counts SET at = at - interval '21 seconds'"))
    other.hit("a")
    with pytest.raises(TooManyRequests) as refused:
        other.hit("a")
    assert 15 <= int((refused.value.headers or {})["retry-after"]) <= 20


def test_nothing_is_counted_twice_however_many_ask_at_once(services: Services) -> None:
    counts, passed = SharedCounts(services.database, lambda: b"key"), []
    limits = [RateLimit(10, name="x", shared=counts) for _ in range(8)]

    def hit(limit: RateLimit) -> None:
        for _ in range(5):
            try:
                limit.hit("a")
            except TooManyRequests:
                continue
            passed.append(1)

    threads = [threading.Thread(target=hit, args=(limit,)) for limit in limits]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert 10 <= len(passed) <= 11  # one comes back in six seconds


def test_counts_that_nobody_needs_go(services: Services) -> None:
    counts = SharedCounts(services.database, lambda: b"key")
    counts.failed("long ago")
    with services.database.write() as session:
        session.execute(text("UPDATE shared_counts SET at = at - interval '7 hours'"))
    counts.failed("long ago")
    assert counts.failures("long ago")[0] == 1
    with services.database.write() as session:
        session.execute(text("UPDATE shared_counts SET at = at - interval '7 hours'"))
    for number in range(1000):
        counts.hit(f"{number % 3}", 1e6, 1, 60)
    assert counts.failures("long ago") == (0, 0.0)


def test_invented_keys_are_bounded_and_the_oldest_go(
    services: Services, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("server.core.limits.KEYS_MAX", 50)
    counts = SharedCounts(services.database, lambda: b"key")
    counts.failed("first")
    for number in range(100):
        counts.hit(f"invented {number}", 10, 1, 60)
    counts.failed("last")
    counts.sweep()
    with services.database.engine.connect() as connection:
        assert connection.scalar(text("SELECT count(*) FROM shared_counts")) == 50
    assert (counts.failures("first")[0], counts.failures("last")[0]) == (0, 1)


def test_a_change_is_heard_of_by_another_process_and_after_a_cut_line(services: Services) -> None:
    here, there = Changes(services.database), Changes(services.database)
    try:
        soon(lambda: there.number is not None)
        before = there.number
        here.tell()
        soon(lambda: there.number != before)
        with services.database.write() as session:
            cut = "SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE query LIKE 'LISTEN palpebra%'"
            assert session.execute(text(cut)).all()
        soon(lambda: there.number is None)
        soon(lambda: there.number is not None)
        before = there.number
        here.tell()
        soon(lambda: there.number not in (before, None))
    finally:
        here.close()
        there.close()
