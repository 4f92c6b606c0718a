"""PgBouncer before PostgreSQL: the doctor detects a pool that takes sessions their connection."""

import os
import shutil
import subprocess
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from sqlalchemy.engine import make_url
from sqlalchemy.exc import OperationalError

from server.context import open_services
from server.core.settings import Settings
from server.operations.doctor import connection_pool
from tests.helpers.ports import free_port

on_postgres = pytest.mark.parametrize(
    "database_url", [pytest.param("postgres", marks=pytest.mark.postgres)], indirect=True
)


@pytest.fixture
def pooled(settings: Settings, request: pytest.FixtureRequest) -> Iterator[Settings]:
    """Settings that lead through a PgBouncer of this mode; its user may use PostgreSQL's socket."""
    program = shutil.which("pgbouncer") or shutil.which("pgbouncer", path="/usr/sbin")
    if program is None:
        pytest.skip("no pgbouncer on this machine")
    url, port, folder = make_url(settings.database_url), free_port(), Path(tempfile.mkdtemp())
    host = str(url.host or url.query["host"])
    (folder / "users").write_text(f'"{url.username}" "{url.password or ""}"\n')
    (folder / "pool.ini").write_text(
        f"[databases]\n* = host={host} port={url.port or 5432} user={url.username}\n"
        f"[pgbouncer]\nlisten_addr = 127.0.0.1\nlisten_port = {port}\nunix_socket_dir =\nauth_type = trust\n"
        f"auth_file = {folder}/users\npool_mode = {request.param}\n"
        "ignore_startup_parameters = extra_float_digits,options\n"
    )
    folder.chmod(0o755)
    may_not_be_root = Path(host).stat().st_uid if os.getuid() == 0 and host.startswith("/") else None
    with subprocess.Popen([program, str(folder / "pool.ini")], user=may_not_be_root) as process:
        through = url.set(host="127.0.0.1", port=port, query={}).render_as_string(hide_password=False)
        yield settings.model_copy(update={"database_url": through})
        process.terminate()
    shutil.rmtree(folder)


@on_postgres
@pytest.mark.parametrize(
    ("pooled", "verdict"), [("transaction", "failed"), ("session", "ok")], indirect=["pooled"]
)
def test_a_pool_in_transaction_mode_is_reported(pooled: Settings, verdict: str) -> None:
    deadline = time.monotonic() + 20
    while True:
        services = open_services(pooled)
        try:
            [finding] = connection_pool(services)
            break
        except OperationalError:
            if time.monotonic() > deadline:
                raise
            time.sleep(0.1)
        finally:
            services.database.close()
    assert finding.verdict == verdict, finding
    assert ("pool_mode = session" in finding.advice) == (verdict == "failed")


@on_postgres
def test_postgresql_itself_keeps_sessions(settings: Settings) -> None:
    services = open_services(settings)
    [finding] = connection_pool(services)
    services.database.close()
    assert finding.verdict == "ok"
