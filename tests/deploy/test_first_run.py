"""`make run` takes its studies into a database that has none, whatever lies with the clips already."""

import os
from pathlib import Path

import pytest

from server.accounts.audit import record
from server.cli_common import migrated_services
from tools import first_run


@pytest.fixture
def added(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> list[str]:
    """The studies that `make run` adds, with clips of the three in the data folder, stamped and current."""
    monkeypatch.delenv("DATABASE_URL", raising=False)
    for name in ("PALPEBRA_DATA_FOLDER", "PALPEBRA_PUBLIC_URL"):  # restored afterwards: `main` sets them
        monkeypatch.setenv(name, str(tmp_path) if "DATA" in name else "http://localhost:8000")
    monkeypatch.setattr(first_run, "DATA", tmp_path)
    for folder in (*first_run.STUDIES, "strips"):
        (tmp_path / "stimuli" / folder).mkdir(parents=True)
        (tmp_path / "stimuli" / folder / ".first_run").write_text(first_run.sources())
    added: list[str] = []

    def call(*command: str) -> None:
        if command[:3] == ("server", "study", "add"):
            added.append(command[3])
        with migrated_services() as services, services.database.write() as session:
            if command[:3] == ("server", "study", "add"):
                record(session, None, "study created", "study", command[3])

    monkeypatch.setattr(first_run, "call", call)
    monkeypatch.setattr(os, "execv", lambda *_: None)
    return added


def test_clips_without_a_database_become_studies_once(added: list[str], tmp_path: Path) -> None:
    first_run.main()
    assert added == list(first_run.STUDIES)
    first_run.main()
    assert added == list(first_run.STUDIES)
    (tmp_path / "palpebra.sqlite").unlink()
    first_run.main()
    assert added == 2 * list(first_run.STUDIES)
