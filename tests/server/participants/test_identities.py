"""Recruiters' IDs: a pseudonym everywhere, in one table, and no key to anybody's visit."""

import csv
import io
from typing import Any

import pytest
from fastapi.testclient import TestClient
from sqlalchemy import inspect, text

from server.context import Services
from server.models import IdentityKey, RecruiterIdentity, StudyRun
from server.participation.identity_keys import ParticipantIdentity, identifier_hash
from server.participation.identity_repository import known_as
from server.participation.returning import pseudonym
from tests.helpers.admins import Admin
from tests.helpers.studies import SHORT, Participant, StudyInDatabase, add_study

SONA_CODE = "Sona-40177"  # no stamp or digest holds one by chance
QUERY = {"survey_code": SONA_CODE, "note": "by e-mail"}


@pytest.fixture
def link(study: StudyInDatabase) -> str:
    return study.link(recruiter={"kind": "sona"})


@pytest.fixture
def victim(client: TestClient, link: str) -> Participant:
    """Somebody with a SONA code who has begun."""
    person = Participant(client, link)
    person.start(query=QUERY)
    person.request("PUT", "/consent", {"agreed": True})
    return person


def code_of(answer: Any) -> tuple[int, str]:
    return answer.status_code, answer.json()["error"]["code"]


def test_a_recruiters_id_alone_does_not_hand_over_a_visit(
    client: TestClient, link: str, victim: Participant
) -> None:
    attacker = Participant(client, link)
    answer = attacker.start(query={"survey_code": SONA_CODE})
    assert code_of(answer) == (409, "resume_code_needed")
    assert victim.token not in answer.text
    assert victim.run_id not in answer.text
    assert attacker.token == ""


@pytest.mark.parametrize(
    "written", ["sona-40177", "SONA-40177", " Sona-40177 ", "Sona-\u00a040177", "Ｓona-40177"]
)
def test_ids_that_differ_in_case_or_blanks_are_one_persons(
    client: TestClient, link: str, victim: Participant, written: str
) -> None:
    answer = Participant(client, link).start(query={"survey_code": written})
    assert code_of(answer) == (409, "resume_code_needed")


def test_somebody_known_by_an_id_as_it_is_written_stays_known_by_it(
    client: TestClient, link: str, victim: Participant, services: Services
) -> None:
    """As earlier releases stored it, which kept ids of different case apart."""
    with services.database.write() as session:
        run = session.query(StudyRun).filter_by(public_id=victim.run_id).one()
        key = run.study.pseudonym_key
        run.participant = pseudonym(key, f"recruiter:{SONA_CODE}")
        row = session.get_one(RecruiterIdentity, run.id)
        row.identifier_hash = identifier_hash(key, SONA_CODE)
    answer = Participant(client, link).start(query={"survey_code": SONA_CODE})
    assert code_of(answer) == (409, "resume_code_needed")


def test_somebody_known_by_an_id_of_another_form_is_still_let_in(
    client: TestClient, link: str, victim: Participant, services: Services
) -> None:
    """Earlier releases took ids of any form."""
    with services.database.write() as session:
        run = session.query(StudyRun).filter_by(public_id=victim.run_id).one()
        key = run.study.pseudonym_key
        run.participant = pseudonym(key, "recruiter:%40177%")
        session.get_one(RecruiterIdentity, run.id).identifier_hash = identifier_hash(key, "%40177%")
    answer = Participant(client, link).start(query={"survey_code": "%40177%"})
    assert code_of(answer) == (409, "resume_code_needed")


GOOD_IDS = [
    ("prolific", "PROLIFIC_PID", "5f1a9c0e7b2d3c4e5f6a7b8c"),
    ("prolific", "PROLIFIC_PID", "5F1A9C0E7B2D3C4E5F6A7B8C"),
    ("sona", "survey_code", "40177"),
    ("mturk", "workerId", "A2ZKX7P0Q1W3E5"),
    ("generic", "participant", "P-01"),
    ("generic", "participant", "anna.müller+1@example.org"),
    ("generic", "participant", "参加者7"),
]
BAD_IDS = [
    ("prolific", "PROLIFIC_PID", "p1"),
    ("prolific", "PROLIFIC_PID", "{{%PROLIFIC_PID%}}"),
    ("prolific", "PROLIFIC_PID", '=HYPERLINK("http://example.org";"a")'),
    ("sona", "survey_code", "%SURVEY_CODE%"),
    ("mturk", "workerId", "${workerId}"),
    ("generic", "participant", "=1+1"),
    ("generic", "participant", "＝1+1"),
    ("generic", "participant", "x;=1+1"),
    ("generic", "participant", "a" * 201),
]


@pytest.mark.parametrize(("kind", "parameter", "identifier"), GOOD_IDS)
def test_every_recruiters_own_ids_are_taken(
    client: TestClient, study: StudyInDatabase, kind: str, parameter: str, identifier: str
) -> None:
    person = Participant(client, study.link(recruiter={"kind": kind}))
    assert person.start(query={parameter: identifier}).status_code == 201


@pytest.mark.parametrize(("kind", "parameter", "identifier"), BAD_IDS)
def test_an_id_that_a_recruiter_does_not_write_begins_nothing(
    client: TestClient, study: StudyInDatabase, kind: str, parameter: str, identifier: str
) -> None:
    person = Participant(client, study.link(recruiter={"kind": kind}))
    answer = person.start(query={parameter: identifier})
    assert code_of(answer) == (422, "identifier_invalid")
    assert parameter in answer.json()["error"]["message"]
    preview = Participant(client, study.link("preview", recruiter={"kind": kind}))
    assert preview.start(query={parameter: identifier}).status_code == 201


def test_a_finished_visits_code_is_not_shown_for_a_recruiters_id(
    client: TestClient, link: str, victim: Participant
) -> None:
    victim.answer_all()
    paid = victim.request("POST", "/complete").json()["completion_code"]
    for anew in (False, True):
        answer = Participant(client, link).start(query={"survey_code": SONA_CODE}, anew=anew)
        assert code_of(answer) == (409, "taken_part_already")
        assert paid not in answer.text


def test_who_has_lost_the_code_starts_over_and_leaves_the_other_visit_alone(
    client: TestClient, link: str, victim: Participant, services: Services
) -> None:
    second = Participant(client, link)
    assert second.start(query=QUERY, anew=True).status_code == 201
    assert second.run_id != victim.run_id
    assert victim.state()["status"] == "active"
    with services.database.read() as session:
        first, other = session.query(StudyRun).order_by(StudyRun.id)
        assert first.participant == other.participant


@pytest.mark.parametrize("policy", ["restart", "block"])
def test_no_policy_lets_an_id_alone_end_or_take_a_visit(
    client: TestClient, services: Services, tmp_path: Any, policy: str
) -> None:
    declared = SHORT.replace("[session]", f'[session]\nresume = "{policy}"').replace('"short"', f'"{policy}"')
    link = add_study(services, tmp_path / "clips", declared).link(recruiter={"kind": "sona"})
    victim = Participant(client, link)
    victim.start(query=QUERY)
    victim.request("PUT", "/consent", {"agreed": True})
    attacker = Participant(client, link)
    attacker.start(query=QUERY, anew=True)
    assert attacker.token != victim.token
    with services.database.read() as session:
        assert session.query(StudyRun).filter_by(public_id=victim.run_id).one().status == "active"


def test_the_code_that_was_shown_resumes_on_another_device(
    client: TestClient, link: str, victim: Participant
) -> None:
    shown = victim.state()["resume_code"]
    other = Participant(client, link)
    typed = shown.lower().replace("-", " ")
    assert other.start(query=QUERY, resume_code=typed).status_code == 200
    assert other.run_id == victim.run_id
    # The page keeps the code, and brings it along when it is loaded again.
    assert other.start(query=QUERY, resume_code=shown).status_code == 200


@pytest.mark.parametrize(
    "database_url", [pytest.param("postgres", marks=pytest.mark.postgres)], indirect=True
)
def test_a_code_is_counted_before_the_transaction_of_a_start(
    client: TestClient, link: str, victim: Participant, services: Services, monkeypatch: pytest.MonkeyPatch
) -> None:
    counted: list[str] = []

    def looked_around(key: str) -> None:
        with services.database.engine.connect() as connection:
            connection.execute(text("SELECT id FROM studies FOR UPDATE NOWAIT"))
        counted.append(key)

    monkeypatch.setattr(services.resume_codes, "hit", looked_around)
    shown = victim.state()["resume_code"]
    assert Participant(client, link).start(query=QUERY, resume_code=shown).status_code == 200
    assert len(counted) == 1


def test_a_resume_code_works_where_the_recruiter_names_nobody(
    client: TestClient, study: StudyInDatabase, participant: Participant
) -> None:
    participant.agree()
    other = Participant(client, study.link_token)
    assert other.start(resume_code=participant.state()["resume_code"]).status_code == 200
    assert other.run_id == participant.run_id


def test_a_resume_code_of_another_link_or_person_does_not_fit(
    client: TestClient, study: StudyInDatabase, link: str, victim: Participant
) -> None:
    code = victim.state()["resume_code"]
    assert code_of(Participant(client, study.link_token).start(resume_code=code)) == (
        409,
        "resume_code_wrong",
    )
    for wrong in ("", "0000-0000-0000", code[:-1] + ("0" if code[-1] != "0" else "1"), "élan vital"):
        answer = Participant(client, link).start(query=QUERY, resume_code=wrong)
        assert code_of(answer) == (409, "resume_code_wrong")


def test_guessing_at_one_visit_is_limited_and_others_do_not_notice(
    client: TestClient, link: str, victim: Participant, services: Services
) -> None:
    other = Participant(client, link)
    other.start(query={"survey_code": "7"})
    code = victim.state()["resume_code"]
    guesses = [f"{code[:5]}{number:04d}-0000" for number in range(30)]
    answers = [Participant(client, link).start(query=QUERY, resume_code=guess) for guess in guesses]
    assert {answer.status_code for answer in answers} == {409, 429}
    assert sum(answer.status_code == 409 for answer in answers) <= 11
    assert other.state()["status"] == "active"
    fits = Participant(client, link).start(
        query={"survey_code": "7"}, resume_code=other.state()["resume_code"]
    )
    assert fits.status_code == 200


def test_personal_links_and_previews_show_no_code(client: TestClient, study: StudyInDatabase) -> None:
    for kind in ("personal", "preview"):
        assert Participant(client, study.link(kind)).agree().state()["resume_code"] is None


def test_one_pseudonym_for_one_id_of_a_study_and_another_in_the_next(
    client: TestClient, services: Services, tmp_path: Any
) -> None:
    names = []
    for name in ("short", "other"):
        study = add_study(services, tmp_path / name, SHORT.replace('"short"', f'"{name}"'))
        for _ in range(2):
            link = study.link(recruiter={"kind": "sona"})
            person = Participant(client, link)
            person.start(query=QUERY)
            with services.database.read() as session:
                names.append(session.query(StudyRun).filter_by(public_id=person.run_id).one().participant)
    assert names[0] == names[1] != names[2] == names[3]


def test_no_table_holds_a_raw_id(services: Services, victim: Participant) -> None:
    holding = set()
    with services.database.read() as session:
        for table in inspect(session.connection()).get_table_names():
            rows = session.execute(text(f"SELECT * FROM {table}"))
            holding |= {table for row in rows if any(SONA_CODE in str(value) for value in row)}
        assert holding == set()
        known = known_as(session, session.query(StudyRun).one())
        assert known == ParticipantIdentity(SONA_CODE, QUERY)


def test_no_page_or_export_shows_a_raw_id(
    experimenter: Admin, victim: Participant, study: StudyInDatabase
) -> None:
    victim.answer_all()
    paths = [f"runs/{victim.run_id}", "runs", "monitor", "data/ratings.csv", "data/runs.csv"]
    paths += ["data/raw.ndjson", "data/psych-ds.zip", "data/codebook.md"]
    for path in paths:
        answer = experimenter.get(f"/studies/short/{path}")
        assert answer.status_code == 200, path
        assert SONA_CODE.encode() not in answer.content, path


def test_a_personal_links_label_is_not_a_participant_of_exports(
    client: TestClient, study: StudyInDatabase, experimenter: Admin
) -> None:
    Participant(client, study.link("personal", label="Miriam K")).agree().answer_all()
    for path in ("runs", "data/ratings.csv", "data/runs.csv", "data/raw.ndjson"):
        assert "Miriam" not in experimenter.get(f"/studies/short/{path}").text, path


def test_owners_see_an_id_on_demand_and_it_is_written_down(
    owner: Admin, experimenter: Admin, victim: Participant
) -> None:
    path = f"/studies/short/runs/{victim.run_id}/identity"
    assert experimenter.get(path).status_code == 403
    shown = owner.get(path).json()
    assert (shown["identifier"], shown["parameters"]) == (SONA_CODE, QUERY)
    entries = owner.get("/audit").json()
    assert [entry["target"] for entry in entries if entry["action"] == "identity read"] == [victim.run_id]
    assert not [entry for entry in entries if SONA_CODE in str(entry)]


def test_ids_leave_by_an_export_of_their_own(
    owner: Admin, experimenter: Admin, victim: Participant, services: Services
) -> None:
    assert experimenter.get("/studies/short/data/identities.csv").status_code == 403
    [row] = csv.DictReader(io.StringIO(owner.get("/studies/short/data/identities.csv").text))
    with services.database.read() as session:
        assert row["participant"] == session.query(StudyRun).one().participant
    assert (row["run"], row["identifier"]) == (victim.run_id, SONA_CODE)
    actions = [entry["action"] for entry in owner.get("/audit").json()]
    assert "identities downloaded" in actions


def test_erasure_takes_the_id_too(experimenter: Admin, victim: Participant, services: Services) -> None:
    path = f"/studies/short/runs/{victim.run_id}/erase"
    assert experimenter.send("POST", path, {"confirm": victim.run_id}).status_code == 200
    with services.database.read() as session:
        assert session.query(RecruiterIdentity).count() == session.query(IdentityKey).count() == 0
