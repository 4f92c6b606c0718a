"""A mistyped setting ends in one line that says what was expected; no password is shown."""

import pytest

from server.settings import Settings
from tests.helpers.databases import run_server_command

WRONG = [
    ("postgre://me:hunter2@host/palpebra", "begins with 'postgre:'"),
    ("postgresql+asyncpg://me:hunter2@host/palpebra", "begins with 'postgresql+asyncpg:'"),
    ("mysql://me:hunter2@host/palpebra", "begins with 'mysql:'"),
    ("postgresql://me:hunter2@host:54x2/palpebra", "cannot be read"),
    ("palpebra.sqlite hunter2", "cannot be read"),
    ("postgresql://me:hunter2@host", "without a name"),
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
def test_a_mistyped_number_is_told_in_one_line(settings: Settings, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PALPEBRA_SESSION_HOURS", "twelve")
    called = run_server_command(settings, "study", "list")
    assert called.returncode == 2
    assert called.stderr.startswith("error: PALPEBRA_SESSION_HOURS: ")
    assert "'twelve'" in called.stderr
    assert called.stderr.count("\n") == 1
