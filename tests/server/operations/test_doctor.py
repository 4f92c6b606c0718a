import json
import subprocess
from collections.abc import Sequence
from dataclasses import replace
from datetime import datetime, timedelta
from pathlib import Path

import pytest
from fastapi.testclient import TestClient
from uvicorn.middleware.proxy_headers import ProxyHeadersMiddleware

from server.app import create_app
from server.context import Services, open_services
from server.core.settings import Settings
from server.core.storage import close_to_others
from server.core.values import now
from server.models import AuditEntry
from server.operations.doctor import CHECKS, Finding, examine, ledger
from server.privacy.ledger import erasures_in_ledger, ledger_path, note_erased
from tests.helpers.databases import run_server_command
from tests.helpers.ports import free_port
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
    assert found["clips"].state == "8, all present"
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
        assert found["clips"].state == "1 of 8 missing or incomplete"
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
        # As words, lines fit a page; paths stay whole, however long they are.
        shown = run_server_command(settings, "doctor").stdout
        assert [line for line in shown.splitlines() if len(line) > 100 and " " in line.strip("> ")] == []
        for item in json.loads(done.stdout):
            assert f"{item['subject']}: {item['state']}" in " ".join(shown.split())
            assert item["advice"] in " ".join(shown.split())


def test_a_folder_without_studies_is_one_line_and_stays_as_it_is(tmp_path: Path) -> None:
    done = run_server_command(Settings(data_folder=tmp_path, database_url=""), "doctor")
    assert done.returncode == 2, done.stderr
    assert f"there is no database at {tmp_path}/palpebra.sqlite" in " ".join(done.stderr.split())
    assert list(tmp_path.iterdir()) == []


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


def test_a_ledger_left_in_the_data_folder_is_reported_until_it_was_moved(
    services: Services, settings: Settings, tmp_path: Path
) -> None:
    note_erased(settings, ["run-a", "run-b"])
    assert by_subject(services)["ledger of erasures"].verdict == "ok"
    shared = settings.model_copy(update={"shared_folder": tmp_path / "it's shared"})
    note_erased(shared, ["run-c"])
    with ledger_path(shared).open("a", encoding="utf-8") as torn:
        torn.write('{"run": "run-')
    sharing = open_services(shared)
    found = by_subject(sharing)["ledger of erasures"]
    assert (found.verdict, found.state[:2]) == ("failed", "2 "), found
    subprocess.run(["sh", "-c", found.advice.partition("run: ")[2]], check=True)
    assert ledger_path(shared).stat().st_mode & 0o777 == 0o600
    found = by_subject(sharing)["ledger of erasures"]
    sharing.database.close()
    assert (found.verdict, set(erasures_in_ledger(shared))) == ("ok", {"run-a", "run-b", "run-c"}), found


def test_the_advised_command_makes_a_ledger_that_only_the_server_reads(
    services: Services, settings: Settings, tmp_path: Path
) -> None:
    note_erased(settings, ["run-a"])
    shared = settings.model_copy(update={"shared_folder": tmp_path / "it's shared"})
    ledger_path(shared).parent.mkdir()
    [finding] = ledger(replace(services, settings=shared))
    subprocess.run(["sh", "-c", finding.advice.partition("run: ")[2]], check=True)
    assert ledger_path(shared).stat().st_mode & 0o777 == 0o600
    assert erasures_in_ledger(shared) == ["run-a"]


class TestProxies:
    """A proxy that FORWARDED_ALLOW_IPS does not name makes sign-in limits count everybody as one."""

    @pytest.mark.parametrize("header", ["X-Forwarded-For", "Forwarded"])
    def test_an_unnamed_proxy_is_reported_with_what_to_set(self, services: Services, header: str) -> None:
        request_through(services, ("10.0.0.7", 41_000), {header: "198.51.100.4"})
        found = by_subject(services)["proxy"]
        assert found.verdict == "warning"
        assert "FORWARDED_ALLOW_IPS=10.0.0.7" in found.advice

    @pytest.mark.parametrize(
        ("peer", "named", "headers"),
        [
            (("10.0.0.7", 41_000), ["10.0.0.7"], {"X-Forwarded-For": "198.51.100.4"}),
            (("10.0.0.7", 41_000), ["10.0.0.7"], {"X-Forwarded-For": "192.168.1.4"}),
            (("10.0.0.7", 41_000), [], {}),
            (("8.8.8.8", 41_000), [], {"X-Forwarded-For": "10.0.0.7"}),
        ],
        ids=["named", "named, of a person within", "no proxy", "a stranger's header"],
    )
    def test_nothing_else_is(
        self, services: Services, peer: tuple[str, int], named: list[str], headers: dict[str, str]
    ) -> None:
        request_through(services, peer, headers, named)
        assert by_subject(services)["proxy"].verdict == "ok"

    def test_one_that_was_set_right_is_reported_for_a_day(self, services: Services) -> None:
        request_through(services, ("10.0.0.7", 41_000), {"X-Forwarded-For": "198.51.100.4"})
        path = services.settings.data_folder / "unnamed-proxy.json"
        seen = json.loads(path.read_text())
        seen["seen_at"] = (datetime.fromisoformat(seen["seen_at"]) - timedelta(days=1)).isoformat()
        path.write_text(json.dumps(seen))
        assert by_subject(services)["proxy"].verdict == "ok"

    def test_a_note_that_cannot_be_kept_hinders_no_request(self, services: Services) -> None:
        (services.settings.data_folder / "unnamed-proxy.json").mkdir(parents=True)
        request_through(services, ("10.0.0.7", 41_000), {"X-Forwarded-For": "198.51.100.4"})
        assert by_subject(services)["proxy"].verdict == "ok"

    def test_whatever_many_requests_say_one_small_file_is_kept(self, services: Services) -> None:
        for number in range(5):
            request_through(services, ("10.0.0.7", 41_000), {"X-Forwarded-For": f"198.51.100.{number}" * 50})
        assert (services.settings.data_folder / "unnamed-proxy.json").stat().st_size < 200


def request_through(
    services: Services, peer: tuple[str, int], headers: dict[str, str], named: Sequence[str] = ()
) -> None:
    """A request of the machine `peer`, as uvicorn hands it on where the proxies `named` are believed."""
    services.settings.data_folder.mkdir(exist_ok=True)
    app = ProxyHeadersMiddleware(create_app(services.settings), list(named))
    assert TestClient(app, client=peer).get("/healthz", headers=headers).status_code == 200


def test_clock_behind_the_database_stops_the_start(services: Services, study: StudyInDatabase) -> None:
    with services.database.write() as session:
        session.add(AuditEntry(actor="clock", action="test", at=now() + timedelta(days=2)))
    found = by_subject(services)["clock"]
    assert found.verdict == "failed"
    assert "but the newest entry of the database is from" in found.state
    done = run_server_command(services.settings, "run", "--port", str(free_port()))
    assert done.returncode == 2
    assert done.stderr.startswith("error: the clock of this machine shows ")
    assert done.stderr.endswith("set the clock (if that entry is wrong: PALPEBRA_IGNORE_CLOCK=true)\n")
