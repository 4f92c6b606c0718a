import json
import subprocess
from dataclasses import replace
from pathlib import Path

from server.context import Services, open_services
from server.core.settings import Settings, close_to_others
from server.operations.doctor import CHECKS, Finding, examine, ledger
from server.privacy import erasures
from tests.helpers.databases import run_server_command
from tests.helpers.studies import StudyInDatabase


def by_subject(services: Services) -> dict[str, Finding]:
    return {finding.subject: finding for finding in examine(services)}


def test_an_installation_in_order(services: Services, study: StudyInDatabase) -> None:
    for site in ("participant", "admin"):
        page = services.settings.frontend_folder / site / "index.html"
        page.parent.mkdir(parents=True)
        page.write_text("<html>")
    close_to_others(services.settings)
    found = by_subject(services)
    assert [finding for finding in found.values() if finding.verdict == "failed"] == []
    assert found["clips"].state == "8, all there"
    assert found["studies"].state == "1"


class TestTroubles:
    def test_every_trouble_comes_with_advice(self, services: Services, study: StudyInDatabase) -> None:
        for path in services.settings.clip_folder.rglob("*.mp4"):
            path.write_bytes(b"cut")
            break
        key = services.settings.data_folder / "secret_key"
        key.write_text("k")
        key.chmod(0o644)
        changes = {"secret_key": "", "public_url": "http://lab.example"}
        wrong = open_services(services.settings.model_copy(update=changes))
        found = by_subject(wrong)
        wrong.database.close()
        assert found["clips"].state == "1 of 8 missing or cut short"
        assert found["secret key"].advice == f"run: chmod 600 {key}"
        assert "https" in found["public address"].advice
        assert found["admin page"].verdict == "failed"
        for finding in found.values():
            assert (finding.verdict == "ok") == (finding.advice == ""), finding

    def test_the_command_ends_with_1_where_something_failed(self, settings: Settings) -> None:
        done = run_server_command(settings, "doctor", "--json")
        assert done.returncode == 1, done.stderr
        verdicts = {item["subject"]: item["verdict"] for item in json.loads(done.stdout)}
        assert verdicts["database"] == "ok"
        assert verdicts["participant page"] == "failed"
        # In a file or a pipe each finding is whole on a line of its own, however long its paths.
        lines = run_server_command(settings, "doctor").stdout.splitlines()
        for item in json.loads(done.stdout):
            assert any(item["state"] in line and item["advice"] in line for line in lines), item


def test_a_database_that_cannot_be_opened_is_one_finding_each(tmp_path: Path) -> None:
    (tmp_path / "x.sqlite").write_bytes(b"no database at all, but long enough to be looked at" * 20)
    services = open_services(Settings(data_folder=tmp_path, database_url=f"sqlite:///{tmp_path}/x.sqlite"))
    found = by_subject(services)
    services.database.close()
    assert found["database"] == Finding(
        "database",
        "failed",
        "file is not a database",
        "see DATABASE_URL, then run: server database upgrade",
    )
    assert len(found) >= len(CHECKS)


def test_a_ledger_left_in_the_data_folder_is_told_until_it_was_moved(
    services: Services, settings: Settings, tmp_path: Path
) -> None:
    erasures.note(settings, ["run-a", "run-b"])
    assert by_subject(services)["ledger of erasures"].verdict == "ok"
    shared = settings.model_copy(update={"shared_folder": tmp_path / "it's shared"})
    erasures.note(shared, ["run-c"])
    with erasures.ledger(shared).open("a", encoding="utf-8") as torn:
        torn.write('{"run": "run-')
    sharing = open_services(shared)
    found = by_subject(sharing)["ledger of erasures"]
    assert (found.verdict, found.state[:2]) == ("failed", "2 "), found
    subprocess.run(["sh", "-c", found.advice.partition("run: ")[2]], check=True)
    assert erasures.ledger(shared).stat().st_mode & 0o777 == 0o600
    found = by_subject(sharing)["ledger of erasures"]
    sharing.database.close()
    assert (found.verdict, set(erasures.noted(shared))) == ("ok", {"run-a", "run-b", "run-c"}), found


def test_the_advised_command_makes_a_ledger_that_only_the_server_reads(
    services: Services, settings: Settings, tmp_path: Path
) -> None:
    erasures.note(settings, ["run-a"])
    shared = settings.model_copy(update={"shared_folder": tmp_path / "it's shared"})
    erasures.ledger(shared).parent.mkdir()
    [finding] = ledger(replace(services, settings=shared))
    subprocess.run(["sh", "-c", finding.advice.partition("run: ")[2]], check=True)
    assert erasures.ledger(shared).stat().st_mode & 0o777 == 0o600
    assert erasures.noted(shared) == ["run-a"]
