"""Who sees persons, what is written down of it, and what is left after an erasure."""

import json

from fastapi.testclient import TestClient
from sqlalchemy import text

from server.context import Services
from server.core.settings import Settings
from tests.helpers.admins import Admin, fresh_browser
from tests.helpers.studies import Participant, StudyInDatabase


def test_a_read_token_sees_no_person(
    client: TestClient, settings: Settings, owner: Admin, study: StudyInDatabase
) -> None:
    person = Participant(client, study.link("personal", label="Erika Mustermann")).agree()
    person.answer_forms()
    browser = fresh_browser(client, settings)
    seen = {}
    for scopes in (["read"], ["read", "personal"]):
        token = owner.send("POST", "/tokens", {"name": "t", "scopes": scopes}).json()["token"]
        headers = {"authorization": f"Bearer {token}"}
        paths = ("monitor", "results", "runs", f"runs/{person.run_id}")
        answers = [browser.get(f"/api/admin/studies/short/{path}", headers=headers) for path in paths]
        seen[len(scopes)] = [answer.status_code for answer in answers]
        told = "".join(answer.text for answer in answers)
        assert "Mustermann" not in told  # a label names a person: the identity is shown by itself, to owners
    assert seen == {1: [200, 200, 403, 403], 2: [200] * 4}
    assert [row["action"] for row in owner.get("/audit").json()].count("personal data read") == 1


def test_nothing_of_an_erased_person_is_left(
    client: TestClient, services: Services, owner: Admin, study: StudyInDatabase
) -> None:
    person = Participant(client, study.link("personal", label="Erika Mustermann")).agree()
    person.answer_all()
    code = person.request("POST", "/complete").json()["completion_code"]
    run = f"/studies/short/runs/{person.run_id}"
    assert owner.send("PUT", f"{run}/exclusion", {"reason": "she has strabismus"}).status_code == 204
    with services.database.read() as session:
        began = str(session.execute(text("SELECT consented_at FROM study_runs")).scalar())[:23]
    assert owner.send("POST", f"{run}/erase", {"confirm": person.run_id}).status_code == 200
    with services.database.read() as session:
        for table in ("study_runs", "links", "audit_entries", "run_events", "form_answers", "trial_ratings"):
            rows = [list(map(str, row)) for row in session.execute(text(f"SELECT * FROM {table}"))]
            for secret in ("Mustermann", "strabismus", code, began):
                assert secret not in json.dumps(rows), (table, secret)
