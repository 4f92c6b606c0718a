"""deploy/restore.sh onto a deployment in use: a real PostgreSQL, the real command, a stand-in for `docker`.

The stand-in only says where things run: psql in the container is psql here, `server` is this checkout's.
"""

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from sqlalchemy import create_engine, text
from sqlalchemy.engine import URL

from server.context import open_services
from server.core.db import Database
from server.core.migrate import upgrade
from server.core.settings import Settings
from server.operations.backup import back_up
from tests.conftest import REPOSITORY
from tests.helpers.databases import postgres_server  # noqa: F401 - fixture

DOCKER = """#!{python}
import os, subprocess, sys
asked = sys.argv[1:]
with open(os.environ["APP"] + "/calls", "a") as calls:
    calls.write(" ".join(asked) + "\\n")
if asked[:5] == ["compose", "exec", "-T", "database", "psql"]:
    command = ["psql", "-q", "-v", "ON_ERROR_STOP=1", os.environ["ADMIN_URL"], *asked[asked.index("-c"):]]
elif "--entrypoint" in asked:
    command = ["sh", *asked[asked.index("-c"):]]
elif asked[:2] == ["compose", "run"]:
    command = ["{python}", "-m", "server", *asked[asked.index("server") + 1:]]
else:
    sys.exit(0)
sys.exit(subprocess.run(command, cwd=os.environ["APP"]).returncode)
"""
AUDIT = (
    "INSERT INTO audit_entries (at, actor, action, target_kind, target, details) "
    "VALUES ('2026-01-01 00:00:00', :who, '', '', '', '{}')"
)


class Deployment:
    """A folder as the containers see it, and the database `palpebra`."""

    def __init__(self, app: Path, server: URL) -> None:
        self.app, self.server = app, server
        for name in ("data", "backups", "bin"):
            (app / name).mkdir()
        stand_in = app / "bin" / "docker"
        stand_in.write_text(DOCKER.replace("{python}", sys.executable))
        stand_in.chmod(0o755)
        self.admin("CREATE DATABASE palpebra")
        (app / "data" / "secret_key").write_text("the old key")
        self.fill(self.url("palpebra"), "old")

    def url(self, name: str) -> str:
        return self.server.set(database=name).render_as_string(hide_password=False)

    def admin(self, statement: str) -> list[str]:
        engine = create_engine(self.url("postgres"), isolation_level="AUTOCOMMIT")
        with engine.connect() as connection:
            done = connection.execute(text(statement))
            rows = [str(row[0]) for row in done] if done.returns_rows else []
        engine.dispose()
        return rows

    def fill(self, url: str, who: str) -> None:
        database = Database(url)
        upgrade(database)
        with database.write_connection() as connection:
            connection.execute(text(AUDIT), {"who": who})
        database.close()

    def who(self, name: str) -> str:
        database = Database(self.url(name))
        with database.engine.connect() as connection:
            found = str(connection.execute(text("SELECT actor FROM audit_entries")).scalar_one())
        database.close()
        return found

    def databases(self) -> list[str]:
        return self.admin("SELECT datname FROM pg_database WHERE datname LIKE 'palpebra%' ORDER BY datname")

    def restore(self, name: str, *options: str) -> subprocess.CompletedProcess[str]:
        environment = {
            **os.environ,
            "PATH": f"{self.app / 'bin'}:{os.environ['PATH']}",
            "PYTHONPATH": str(REPOSITORY),
            "APP": str(self.app),
            "ADMIN_URL": self.url("postgres").replace("+psycopg", ""),
            "DATABASE_URL": self.url("palpebra"),
            "PALPEBRA_DATA_FOLDER": str(self.app / "data"),
            "PALPEBRA_SECRET_KEY": "",
        }
        command = ["sh", str(REPOSITORY / "deploy" / "restore.sh"), name, *options]
        return subprocess.run(command, env=environment, capture_output=True, text=True, check=False)


@pytest.fixture
def deployment(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[Deployment]:
    if os.environ.get("TEST_DATABASE_URL"):
        pytest.skip("it renames the database `palpebra`, so it only runs on a separate PostgreSQL")
    if shutil.which("psql") is None:
        pytest.skip("no psql on this machine")
    made = Deployment(tmp_path, request.getfixturevalue("postgres_server"))
    yield made
    for name in made.databases():
        made.admin(f"DROP DATABASE {name} WITH (FORCE)")


@pytest.mark.postgres
def test_a_backup_comes_back_onto_a_deployment_in_use(deployment: Deployment, tmp_path: Path) -> None:
    elsewhere = Settings(
        data_folder=tmp_path / "elsewhere", database_url=f"sqlite:///{tmp_path}/other.sqlite"
    )
    deployment.fill(elsewhere.database_url, "new")
    services = open_services(elsewhere)
    back_up(
        services.database,
        services.settings,
        services.clips,
        deployment.app / "backups" / "palpebra-2026-01-31T030000.tar",
    )
    services.database.close()
    refused = deployment.restore("palpebra-2026-01-31T030000.tar")
    assert (refused.returncode, deployment.who("palpebra")) == (1, "old")
    assert "newer than the backup" in refused.stderr
    done = deployment.restore("palpebra-2026-01-31T030000.tar", "--despite-erasures")
    assert done.returncode == 0, done.stderr
    assert deployment.who("palpebra") == "new"
    assert (deployment.app / "data" / "secret_key").read_bytes() == elsewhere.key
    [_, before] = deployment.databases()
    assert deployment.who(before) == "old"
    assert before in done.stdout
    assert (deployment.app / "data" / f"secret_key.{before}").read_text() == "the old key"
    assert (deployment.app / "calls").read_text().splitlines()[-1] == "compose up -d"


@pytest.mark.postgres
def test_a_restore_that_fails_leaves_everything_as_it_was(deployment: Deployment) -> None:
    done = deployment.restore("palpebra-2026-02-30T000000.tar")
    assert done.returncode == 1
    assert "put back" in done.stderr
    assert deployment.databases() == ["palpebra"]
    assert deployment.who("palpebra") == "old"
    assert (deployment.app / "data" / "secret_key").read_text() == "the old key"
    assert (deployment.app / "calls").read_text().splitlines()[-1] == "compose up -d"
