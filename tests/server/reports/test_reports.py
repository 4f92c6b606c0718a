import re
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from server.context import Services
from server.exports import reports
from server.exports.schemas import NewReport
from server.models import StudyRun
from tests.helpers.admins import Admin
from tests.helpers.studies import Participant, StudyInDatabase


def finished(admin: Admin) -> Any:
    for _ in range(1200):  # on a busy machine a process with all its imports takes its time
        [report] = admin.get("/studies/short/reports").json()
        if report["status"] in ("done", "failed"):
            return report
        time.sleep(0.25)
    raise AssertionError("the report was not finished in five minutes")


def test_a_report_is_built_by_a_process_of_its_own(
    experimenter: Admin, client: TestClient, study: StudyInDatabase
) -> None:
    for number in range(4):
        person = Participant(client, study.link_token).agree()
        for trial in person.state()["trials"]:
            expected = [int(c) for c in (trial["prompt"] or "") if c.isdigit()]
            person.rate(trial, expected[0] if expected else 1 + (trial["trial_index"] * 7 + number * 3) % 7)
        person.answer_forms()
        person.request("POST", "/complete")
    body = {"origin": "participant", "sensitivity": False}
    assert experimenter.send("POST", "/studies/short/reports", body).status_code == 202
    report = finished(experimenter)
    assert report["status"] == "done", report["message"]
    page = next(name for name in report["files"] if name.endswith(".html"))
    shown = experimenter.get(f"/studies/short/reports/{report['id']}/{page}")
    assert "<html" in shown.text
    assert "sandbox" in shown.headers["content-security-policy"]
    # Verdicts and signals by the analysis; the Methods by the server, its numbers linked to their queries.
    assert "Evidence that responses are from a person" in shown.text
    assert re.search(r"tickets: Share of answers with a valid server ticket.*?<td", shown.text, re.S)
    assert 'completed visits contained <a href="#methods-' in shown.text
    for mark in re.findall(r'href="#methods-(\d+)"', shown.text):
        source = re.search(rf'<li id="methods-{mark}">(\w+): <code>([^<]+)', shown.text)
        assert source is not None
        name, query = source.groups()
        assert query.startswith("declaration: " if name.endswith("_per_block") else "SELECT count"), name


def test_a_report_on_no_data_fails_with_a_reason(experimenter: Admin, study: StudyInDatabase) -> None:
    experimenter.send("POST", "/studies/short/reports", {})
    report = finished(experimenter)
    assert report["status"] == "failed"
    assert report["message"]


def test_only_files_of_the_report_are_served(experimenter: Admin, study: StudyInDatabase) -> None:
    assert experimenter.get("/studies/short/reports/x/..%2Fsecret_key").status_code == 404


def test_answers_and_runs_of_a_report_are_of_one_moment(
    client: TestClient, participant: Participant, services: Services, study: StudyInDatabase, tmp_path: Path
) -> None:
    participant.agree().rate_all()
    written = reports.runs_csv

    def after_another_began(*of: Any) -> Iterator[bytes]:
        Participant(client, study.link_token).start()
        return written(*of)

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(reports, "runs_csv", after_another_began)
        reports._export(services.database, study.name, tmp_path / "inputs", NewReport())
    lines = (tmp_path / "inputs" / "runs.csv").read_text(encoding="utf-8").splitlines()
    assert len(lines) == 2
    with services.database.read() as session:
        assert session.query(StudyRun).count() == 2
