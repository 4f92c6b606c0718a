"""One person's data, whole: what access hands out is what the tables hold, without what opens a visit."""

import json
import stat
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient
from sqlalchemy import func, select

from server.context import Services
from server.models import Base, IdentityKey, StudyRun
from tests.helpers.admins import Admin
from tests.helpers.databases import run_server_command
from tests.helpers.studies import Participant, StudyInDatabase

CODE = "40177"
EXPORT = ("person", "export", "short")
on_sqlite = pytest.mark.parametrize("database_url", ["sqlite"], indirect=True)


@pytest.fixture
def link(study: StudyInDatabase) -> str:
    return study.link(recruiter={"kind": "sona"})


@pytest.fixture
def person(client: TestClient, link: str) -> Participant:
    """Somebody with a SONA code who answered everything and said something."""
    begun = Participant(client, link)
    begun.start(query={"survey_code": CODE, "note": "by e-mail"})
    begun.request("PUT", "/consent", {"agreed": True})
    begun.rate(begun.state()["trials"][0], comment="it looks at me")
    begun.answer_all()
    return begun


def rows_of(services: Services, run: str) -> dict[str, int]:
    """Table -> rows that hang on a run."""
    with services.database.read() as session:
        number = session.scalar(select(StudyRun.id).where(StudyRun.public_id == run))
        counts = {
            table.name: session.scalar(
                select(func.count()).select_from(table).where(table.c["study_run_id"] == number)
            )
            for table in Base.metadata.sorted_tables
            if "study_run_id" in table.c
        }
    return {name: count for name, count in counts.items() if count}


def test_everything_that_is_stored_is_reported(
    services: Services, owner: Admin, person: Participant, client: TestClient, link: str
) -> None:
    other = Participant(client, link)
    other.start(query={"survey_code": "40178"})
    answer = owner.get(f"/studies/short/runs/{person.run_id}/subject-access")
    assert answer.status_code == 200
    assert answer.headers["content-disposition"].endswith(f'short-{person.run_id}.json"')
    [visit] = answer.json()["visits"]
    assert visit["recruiter"] == {
        "identifier": CODE,
        "parameters": {"survey_code": CODE, "note": "by e-mail"},
    }
    told = {name: len(rows) for name, rows in visit["stored"].items()}
    expected = rows_of(services, person.run_id) | {"study_runs": 1, "links": 1}
    # These two hold nothing but the content of `recruiter`, encrypted.
    assert told == {name: count for name, count in expected.items() if name not in ENCRYPTED}
    assert told["trial_ratings"] == 12
    assert "it looks at me" in answer.text
    assert other.run_id not in answer.text


ENCRYPTED = {"recruiter_identities", "identity_keys"}


def test_what_opens_a_visit_is_not_in_it(
    services: Services, owner: Admin, person: Participant, link: str
) -> None:
    text = owner.get(f"/studies/short/runs/{person.run_id}/subject-access").text
    with services.database.read() as session:
        run = session.scalars(select(StudyRun)).one()
        wrapped = session.scalar(select(IdentityKey.wrapped_key))
    secrets = (person.token, link, run.token_hash, run.client_id, wrapped)
    for secret in secrets:
        assert str(secret) not in text


@on_sqlite
def test_it_is_for_owners_and_written_down(owner: Admin, experimenter: Admin, person: Participant) -> None:
    path = f"/studies/short/runs/{person.run_id}/subject-access"
    assert experimenter.get(path).status_code == 403
    assert owner.get(path).status_code == 200
    entries = [entry for entry in owner.get("/audit").json() if entry["action"] == "subject access"]
    assert [entry["target"] for entry in entries] == [person.run_id]
    assert owner.get("/studies/short/runs/0000/subject-access").status_code == 404


@on_sqlite
def test_the_command_knows_a_person_by_the_recruiters_id_in_every_visit(
    services: Services, client: TestClient, link: str, person: Participant, tmp_path: Path
) -> None:
    with services.database.write() as session:
        session.query(StudyRun).update({"status": "withdrawn"})
    second = Participant(client, link)
    with services.database.write() as session:
        session.query(StudyRun).update({"status": "active"})
    assert second.start(query={"survey_code": CODE}, anew=True).status_code == 201
    file = tmp_path / "person.json"
    done = run_server_command(
        services.settings, "person", "export", "short", "--id", CODE, "--out", str(file)
    )
    assert done.stdout == f"{file}: 2 visits\n", done.stderr
    assert stat.S_IMODE(file.stat().st_mode) == 0o600
    told: dict[str, Any] = json.loads(file.read_text())
    assert {visit["run"] for visit in told["visits"]} == {person.run_id, second.run_id}


@on_sqlite
def test_the_command_erases_by_the_recruiters_id(services: Services, person: Participant) -> None:
    done = run_server_command(services.settings, "person", "erase", "short", "--id", CODE, "--yes")
    assert done.stdout.startswith(f"erased: {person.run_id}; keep the ledger"), done.stderr
    with services.database.read() as session:
        assert session.query(StudyRun).one().erased_at is not None
    again = run_server_command(services.settings, "person", "erase", "short", "--run", person.run_id, "--yes")
    assert "were erased" in again.stderr
    assert again.returncode != 0


@on_sqlite
@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ((), "expected either --run"),
        (("--run", "a", "--id", "b"), "expected either --run"),
        (("--id", "4"), "no visit with this recruiter's ID"),
        (("--run", "4"), "There is no run '4'"),
    ],
)
def test_who_is_not_known_is_reported_in_a_line(
    services: Services, person: Participant, arguments: tuple[str, ...], said: str, tmp_path: Path
) -> None:
    file = tmp_path / "x.json"
    done = run_server_command(services.settings, "person", "export", "short", *arguments, "--out", str(file))
    assert done.returncode != 0
    assert said in done.stderr
    assert "Traceback" not in done.stderr
    assert not file.exists()
