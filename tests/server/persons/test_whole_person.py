"""Who a person is and what hangs on her: the same for access, for erasure, and whichever way she is named."""

from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient
from sqlalchemy import Table, func, select
from sqlalchemy.orm import Session

from experiments.load import parse_experiment
from server.context import Services
from server.models import Base, RunEvent, StudyRun, View, ViewClip
from server.participation.identity_keys import ParticipantIdentity
from server.participation.identity_repository import store_identity
from server.privacy.ledger import erasures_in_ledger, ledger_path, note_erased
from server.privacy.persons import visits_of
from server.privacy.retention import every_study
from tests.helpers.admins import Admin
from tests.helpers.databases import run_server_command
from tests.helpers.studies import SHORT, Participant, StudyInDatabase, add_study

on_sqlite = pytest.mark.parametrize("database_url", ["sqlite"], indirect=True)
CODES = {"code_complete": "PAYS-C0FFEE", "code_failed_check": "PAYS-0DEAD0"}


def access(owner: Admin, run: str) -> Any:
    return owner.get(f"/studies/short/runs/{run}/subject-access")


def with_events(client: TestClient, services: Services, link: str) -> Participant:
    """Somebody who was turned away, came back by the same link, answered, and saw a clip."""
    refused = {"link_token": link, "reason": "no_webcodecs", "data": {"user_agent": "odd"}}
    assert client.post("/api/unsupported", json=refused).status_code == 202
    person = Participant(client, link).agree()
    person.answer_all()
    with services.database.write() as session:
        run = session.scalars(select(StudyRun).where(StudyRun.public_id == person.run_id)).one()
        view = View(
            view_id="v",
            study_run_id=run.id,
            trial_index=0,
            number=90,
            play=1,
            started_at_client=run.started_at,
        )
        session.add(view)
        session.flush()
        session.add(ViewClip(view=view.id, role="shown", clip_sha256="0" * 64, frame_log="0 16 33"))
    return person


def hanging_on(session: Session, run: StudyRun) -> dict[str, int]:
    """Table -> rows that lead to the run by foreign keys, however far, or to its link alone."""
    keys: dict[Table, Any] = {StudyRun.__table__: select(StudyRun.__table__.c.id).filter_by(id=run.id)}
    counts = {}
    for table in Base.metadata.sorted_tables:
        for constraint in sorted(table.foreign_key_constraints, key=lambda one: len(one.columns)):
            parent = keys.get(constraint.referred_table)
            first = next(iter(constraint.elements))
            if parent is None or first.column.name not in {"id", "study_run_id"}:
                continue
            own = table.c[constraint.column_keys[0]]
            keys[table] = select(next(iter(table.primary_key)) if "id" in table.c else own).where(
                own.in_(parent)
            )
            count = select(func.count()).select_from(table).where(own.in_(parent))
            counts[table.name] = session.scalar(count) or 0
            break
    refused = select(func.count()).where(RunEvent.link_id == run.link_id, RunEvent.study_run_id.is_(None))
    counts["run_events"] += session.scalar(refused) or 0
    return {name: count for name, count in counts.items() if count}


def run_of(session: Session, public_id: str) -> StudyRun:
    return session.scalars(select(StudyRun).where(StudyRun.public_id == public_id)).one()


def test_everything_that_leads_to_a_run_is_reported_and_erased(
    client: TestClient, services: Services, owner: Admin, study: StudyInDatabase
) -> None:
    person = with_events(client, services, study.link("personal", label="Ada"))
    with services.database.read() as session:
        expected = hanging_on(session, run_of(session, person.run_id))
    assert {"view_clips", "views", "trial_ratings", "run_events"} <= set(expected)
    [visit] = access(owner, person.run_id).json()["visits"]
    told = {name: len(rows) for name, rows in visit["stored"].items()}
    left_out = {"recruiter_identities", "identity_keys"}
    assert told == {"study_runs": 1, "links": 1} | {
        name: count for name, count in expected.items() if name not in left_out
    }
    assert "0 16 33" in str(visit["stored"]["view_clips"])
    assert "no_webcodecs" in str(visit["stored"]["run_events"])
    path = f"/studies/short/runs/{person.run_id}/erase"
    assert owner.send("POST", path, {"confirm": person.run_id}).status_code == 200
    with services.database.read() as session:
        left = set(hanging_on(session, run_of(session, person.run_id)))
        assert session.scalar(select(func.count()).select_from(RunEvent)) == 0
    assert left <= {"assigned_trials"}


def test_events_of_a_link_of_many_are_nobodys(
    client: TestClient, services: Services, owner: Admin, study: StudyInDatabase
) -> None:
    person = with_events(client, services, study.link_token)
    assert "no_webcodecs" not in access(owner, person.run_id).text
    owner.send("POST", f"/studies/short/runs/{person.run_id}/erase", {"confirm": person.run_id})
    with services.database.read() as session:
        assert session.scalars(select(RunEvent.type)).all() == ["unsupported"]


@on_sqlite
@pytest.mark.parametrize("kind", ["general", "personal"])
def test_what_pays_is_not_reported(
    client: TestClient, services: Services, owner: Admin, study: StudyInDatabase, kind: str
) -> None:
    person = Participant(client, study.link(kind, label="Label of it")).agree()
    with services.database.write() as session:
        run = run_of(session, person.run_id)
        run.completion_code = "OWN-CODE"
        run.link.recruiter = {"kind": "prolific", **CODES}
    answer = access(owner, person.run_id)
    for code in (*CODES.values(), "OWN-CODE"):
        assert code not in answer.text
    [link] = answer.json()["visits"][0]["stored"]["links"]
    personal = {"label"} if kind == "personal" else set()
    assert set(link) == {"public_id", "kind", "created_at"} | personal
    with services.database.write() as session:
        run_of(session, person.run_id).status = "complete"
    assert "OWN-CODE" in access(owner, person.run_id).text


@on_sqlite
def test_a_person_is_the_same_by_id_and_by_run(
    client: TestClient, services: Services, owner: Admin, study: StudyInDatabase
) -> None:
    """One id - a personal link - another id: one person; a preview under her id is not a visit."""
    general, personal = study.link_token, study.link("personal", label="x")
    people = {
        "first": Participant(client, general).agree(),
        "second": Participant(client, personal).agree(),
        "third": Participant(client, general).agree(),
        "preview": Participant(client, study.link("preview")).agree(),
        "other": Participant(client, general).agree(),
    }
    with services.database.write() as session:
        runs = {name: run_of(session, person.run_id) for name, person in people.items()}
        # Two visits by the personal link, each under another id: the second and the third visit.
        runs["third"].link_id = runs["second"].link_id
        for name, code in {"first": "a", "second": "a", "third": "b", "preview": "a", "other": "c"}.items():
            store_identity(
                session, runs[name], runs[name].study.pseudonym_key, ParticipantIdentity(code), code
            )
    hers = {people[name].run_id for name in ("first", "second", "third")}
    with services.database.read() as session:
        known = run_of(session, people["first"].run_id).study
        for run, code in [("first", ""), ("second", ""), ("third", ""), ("", "a"), ("", "b")]:
            named = people[run].run_id if run else ""
            assert {visit.public_id for visit in visits_of(session, known, named, code)} == hers
    done = run_server_command(services.settings, "person", "erase", "short", "--id", "a", "--yes")
    assert done.returncode == 0, done.stderr
    assert set(erasures_in_ledger(services.settings)) == hers


@on_sqlite
def test_a_torn_line_of_the_ledger_swallows_no_erasure(
    services: Services, caplog: pytest.LogCaptureFixture
) -> None:
    note_erased(services.settings, ["a"])
    path = ledger_path(services.settings)
    path.write_bytes(path.read_bytes() + b'{"run": "b", "era')
    note_erased(services.settings, ["c", "d"])
    assert erasures_in_ledger(services.settings) == ["a", "c", "d"]
    assert "is incomplete" in caplog.text
    caplog.clear()
    note_erased(services.settings, ["e"])
    assert erasures_in_ledger(services.settings) == ["a", "c", "d", "e"]
    assert caplog.text == ""


@on_sqlite
def test_one_study_that_cannot_be_read_does_not_stop_the_others(
    client: TestClient, services: Services, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    declared = SHORT.replace("[session]", "[retention]\nanswers_days = 10\n\n[session]")
    study = add_study(services, tmp_path / "clips", declared)
    person = Participant(client, study.link_token).agree()
    with services.database.write() as session:
        run = run_of(session, person.run_id)
        run.last_seen_at = run.last_seen_at.replace(year=2001)
        broken = parse_experiment(declared)
        assert broken.retention.answers_days == 10
        session.execute(_broken_study(run))
    every_study(services.database, services.settings, lambda: False)
    with services.database.read() as session:
        assert run_of(session, person.run_id).erased_at is not None
    assert "retention of broken" in caplog.text


def _broken_study(run: StudyRun) -> Any:
    """A study of which the versions cannot be read: its active one is not there."""
    table = Base.metadata.tables["studies"]
    columns = [column for column in table.c if column.name not in {"id", "name", "active_version"}]
    row = select(-1, func.lower("broken"), 99, *columns).where(table.c.id == run.study_id)
    return table.insert().from_select(["id", "name", "active_version", *(one.name for one in columns)], row)


@on_sqlite
def test_ids_that_do_not_open_are_refused_in_a_line_and_not_cut_off(
    client: TestClient, services: Services, owner: Admin, study: StudyInDatabase
) -> None:
    person = Participant(client, study.link(recruiter={"kind": "sona"}))
    person.start(query={"survey_code": "40177"})
    assert owner.get("/studies/short/data/identities.csv").status_code == 200
    with services.database.write() as session:
        session.execute(Base.metadata.tables["identity_keys"].update().values(wrapped_key="A" * 56))
    answer = owner.get("/studies/short/data/identities.csv")
    assert answer.status_code == 409
    assert "server database rewrap OLD_KEY_FILE" in answer.text
