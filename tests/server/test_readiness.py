"""/readyz distinguishes a full disk, a locked database and one that may not be written to."""

import os
import shutil
import sqlite3
import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest
from fastapi.testclient import TestClient

from server import web
from server.app import create_app
from server.core.db import Database
from server.core.migrate import upgrade
from server.core.settings import Settings


def told(client: TestClient) -> str:
    answer = client.get("/readyz")
    assert answer.status_code == 503, answer.text
    return str(answer.json()["error"]["message"])


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A file system of 24 MB."""
    mount = shutil.which("mount")
    if mount is None or sys.platform == "win32" or os.geteuid() != 0:
        pytest.skip("only root may mount a small disk")
    folder = tmp_path / "disk"
    folder.mkdir()
    command = [mount, "-t", "tmpfs", "-o", "size=24m", "tmpfs", str(folder)]
    if subprocess.run(command, capture_output=True, check=False).returncode:
        pytest.skip("this machine lets nobody mount a file system")
    yield folder
    subprocess.run(["umount", "-l", str(folder)], check=True)


def test_a_disk_that_fills_is_told_before_a_rating_fails(small_disk: Path) -> None:
    settings = Settings(data_folder=small_disk, secret_key="k", free_megabytes_min=4)
    database = Database(settings.resolved_database_url)
    upgrade(database)
    with TestClient(create_app(settings)) as client:
        assert client.get("/readyz").status_code == 200
        with (small_disk / "other").open("wb") as other:
            while shutil.disk_usage(small_disk).free > 1_000_000:
                other.write(bytes(500_000))
                other.flush()
        assert "disk of the data folder is full" in told(client)
        (small_disk / "other").unlink()
        assert client.get("/readyz").status_code == 200
    database.close()


def test_the_limit_is_a_setting(settings: Settings) -> None:
    with TestClient(create_app(settings.model_copy(update={"free_megabytes_min": 1e12}))) as client:
        assert "Free disk space" in told(client)
        assert_told_to_monitors(client, {"/healthz": 200, "/readyz": 503})


def test_monitors_that_ask_by_head_get_the_same(client: TestClient) -> None:
    assert_told_to_monitors(client, {"/healthz": 200, "/readyz": 200})


def assert_told_to_monitors(client: TestClient, statuses: dict[str, int]) -> None:
    assert {path: client.head(path).status_code for path in statuses} == statuses


@pytest.mark.parametrize("database_url", ["sqlite"], indirect=True)
def test_a_locked_database_is_distinguished(
    client: TestClient, settings: Settings, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(web, "LOCKED_AFTER_S", 0.2)
    path = settings.database_url.removeprefix("sqlite:///")
    with closing(sqlite3.connect(path, isolation_level=None)) as other:
        other.execute("BEGIN IMMEDIATE")
        assert "kept the database locked" in told(client)
    assert client.get("/readyz").status_code == 200
