"""`make run` takes its studies into a database that has none, whatever lies with the clips already."""

import os
from pathlib import Path

import pytest

from experiments.load import locate
from server.cli_common import migrated_services
from server.core.values import now
from server.studies import repository
from server.studies.creation import create_study, planned_experiment
from tools import first_run


@pytest.fixture
def added(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> list[str]:
    """The studies that `make run` adds, with clips of the three in the data folder, stamped and current."""
    monkeypatch.delenv("DATABASE_URL", raising=False)
    # Restored afterwards: `main` sets them.
    monkeypatch.setenv("PALPEBRA_DATA_FOLDER", str(tmp_path))
    monkeypatch.setenv("PALPEBRA_PUBLIC_URL", "http://localhost:8000")
    monkeypatch.setenv("PALPEBRA_LOG_FORMAT", "text")
    monkeypatch.setattr(first_run, "DATA", tmp_path)
    for folder in (*first_run.STUDIES, "strips"):
        (tmp_path / "stimuli" / folder).mkdir(parents=True)
        (tmp_path / "stimuli" / folder / ".first_run").write_text(first_run.sources())
    added: list[str] = []

    def call(*command: str) -> None:
        with migrated_services() as services, services.database.write() as session:
            if command[:3] == ("server", "study", "add"):
                name = command[3]
                added.append(f"{name} --open" if "--open" in command else name)
                declared = planned_experiment(locate(name).read_text(encoding="utf-8"), locate(name).name)
                if repository.study_called(session, name) is None:
                    create_study(session, name, declared, None)

    monkeypatch.setattr(first_run, "call", call)
    monkeypatch.setattr(first_run, "build_docs_meanwhile", lambda: None)  # it takes half a minute
    monkeypatch.setattr(os, "execv", lambda *_: None)
    return added


def test_clips_without_a_database_become_studies_once(added: list[str], tmp_path: Path) -> None:
    first_run.main()
    assert added == [f"{study} --open" for study in first_run.STUDIES]
    first_run.main()
    assert len(added) == len(first_run.STUDIES)
    (tmp_path / "palpebra.sqlite").unlink()
    first_run.main()
    assert added == 2 * [f"{study} --open" for study in first_run.STUDIES]


def test_the_wait_is_announced_with_what_is_built(
    added: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    first_run.main()
    said = capsys.readouterr().out
    assert "[clips] to build: exp3, exp1, exp2. The first time takes a few minutes. The links are" in said
    assert "[clips] exp1 (2 of 3): rendering what is missing" in said
    first_run.main()
    assert "[clips]" not in capsys.readouterr().out


def test_what_was_archived_deleted_or_closed_stays_so_when_the_program_is_newer(
    added: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    first_run.main()
    added.clear()
    with migrated_services() as services, services.database.write() as session:
        archived, deleted = (repository.study_called(session, name) for name in ("exp2", "exp3"))
        assert archived is not None
        archived.archived_at = now()
        session.delete(deleted)
    monkeypatch.setattr(first_run, "sources", lambda: "newer")
    first_run.main()
    assert added == ["exp1"]
