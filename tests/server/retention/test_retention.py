"""What a declaration says of keeping is carried out: whose time is over is erased, and nobody else."""

import asyncio
from datetime import datetime, timedelta
from pathlib import Path

import pytest
from fastapi.testclient import TestClient
from pydantic import ValidationError
from sqlalchemy import select

from experiments.declaration.tables import Retention
from experiments.load import parse_experiment
from server.context import Services, open_services
from server.core.settings import Settings
from server.core.values import now
from server.models import AuditEntry, Link, Rating, Study, StudyRun
from server.operations.backup import back_up
from server.operations.restore import restore
from server.participation.identity_repository import known_as
from server.privacy.ledger import erasures_in_ledger, ledger_path
from server.privacy.retention import AT_ONCE, carry_out, hourly_retention, preview
from server.studies.creation import add_version
from tests.helpers.admins import Admin
from tests.helpers.databases import run_server_command
from tests.helpers.studies import SHORT, Participant, StudyInDatabase, add_study
from tests.helpers.tiny_clips import make_clip_folder
from tests.helpers.waiting import run_in_own_loop

KEPT = SHORT.replace(
    "[session]", "[retention]\nidentifiers_days = 90\nunfinished_days = 30\nanswers_days = 1000\n\n[session]"
)
DAY = timedelta(days=1)


@pytest.fixture
def kept(services: Services, tmp_path: Path) -> StudyInDatabase:
    """A study that declares all three periods."""
    return add_study(services, tmp_path / "clips", KEPT)


def came(client: TestClient, study: StudyInDatabase, days_ago: float, *, completed: bool = True) -> str:
    """Somebody with a recruiter's ID whose last sign of life was so long ago; the run."""
    person = Participant(client, study.link(recruiter={"kind": "sona"}))
    person.start(query={"survey_code": f"4{days_ago:g}"})
    person.request("PUT", "/consent", {"agreed": True})
    if completed:
        person.answer_all()
        assert person.request("POST", "/complete").status_code == 200
    move(study.services, person.run_id, days_ago)
    return person.run_id


def move(services: Services, run: str, days_ago: float) -> None:
    with services.database.write() as session:
        session.query(StudyRun).filter_by(public_id=run).update({"last_seen_at": now() - days_ago * DAY})


def state(services: Services) -> dict[str, str]:
    """Run -> erased, unnamed or named."""
    with services.database.read() as session:
        return {
            run.public_id: "erased" if run.erased_at else "named" if known_as(session, run) else "unnamed"
            for run in session.scalars(select(StudyRun))
        }


def looked_at(services: Services, name: str) -> tuple[int, int, datetime | None]:
    with services.database.read() as session:
        study = session.scalars(select(Study).where(Study.name == name)).one()
        shown = preview(session, study, now())
    return shown.identifiers, shown.visits, shown.next_at


def test_each_period_is_carried_out_and_nothing_else(
    client: TestClient, services: Services, kept: StudyInDatabase
) -> None:
    of_age = {
        came(client, kept, 89): "named",
        came(client, kept, 91): "unnamed",
        came(client, kept, 999): "unnamed",
        came(client, kept, 1001): "erased",
        came(client, kept, 29, completed=False): "named",
        came(client, kept, 31, completed=False): "erased",
    }
    identifiers, visits, following = looked_at(services, "short")
    assert (identifiers, visits) == (2, 2)
    assert following is not None
    assert timedelta() < following - now() <= DAY
    with services.database.read() as session:
        ratings = session.query(Rating).count()
    done = carry_out(services.database, services.settings, "short")
    assert (done.identifiers, done.visits) == (2, 2)
    assert state(services) == of_age
    with services.database.read() as session:
        assert session.query(Rating).count() == ratings * 3 // 4  # one of four who answered is gone
        codes = {run.public_id: run.completion_code for run in session.scalars(select(StudyRun))}
        assert {run for run, code in codes.items() if not code} == {
            r for r, s in of_age.items() if s != "named"
        }
        query = select(AuditEntry).where(AuditEntry.action.endswith(" erased"))
        logged = session.scalars(query).all()
    entries = {(entry.action, entry.target) for entry in logged if "retention_days" in entry.details}
    told = {"erased": "run erased", "unnamed": "identifiers erased"}
    assert entries == {(told[kind], run) for run, kind in of_age.items() if kind != "named"}
    assert set(erasures_in_ledger(services.settings)) == {
        run for run, kind in of_age.items() if kind == "erased"
    }
    again = carry_out(services.database, services.settings, "short")
    assert (again.identifiers, again.visits) == (0, 0)
    assert looked_at(services, "short")[:2] == (0, 0)


@pytest.mark.parametrize("database_url", ["sqlite"], indirect=True)
class TestOnSqlite:
    def test_a_restore_of_an_older_backup_brings_nobody_back(
        self, client: TestClient, services: Services, kept: StudyInDatabase, tmp_path: Path
    ) -> None:
        """With the keys of before: what the key file would have done the ledger does as well."""
        unnamed, erased = came(client, kept, 91), came(client, kept, 31, completed=False)
        back_up(services.database, services.settings, services.clips, tmp_path / "b.tar", with_clips=False)
        carry_out(services.database, services.settings, "short")
        folder = tmp_path / "new"
        folder.mkdir()
        new = Settings(database_url=f"sqlite:///{folder / 'x.sqlite'}", data_folder=folder)
        ledger_path(new).write_bytes(ledger_path(services.settings).read_bytes())
        again = open_services(new)
        restore(again.database, again.settings, again.clips, tmp_path / "b.tar", despite_erasures=True)
        assert state(again) == {unnamed: "unnamed", erased: "erased"}
        again.database.close()

    def test_simulated_people_and_previews_are_left(
        self, client: TestClient, services: Services, kept: StudyInDatabase
    ) -> None:
        run = came(client, kept, 2000)
        with services.database.write() as session:
            session.execute(StudyRun.__table__.delete().where(StudyRun.public_id == run))
        simulated = Participant(client, kept.link("general", synthetic=True))
        simulated.agree()
        move(services, simulated.run_id, 2000)
        assert looked_at(services, "short") == (0, 0, None)

    def test_who_began_under_a_longer_period_keeps_to_the_shorter_one_declared_since(
        self, client: TestClient, services: Services, tmp_path: Path
    ) -> None:
        study = add_study(services, tmp_path / "clips", SHORT)
        run = came(client, study, 91)
        assert looked_at(services, "short") == (0, 0, None)
        experiment = parse_experiment(KEPT)
        manifest = make_clip_folder(experiment, tmp_path / "clips2", frames=4)
        with services.database.write() as session:
            found = session.query(Study).one()
            add_version(session, found, KEPT, experiment, manifest, None)
            found.active_version = 2
        assert looked_at(services, "short")[:2] == (1, 0)
        with services.database.write() as session:
            session.query(Study).one().active_version = 1
        # Then the information that the person got when the visit began is all there is.
        assert looked_at(services, "short")[:2] == (0, 0)
        assert state(services) == {run: "named"}

    def test_a_personal_links_label_is_an_identifier_too(
        self, client: TestClient, services: Services, kept: StudyInDatabase
    ) -> None:
        person = Participant(client, kept.link("personal", label="Miriam K")).agree()
        move(services, person.run_id, 91)
        with services.database.write() as session:
            session.query(StudyRun).one().status = "complete"
        carry_out(services.database, services.settings, "short")
        with services.database.read() as session:
            assert "Miriam K" not in session.scalars(select(Link.label)).all()
            assert session.query(StudyRun).one().erased_at is None

    def test_more_than_fit_one_transaction_and_an_end_between_two(
        self, client: TestClient, services: Services, kept: StudyInDatabase
    ) -> None:
        for _ in range(AT_ONCE + 1):
            Participant(client, kept.link_token).agree()
        with services.database.write() as session:
            session.query(StudyRun).update({"last_seen_at": now() - 40 * DAY})
        asked = iter((False, True))
        first = carry_out(services.database, services.settings, "short", lambda: next(asked))
        assert first.visits == AT_ONCE
        assert carry_out(services.database, services.settings, "short").visits == 1

    def test_the_command_shows_and_erases(
        self, client: TestClient, services: Services, kept: StudyInDatabase
    ) -> None:
        run = came(client, kept, 91)
        shown = run_server_command(services.settings, "retention", "--dry-run").stdout
        assert "identifiers 90 days, unfinished 30 days, answers 1000 days" in shown
        assert state(services) == {run: "named"}
        done = run_server_command(services.settings, "retention", "short")
        assert done.stdout == "short: identifiers of 1 visits, 0 visits erased\n"
        assert state(services) == {run: "unnamed"}
        wrong = run_server_command(services.settings, "retention", "shrt")
        assert wrong.returncode != 0
        assert "did you mean 'short'" in wrong.stderr
        assert "Traceback" not in wrong.stderr

    def test_the_command_says_where_nothing_is_declared(
        self, services: Services, study: StudyInDatabase
    ) -> None:
        said = run_server_command(services.settings, "retention").stdout
        assert said == "no study declares a retention period; see [retention] in the declaration\n"

    def test_the_server_does_it_by_itself(
        self, client: TestClient, services: Services, kept: StudyInDatabase
    ) -> None:
        run = came(client, kept, 91)

        async def serve() -> None:
            async with hourly_retention(
                services.database, services.settings, services.locks, first_look_s=0.0
            ):
                while state(services)[run] != "unnamed":
                    await asyncio.sleep(0.02)

        run_in_own_loop(asyncio.wait_for(serve(), 60))

    def test_the_page_shows_what_is_coming(
        self, client: TestClient, services: Services, kept: StudyInDatabase, owner: Admin
    ) -> None:
        came(client, kept, 91)
        shown = owner.get("/studies/short/retention").json()
        assert shown["periods"][0] == {"what": "identifiers", "days": 90}
        assert (shown["identifiers"], shown["visits"]) == (1, 0)
        assert shown["next_at"] is not None


def test_periods_that_contradict_one_another_are_refused() -> None:
    with pytest.raises(ValidationError, match=r"unfinished_days: expected at most answers_days \(10\)"):
        Retention(unfinished_days=30, answers_days=10)
    with pytest.raises(ValidationError, match="greater than or equal to 1"):
        Retention(identifiers_days=0)


def test_the_shorter_of_two() -> None:
    both = Retention(identifiers_days=9, answers_days=50).shorter(
        Retention(identifiers_days=8, unfinished_days=3)
    )
    assert both == Retention(identifiers_days=8, unfinished_days=3, answers_days=50)
