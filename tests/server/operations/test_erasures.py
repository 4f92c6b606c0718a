"""Who was erased stays erased: in every visit known to be theirs, and after a restore of an older backup."""

import shutil
from pathlib import Path

import pytest
from fastapi.testclient import TestClient
from sqlalchemy import select

from experiments.errors import InputError
from server.context import Services, open_services
from server.core.settings import Settings
from server.models import AuditEntry, StudyRun
from server.operations.backup import back_up
from server.operations.restore import restore
from server.participation.identity_keys import ParticipantIdentity
from server.participation.identity_repository import store_identity
from server.privacy.ledger import begin_ledger, erasures_in_ledger, ledger_path, note_erased
from tests.helpers.admins import Admin
from tests.helpers.databases import BACKENDS, run_server_command
from tests.helpers.studies import Participant, StudyInDatabase

RUNS = "/studies/short/runs"


def erased_runs(services: Services) -> set[str]:
    with services.database.read() as session:
        return set(session.scalars(select(StudyRun.public_id).where(StudyRun.erased_at.is_not(None))))


def test_every_visit_of_the_same_person_is_erased(
    client: TestClient, services: Services, experimenter: Admin, study: StudyInDatabase
) -> None:
    visits = [Participant(client, study.link_token).agree() for _ in range(3)]
    with services.database.write() as session:
        for visit, identifier in zip(visits, ("5a9d", "5a9d", "77b2"), strict=True):
            run = session.scalars(select(StudyRun).where(StudyRun.public_id == visit.run_id)).one()
            store_identity(session, run, run.study.pseudonym_key, ParticipantIdentity(identifier))
    first, second, other = (visit.run_id for visit in visits)
    answer = experimenter.send("POST", f"{RUNS}/{first}/erase", {"confirm": first})
    assert answer.status_code == 200
    assert answer.json()["runs"] == [first, second]
    assert answer.json()["reports"] == []
    assert answer.json()["ledger"] == str(ledger_path(services.settings))
    assert erased_runs(services) == {first, second}
    assert other not in erasures_in_ledger(services.settings)
    with services.database.read() as session:
        query = select(AuditEntry.target).where(AuditEntry.action == "run erased").order_by(AuditEntry.id)
        assert session.scalars(query).all() == [first, second]


def test_people_whose_ids_nobody_knows_are_not_taken_for_one(
    client: TestClient, services: Services, experimenter: Admin, study: StudyInDatabase
) -> None:
    visits = [Participant(client, study.link_token).agree() for _ in range(2)]
    first = visits[0].run_id
    assert experimenter.send("POST", f"{RUNS}/{first}/erase", {"confirm": first}).json()["runs"] == [first]


@pytest.mark.parametrize("database_url", ["sqlite"], indirect=True)
@pytest.mark.parametrize("empty_database_url", BACKENDS, indirect=True)
def test_a_restore_does_not_bring_an_erased_person_back(
    services: Services,
    experimenter: Admin,
    participant: Participant,
    empty_database_url: str,
    tmp_path: Path,
) -> None:
    participant.agree().rate_all()
    backup = tmp_path / "before.tar"
    back_up(services.database, services.settings, services.clips, backup, with_clips=False)
    run = participant.run_id
    assert experimenter.send("POST", f"{RUNS}/{run}/erase", {"confirm": run}).status_code == 200
    folder = tmp_path / "new"
    settings = Settings(database_url=empty_database_url, data_folder=folder)
    restored, lines = open_services(settings), list[str]()
    with pytest.raises(InputError, match="newer than the backup"):  # its own ledger is as old as it
        restore(restored.database, restored.settings, restored.clips, backup, lines.append)
    restore(restored.database, restored.settings, restored.clips, backup, lines.append, despite_erasures=True)
    assert lines[-1].startswith(f"WARNING: no ledger of erasures at {folder}")
    assert erased_runs(restored) == set()
    shutil.copy(ledger_path(services.settings), ledger_path(settings))
    assert run_server_command(settings, "database", "erase-again").stdout == "1 run erased\n"
    assert erased_runs(restored) == {run}
    assert run_server_command(settings, "database", "erase-again").stdout == "0 runs erased\n"
    restored.database.close()


@pytest.mark.parametrize("database_url", ["sqlite"], indirect=True)
def test_a_ledger_begun_after_the_backup_knows_of_no_erasure_before_it(
    services: Services, participant: Participant, tmp_path: Path
) -> None:
    """As where the old ledger was lost with its disk, and a server has been started since."""
    participant.agree()
    back_up(services.database, services.settings, services.clips, tmp_path / "before.tar", with_clips=False)
    settings = Settings(database_url=f"sqlite:///{tmp_path / 'x.sqlite'}", data_folder=tmp_path / "new")
    begin_ledger(settings)
    restored = open_services(settings)
    with pytest.raises(InputError, match="newer than the backup"):
        restore(restored.database, restored.settings, restored.clips, tmp_path / "before.tar")
    restored.database.close()


@pytest.mark.parametrize("database_url", ["sqlite"], indirect=True)
def test_a_restore_replays_the_ledger_that_is_there(
    services: Services, participant: Participant, tmp_path: Path
) -> None:
    participant.agree()
    backup = tmp_path / "before.tar"
    back_up(services.database, services.settings, services.clips, backup, with_clips=False)
    settings = Settings(database_url=f"sqlite:///{tmp_path / 'x.sqlite'}", data_folder=tmp_path / "new")
    note_erased(settings, [participant.run_id, "of another installation"])
    with ledger_path(settings).open("a") as stream:
        stream.write('{"run": "cut o')
    restored, lines = open_services(settings), list[str]()
    restore(restored.database, restored.settings, restored.clips, backup, lines.append)
    assert f"1 run erased again, by {ledger_path(settings)}" in lines
    assert erased_runs(restored) == {participant.run_id}
    assert ledger_path(settings).stat().st_mode & 0o077 == 0
    restored.database.close()


@pytest.mark.parametrize("database_url", ["sqlite"], indirect=True)
def test_a_ledger_as_old_as_the_backup_is_named_after_a_restore_despite_it(
    services: Services, participant: Participant, tmp_path: Path
) -> None:
    participant.agree()
    note_erased(services.settings, ["somebody erased long before"])
    backup = tmp_path / "before.tar"
    back_up(services.database, services.settings, services.clips, backup, with_clips=False)
    folder = tmp_path / "new"
    settings = Settings(database_url=f"sqlite:///{tmp_path / 'x.sqlite'}", data_folder=folder)
    restored, lines = open_services(settings), list[str]()
    restore(restored.database, restored.settings, restored.clips, backup, lines.append, despite_erasures=True)
    assert lines[-1].startswith(f"WARNING: no ledger of erasures at {folder}")
    restored.database.close()
