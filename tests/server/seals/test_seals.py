import json
import re
from concurrent.futures import ThreadPoolExecutor, wait
from pathlib import Path
from threading import Event

import pytest
from fastapi.testclient import TestClient
from typer.testing import CliRunner

from analysis.cli import app as analysis
from experiments.errors import InputError
from experiments.load import load_experiment, parse_experiment
from experiments.seal import deviations, read_seal
from server.accounts.identity import OPERATOR
from server.context import Services
from server.core.errors import Conflict
from server.exports.seals import page, seal_of, seal_plan
from server.studies.lookup import find_study
from tests.analysis.ratings_file import rows_of, simulate, write_export
from tests.helpers.admins import Admin
from tests.helpers.studies import SHORT, Participant, StudyInDatabase, add_study

POWER = {"effects": {"speed": 0.91}}


def test_a_plan_is_sealed_once_before_the_first_participant(
    services: Services, study: StudyInDatabase, client: TestClient
) -> None:
    with services.database.write() as session:
        sealed = seal_plan(session, find_study(session, "short", OPERATOR, "view"), None, POWER)
    assert sealed.power == POWER
    assert sealed.experiment == study.experiment
    with services.database.write() as session:
        assert seal_of(session, find_study(session, "short", OPERATOR, "view")) == sealed
        with pytest.raises(Conflict, match="A seal cannot be replaced"):
            seal_plan(session, find_study(session, "short", OPERATOR, "view"), None, None)


def test_after_the_first_participant_nothing_is_sealed(services: Services, participant: Participant) -> None:
    participant.agree()
    with services.database.write() as session, pytest.raises(Conflict, match="1 participant already started"):
        seal_plan(session, find_study(session, "short", OPERATOR, "view"), None, None)


def test_a_later_study_of_the_same_name_is_not_sealed_by_the_deleted_one(
    services: Services, experimenter: Admin, tmp_path: Path
) -> None:
    add_study(services, tmp_path / "clips", status="draft")
    with services.database.write() as session:
        seal_plan(session, find_study(session, "short", OPERATOR, "view"), None, None)
    assert experimenter.send("DELETE", "/studies/short").status_code == 204
    add_study(services, tmp_path / "again")
    with services.database.write() as session:
        assert seal_of(session, find_study(session, "short", OPERATOR, "view")) is None
        later = seal_plan(session, find_study(session, "short", OPERATOR, "view"), None, POWER)
        assert seal_of(session, find_study(session, "short", OPERATOR, "view")) == later


def test_a_plan_is_sealed_once_though_two_seal_it_together(
    services: Services, study: StudyInDatabase
) -> None:
    """The second waits for the first to be stored, and is refused then."""
    sealed, go_on = Event(), Event()

    def first() -> None:
        with services.database.write() as session:
            seal_plan(session, find_study(session, study.name, OPERATOR, "view"), None, POWER)
            session.flush()
            sealed.set()
            go_on.wait(30)

    def second() -> None:
        with services.database.write() as session:
            seal_plan(session, find_study(session, study.name, OPERATOR, "view"), None, None)

    with ThreadPoolExecutor(2) as pool:
        one = pool.submit(first)
        assert sealed.wait(30)
        other = pool.submit(second)
        waited = wait([other], timeout=0.5).not_done
        go_on.set()
        one.result(30)
        with pytest.raises(Conflict, match="A seal cannot be replaced"):
            other.result(30)
    assert waited


def test_what_differs_from_the_plan_is_named(services: Services, tmp_path: Path) -> None:
    add_study(services, tmp_path / "clips")
    with services.database.write() as session:
        sealed = seal_plan(session, find_study(session, "short", OPERATOR, "view"), None, None)
    later = SHORT.replace('rule = "attention_checks_failed"', 'rule = "incomplete"').replace(
        'consent = "Do you agree?"', 'consent = "Do you still agree?"'
    )
    found = deviations(sealed, parse_experiment(later), participants=20)
    assert len(found) == 1
    assert "exclusions" in found[0]
    assert deviations(sealed, parse_experiment(SHORT), 20) == []
    assert deviations(sealed, parse_experiment(SHORT), 12) == [
        "20 participants were planned, 12 are analyzed"
    ]
    shown = page(sealed)
    assert sealed.sha256 in shown
    assert "attention_checks_failed" in shown
    assert "<script" not in shown


@pytest.fixture
def sealed_exp3(services: Services, tmp_path: Path) -> Path:
    add_study(services, tmp_path / "clips", load_text("exp3"))
    with services.database.write() as session:
        sealed = seal_plan(session, find_study(session, "exp3", OPERATOR, "view"), None, None)
    (tmp_path / "seal.json").write_text(sealed.text(), encoding="utf-8")
    return tmp_path / "seal.json"


def load_text(name: str) -> str:
    from experiments.load import locate

    return locate(name).read_text(encoding="utf-8")


def test_a_report_lists_each_deviation_from_the_seal(sealed_exp3: Path, tmp_path: Path) -> None:
    experiment = load_experiment("exp3")
    table = write_export(tmp_path / "r.csv", experiment, rows_of(experiment, simulate(experiment, 8)))
    arguments = ["run", "exp3", "--csv", str(table), "--seal", str(sealed_exp3), "--no-sensitivity"]
    result = CliRunner().invoke(analysis, [*arguments, "--out", str(tmp_path / "out")])
    assert result.exit_code == 0, result.output
    report = (tmp_path / "out" / "report.md").read_text(encoding="utf-8")
    assert "Deviation from the plan sealed" in report
    assert f"{experiment.participants} participants were planned, 8 are analyzed" in report


def test_a_broken_seal_is_refused(sealed_exp3: Path) -> None:
    text = sealed_exp3.read_text(encoding="utf-8")
    sealed_exp3.write_text(re.sub('"version": [0-9]+', '"version": 77', text, count=1), encoding="utf-8")
    with pytest.raises(InputError, match=r"seal.json: the seal is broken"):
        read_seal(sealed_exp3)
    sealed_exp3.write_text(json.dumps({"study": "x"}))
    with pytest.raises(InputError, match="expected a sealed plan"):
        read_seal(sealed_exp3)
