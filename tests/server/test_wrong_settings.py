"""A mistyped setting ends in one line that says what was expected; no password is shown."""

from pathlib import Path

import pytest

from server.core.settings import Settings
from tests.helpers.databases import run_server_command

WRONG = [
    ("postgre://me:hunter2@host/palpebra", "begins with 'postgre:'"),
    ("postgresql+asyncpg://me:hunter2@host/palpebra", "begins with 'postgresql+asyncpg:'"),
    ("mysql://me:hunter2@host/palpebra", "begins with 'mysql:'"),
    ("postgresql://me:hunter2@host:54x2/palpebra", "got an invalid URL"),
    ("palpebra.sqlite hunter2", "got an invalid URL"),
    ("postgresql://me:hunter2@host", "without a database name"),
]


@pytest.mark.parametrize(("url", "said"), WRONG, ids=[url.split("hunter2")[0] for url, _ in WRONG])
@pytest.mark.parametrize(
    "command", [["database", "upgrade"], ["doctor"], ["run", "--port", "58231"]], ids=" ".join
)
@pytest.mark.parametrize("database_url", ["sqlite"], indirect=True)
def test_a_mistyped_address_of_the_database_is_told_in_one_line(
    settings: Settings, url: str, said: str, command: list[str]
) -> None:
    called = run_server_command(settings.model_copy(update={"database_url": url}), *command)
    assert called.returncode == 2
    assert said in called.stderr
    assert called.stderr.count("\n") == 1
    assert "hunter2" not in called.stderr + called.stdout


@pytest.mark.parametrize("database_url", ["sqlite"], indirect=True)
def test_a_mistyped_number_is_reported_in_one_line(
    settings: Settings, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PALPEBRA_SESSION_HOURS", "twelve")
    called = run_server_command(settings, "study", "list")
    assert called.returncode == 2
    assert called.stderr.startswith("error: PALPEBRA_SESSION_HOURS: ")
    assert "'twelve'" in called.stderr
    assert called.stderr.count("\n") == 1


@pytest.mark.parametrize("empty_database_url", ["sqlite"], indirect=True)
@pytest.mark.parametrize("key", ["x", "k" * 31])
def test_a_new_database_that_others_reach_takes_no_key_that_can_be_guessed(
    tmp_path: Path, empty_database_url: str, key: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An old one goes on with its own, or nobody could sign in by a second factor any more."""
    settings = Settings(data_folder=tmp_path / "data", database_url=empty_database_url, secret_key=key)
    monkeypatch.setenv("PALPEBRA_PUBLIC_URL", "https://study.example.org")
    refused = run_server_command(settings, "database", "upgrade")
    assert refused.returncode == 2
    assert refused.stderr.startswith("error: PALPEBRA_SECRET_KEY: expected at least 32 random characters")
    assert refused.stderr.count("\n") == 1
    longer = settings.model_copy(update={"secret_key": "k" * 32})
    assert run_server_command(longer, "database", "upgrade").returncode == 0
    # As if it had been made by a release that took such keys.
    assert run_server_command(settings, "study", "list").returncode == 0
    told = run_server_command(settings, "doctor").stdout
    assert "server database rewrap OLD_KEY_FILE" in " ".join(told.split())


@pytest.mark.parametrize("empty_database_url", ["sqlite"], indirect=True)
@pytest.mark.parametrize("url", ["http://localhost:8000", "http://127.0.0.1:8000", "http://[::1]:8000"])
def test_a_server_of_this_machine_alone_starts_with_any_key_and_the_doctor_warns(
    tmp_path: Path, empty_database_url: str, url: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    settings = Settings(data_folder=tmp_path / "data", database_url=empty_database_url, secret_key="k")
    monkeypatch.setenv("PALPEBRA_PUBLIC_URL", url)
    assert run_server_command(settings, "database", "upgrade").returncode == 0
    assert "at least 32 random characters" in " ".join(run_server_command(settings, "doctor").stdout.split())
