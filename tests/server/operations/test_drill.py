"""A backup is brought back before it is needed: what is whole passes, what is not is named."""

import asyncio
import fcntl
import io
import os
import subprocess
import sys
import tarfile
import time
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from fastapi.testclient import TestClient
from sqlalchemy.exc import OperationalError

from server.context import Services
from server.core.settings import Settings
from server.operations import drill as drill_module
from server.operations.backup import back_up
from server.operations.backup_stores import backup_store
from server.operations.doctor import backups
from server.operations.drill import DrillUnderWayError, drill, drill_when_due, is_due, sweep
from server.operations.metrics import exposition
from server.operations.watched_backups import DrillResult, last_drill, newest_backup
from tests.helpers.databases import run_server_command
from tests.helpers.studies import Participant
from tests.helpers.waiting import run_in_own_loop, until

DAY = timedelta(days=1)
NOW = datetime(2026, 3, 1, 12, tzinfo=UTC)


@pytest.fixture
def watched(services: Services, participant: Participant, tmp_path: Path) -> Settings:
    """Settings that know a folder with one backup of a study somebody has rated."""
    participant.agree()
    participant.rate_all()
    folder = tmp_path / "backups"
    folder.mkdir()
    back_up(services.database, services.settings, services.clips, folder / "palpebra-2026-03-01.tar")
    return services.settings.model_copy(update={"backup_folder": str(folder)})


def backup_of(settings: Settings) -> Path:
    backup = newest_backup(backup_store(settings.backup_folder, settings))
    assert backup is not None
    return Path(settings.backup_folder) / backup.name


def with_another_byte(backup: Path, member: str) -> None:
    """Change one byte in the middle of a member, as a bad disk would."""
    with tarfile.open(backup) as tar:
        entries = [(entry, tar.extractfile(entry).read()) for entry in tar]  # type: ignore[union-attr]
    assert member in [entry.name for entry, _ in entries]
    with tarfile.open(backup, "w") as tar:
        for entry, content in entries:
            middle = len(content) // 2 if entry.name == member else len(content)
            broken = content[:middle] + bytes([b ^ 1 for b in content[middle : middle + 1]])
            tar.addfile(entry, io.BytesIO(broken + content[middle + 1 :]))


def test_a_whole_backup_passes_and_nothing_is_left_behind(watched: Settings) -> None:
    before = sorted(path.name for path in watched.data_folder.iterdir())
    result = drill(watched, backup_of(watched))
    assert (result.passed, result.said) == (True, "")
    assert result.rows > 10
    assert result.clips > 0
    after = sorted(path.name for path in watched.data_folder.iterdir())
    assert sorted({*before, "restore-drill.json", "restore-drill.lock"}) == after
    assert last_drill(watched) == result


@pytest.mark.parametrize(
    ("member", "said"),
    [("tables/trial_ratings.ndjson.gz", "damaged"), ("backup.json", "backup"), ("clips", "was changed")],
)
def test_a_damaged_backup_fails_with_its_reason_and_the_data_stay(
    watched: Settings, member: str, said: str
) -> None:
    if member == "clips":
        with tarfile.open(backup_of(watched)) as tar:
            member = next(name for name in tar.getnames() if name.startswith("clips/"))
    with_another_byte(backup_of(watched), member)
    result = drill(watched, backup_of(watched))
    assert not result.passed
    assert said in result.said
    assert watched.data_folder.joinpath("restore-drill.json").is_file()
    assert not list(watched.data_folder.glob(".drill-*"))


@pytest.mark.parametrize(
    ("last", "due"),
    [
        (None, True),
        (DrillResult(at=NOW - 6 * DAY, backup="a", passed=True), False),
        (DrillResult(at=NOW - 7 * DAY, backup="a", passed=True), True),
        (DrillResult(at=NOW - DAY / 2, backup="a", passed=False), False),
        (DrillResult(at=NOW - DAY, backup="a", passed=False), True),
    ],
)
def test_a_week_after_one_that_passed_a_day_after_one_that_did_not(
    last: DrillResult | None, due: bool
) -> None:
    assert is_due(last, NOW) is due


def test_only_one_at_a_time(watched: Settings) -> None:
    lock = watched.data_folder / "restore-drill.lock"
    with lock.open("a") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        assert drill_when_due(watched) is None
        with pytest.raises(DrillUnderWayError, match="is running"):
            drill(watched, backup_of(watched))
    result = drill_when_due(watched)
    assert result is not None
    assert result.passed
    assert drill_when_due(watched) is None  # not due again


def test_the_copy_of_a_killed_drill_is_swept(watched: Settings) -> None:
    left = watched.data_folder / ".drill-killed"
    left.mkdir()
    (left / "palpebra.sqlite").write_text("everybody's answers")
    sweep(watched)
    assert not left.exists()


def test_whatever_goes_wrong_is_a_result(watched: Settings, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object, **_named: object) -> None:
        raise OperationalError("INSERT", {}, Exception("disk I/O error"))

    monkeypatch.setattr("server.operations.drill.restore", broken)
    result = drill(watched, backup_of(watched))
    assert not result.passed
    assert "disk I/O error" in result.said
    assert last_drill(watched) == result


def test_without_room_nothing_is_brought_back(watched: Settings) -> None:
    crowded = watched.model_copy(update={"free_megabytes_min": 1e9})
    result = drill(crowded, backup_of(watched))
    assert not result.passed
    assert "free disk space" in result.said


def test_a_full_disk_is_not_called_damage(watched: Settings, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OperationalError("INSERT", {}, Exception("database or disk is full"))

    monkeypatch.setattr("server.operations.restore.write_rows", full)
    result = drill(watched, backup_of(watched))
    assert result.said == "the database cannot take the backup: database or disk is full"


def test_a_result_that_cannot_be_read_is_none(watched: Settings, services: Services) -> None:
    (watched.data_folder / "restore-drill.json").write_text(
        '{"at": "2026-03-01T12:00:00", "backup": "a", "passed": true}'
    )
    assert last_drill(watched) is None
    assert "palpebra_backups 1.0" in exposition(services.database, watched).decode()


@pytest.mark.parametrize("database_url", ["sqlite"], indirect=True)
def test_a_stop_in_mid_drill_leaves_no_copy(watched: Settings) -> None:
    environment = os.environ | {
        "PALPEBRA_DATA_FOLDER": str(watched.data_folder),
        "PALPEBRA_BACKUP_FOLDER": str(watched.backup_folder),
        "DATABASE_URL": watched.database_url,
    }
    slow = "import time, server.operations.drill as d\nd.restore = lambda *_, **_named: time.sleep(600)\n"
    command = (
        f"{slow}import sys\nsys.argv = ['server', 'drill', '--when-due']\nfrom server.cli import main\nmain()"
    )
    with subprocess.Popen([sys.executable, "-c", command], env=environment) as process:
        try:
            until(lambda: process.poll() is not None or list(watched.data_folder.glob(".drill-*")))
            assert process.poll() is None
            process.terminate()
            process.wait(60)
        finally:
            process.kill()
    assert not list(watched.data_folder.glob(".drill-*"))


def test_doctor_and_metrics_show_age_and_outcome(watched: Settings, services: Services) -> None:
    told = Services(**{**vars(services), "settings": watched})
    os.utime(backup_of(watched), (time.time() - 3 * 86400,) * 2)
    old, none = list(backups(told))
    assert (old.verdict, none.verdict, none.state) == ("warning", "warning", "none was made")
    with_another_byte(backup_of(watched), "tables/trial_ratings.ndjson.gz")
    drill(watched, backup_of(watched))
    _, failed = list(backups(told))
    assert failed.verdict == "failed"
    said = exposition(services.database, watched).decode()
    assert "palpebra_restore_drill_passed 0.0" in said
    assert "palpebra_backup_age_seconds " in said
    assert "palpebra_backup" not in exposition(services.database, services.settings).decode()


@pytest.mark.parametrize("database_url", ["sqlite"], indirect=True)
def test_the_command_names_the_newest_and_refuses_an_empty_folder(watched: Settings, tmp_path: Path) -> None:
    called = run_server_command(watched, "drill", str(watched.backup_folder))
    assert called.returncode == 0
    assert "palpebra-2026-03-01.tar was restored completely" in called.stdout
    (tmp_path / "none").mkdir()
    called = run_server_command(watched, "drill", str(tmp_path / "none"))
    assert called.returncode == 2
    assert "expected a backup, or a folder with palpebra-*.tar" in called.stderr


@pytest.mark.parametrize("database_url", ["sqlite"], indirect=True)
def test_the_server_makes_the_drill_by_itself(
    watched: Settings, client: TestClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PALPEBRA_DATA_FOLDER", str(watched.data_folder))
    monkeypatch.setenv("PALPEBRA_BACKUP_FOLDER", str(watched.backup_folder))
    monkeypatch.setenv("DATABASE_URL", watched.database_url)

    async def serve_until_drilled() -> None:
        async with drill_module.weekly_drill(watched, first_look_s=0):
            for _ in range(1800):
                if last_drill(watched):
                    return
                await asyncio.sleep(0.1)

    run_in_own_loop(serve_until_drilled())
    result = last_drill(watched)
    assert result is not None
    assert result.passed
    assert client.get("/healthz").status_code == 200


def test_a_missing_file_is_reported(watched: Settings, tmp_path: Path) -> None:
    result = drill(watched, tmp_path / "no.tar")
    assert not result.passed
    assert "cannot be read" in result.said


def test_a_command_without_a_folder_says_what_to_name(services: Services) -> None:
    called = run_server_command(services.settings, "drill")
    assert called.returncode == 2
    assert "PALPEBRA_BACKUP_FOLDER" in called.stderr
