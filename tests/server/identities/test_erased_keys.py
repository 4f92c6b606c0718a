"""Whose key is erased cannot be read any more: in the database, in its file, in older backups."""

import json
import tarfile
from pathlib import Path

import pytest
from fastapi.testclient import TestClient
from sqlalchemy import select, text

from experiments.errors import InputError
from server.context import Services, open_services
from server.core.settings import Settings
from server.models import IdentityKey, RecruiterIdentity, Study, StudyRun
from server.operations.backup import back_up
from server.operations.doctor import identities
from server.operations.drill import drill
from server.operations.key_escrow import NAME
from server.operations.restore import restore
from server.participation.identity_repository import known_as, readable_identities
from server.privacy.ledger import LEDGER_NAME, ledger_path, merge_ledgers
from tests.helpers.admins import Admin
from tests.helpers.databases import BACKENDS, run_server_command
from tests.helpers.studies import Participant, StudyInDatabase

CODES = ("Prolific-40177", "Prolific-40178")  # no stamp or digest holds one by chance
on_sqlite = pytest.mark.parametrize("database_url", ["sqlite"], indirect=True)


@pytest.fixture
def link(study: StudyInDatabase) -> str:
    return study.link(recruiter={"kind": "sona"})


@pytest.fixture
def people(client: TestClient, link: str) -> list[Participant]:
    """Two people with SONA codes who have begun."""
    begun = [Participant(client, link) for _ in CODES]
    for person, code in zip(begun, CODES, strict=True):
        person.start(query={"survey_code": code})
    return begun


def ids(services: Services) -> dict[str, str]:
    """Run -> the recruiter's ID, of those that can be read."""
    with services.database.read() as session:
        known = {run.public_id: known_as(session, run) for run in session.scalars(select(StudyRun))}
    return {run: person.identifier for run, person in known.items() if person}


def restored(backup: Path, url: str, folder: Path) -> tuple[Services, list[str]]:
    services, lines = open_services(Settings(database_url=url, data_folder=folder)), list[str]()
    restore(services.database, services.settings, services.clips, backup, lines.append, despite_erasures=True)
    return services, lines


@pytest.mark.parametrize("database_url", BACKENDS, indirect=True)
@pytest.mark.parametrize("empty_database_url", ["sqlite"], indirect=True)
def test_an_erased_person_is_gone_from_older_backups_too(
    services: Services,
    experimenter: Admin,
    people: list[Participant],
    empty_database_url: str,
    tmp_path: Path,
) -> None:
    """Without the ledger of erasures: the key alone decides."""
    older = tmp_path / "older.tar"
    back_up(services.database, services.settings, services.clips, older, with_clips=False)
    erased, other = (person.run_id for person in people)
    path = f"/studies/short/runs/{erased}/erase"
    assert experimenter.send("POST", path, {"confirm": erased}).status_code == 200
    assert ids(services) == {other: CODES[1]}
    back_up(services.database, services.settings, services.clips, tmp_path / "newer.tar", with_clips=False)
    again, lines = restored(older, empty_database_url, tmp_path / "new")
    assert ids(again) == {other: CODES[1]}
    assert "1 recruiters' IDs; the keys of 1 no longer exist" in lines
    with again.database.read() as session:
        assert list(readable_identities(session)) == [True]
    again.database.close()


@on_sqlite
@pytest.mark.parametrize("empty_database_url", BACKENDS, indirect=True)
def test_a_backup_without_its_key_file_opens_no_id_and_says_so(
    services: Services, people: list[Participant], link: str, empty_database_url: str, tmp_path: Path
) -> None:
    backup, keys = tmp_path / "a" / "b.tar", tmp_path / "safe" / "keys.json"
    for path in (backup, keys):
        path.parent.mkdir()
    back_up(services.database, services.settings, services.clips, backup, with_clips=False, keys=keys)
    assert not (tmp_path / "a" / NAME).exists()
    assert keys.stat().st_mode & 0o077 == 0
    with services.database.read() as session:
        study_key = session.scalars(select(Study.pseudonym_key)).one()
        wrapped = set(session.scalars(select(IdentityKey.wrapped_key)))
    with tarfile.open(backup) as tar:
        for member in tar.getmembers():
            content = tar.extractfile(member)
            if content is not None:
                (tmp_path / "x" / member.name).parent.mkdir(parents=True, exist_ok=True)
                (tmp_path / "x" / member.name).write_bytes(content.read())
    held = run_through_gzip(tmp_path / "x")
    for secret in (*CODES, study_key, *wrapped):
        assert secret not in held
    for secret in (*CODES, study_key):
        assert secret not in keys.read_text()
    again, lines = restored(backup, empty_database_url, tmp_path / "new")
    assert ids(again) == {}
    assert any(line.startswith(f"no key file ({NAME}): 2 recruiters' IDs cannot be read") for line in lines)
    with again.database.read() as session:
        assert session.scalars(select(Study.pseudonym_key)).one() != study_key
        assert [len(key) for key in session.scalars(select(Study.pseudonym_key))] == [64]
    again.database.close()


def run_through_gzip(folder: Path) -> str:
    import gzip

    return "".join(
        gzip.decompress(path.read_bytes()).decode() if path.suffix == ".gz" else path.read_text("latin-1")
        for path in folder.rglob("*")
        if path.is_file()
    )


@on_sqlite
@pytest.mark.parametrize("empty_database_url", ["sqlite"], indirect=True)
def test_with_the_key_file_ids_and_pseudonyms_are_as_before(
    services: Services, people: list[Participant], empty_database_url: str, tmp_path: Path
) -> None:
    keys = tmp_path / "keys.json"
    (tmp_path / "a").mkdir()
    back_up(
        services.database,
        services.settings,
        services.clips,
        tmp_path / "a" / "b.tar",
        with_clips=False,
        keys=keys,
    )
    settings = Settings(database_url=empty_database_url, data_folder=tmp_path / "new")
    done = run_server_command(
        settings, "restore", "--despite-erasures", str(tmp_path / "a" / "b.tar"), "--keys", str(keys)
    )
    assert "2 recruiters' IDs; the keys of 0 no longer exist" in done.stdout, done.stderr
    again = open_services(settings)
    assert sorted(ids(again).values()) == list(CODES)
    with again.database.read() as one, services.database.read() as other:
        query = select(Study.pseudonym_key)
        assert one.scalars(query).all() == other.scalars(query).all()
    again.database.close()


@on_sqlite
def test_a_key_is_gone_from_the_file_of_the_database(
    services: Services, experimenter: Admin, people: list[Participant]
) -> None:
    def file() -> bytes:
        with services.database.engine.connect() as connection:
            connection.execute(text("PRAGMA wal_checkpoint(TRUNCATE)"))
        return Path(str(services.database.url.database)).read_bytes()

    run = people[0].run_id
    with services.database.read() as session:
        query = select(IdentityKey.wrapped_key).join(StudyRun, StudyRun.id == IdentityKey.study_run_id)
        key = session.scalars(query.where(StudyRun.public_id == run)).one()
    assert key.encode() in file()
    experimenter.send("POST", f"/studies/short/runs/{run}/erase", {"confirm": run})
    assert key.encode() not in file()


@on_sqlite
def test_a_changed_secret_key_is_reported_in_a_line_and_fixed(
    services: Services, owner: Admin, people: list[Participant], tmp_path: Path
) -> None:
    old = tmp_path / "old_key"
    old.write_bytes(services.settings.key)
    settings = Settings(**services.settings.model_dump() | {"secret_key": "another key of this installation"})
    changed = open_services(settings)
    [finding] = identities(changed)
    assert finding.verdict == "failed"
    with changed.database.write() as session:
        # As somebody sees it who opens the page of a run.
        run = session.scalars(select(StudyRun).limit(1)).one()
        with pytest.raises(InputError, match="server database rewrap OLD_KEY_FILE"):
            known_as(session, run)
    done = run_server_command(settings, "database", "rewrap", str(old))
    assert done.stdout.startswith("2 keys re-encrypted; 0 were not encrypted with the old key\n"), done.stderr
    assert sorted(ids(changed).values()) == list(CODES)
    assert run_server_command(settings, "database", "rewrap", str(tmp_path / "none")).returncode == 2
    back_up(services.database, services.settings, services.clips, tmp_path / "b.tar", with_clips=False)
    with pytest.raises(InputError, match="the keys of another installation or secret key"):
        back_up(changed.database, changed.settings, changed.clips, tmp_path / "c.tar", with_clips=False)
    changed.database.close()


@on_sqlite
@pytest.mark.parametrize(
    ("content", "said"),
    [("{}", "expected a key file"), ("no JSON", "expected a key file"), ("newer", "format 2")],
)
def test_what_is_not_a_key_file(
    services: Services, people: list[Participant], content: str, said: str, tmp_path: Path
) -> None:
    backup = tmp_path / "b.tar"
    back_up(services.database, services.settings, services.clips, backup, with_clips=False)
    keys = tmp_path / NAME
    newer = json.dumps(json.loads(keys.read_text()) | {"format": 2})
    keys.write_text(newer if content == "newer" else content)
    empty = Settings(database_url=f"sqlite:///{tmp_path / 'x.sqlite'}", data_folder=tmp_path / "new")
    target = open_services(empty)
    with pytest.raises(InputError, match=said):
        restore(target.database, target.settings, target.clips, backup, despite_erasures=True)
    target.database.close()


@on_sqlite
def test_a_drill_without_the_key_file_fails(
    services: Services, people: list[Participant], tmp_path: Path
) -> None:
    backup = tmp_path / "b.tar"
    back_up(services.database, services.settings, services.clips, backup, with_clips=False)
    assert drill(services.settings, backup).said == ""
    (tmp_path / NAME).unlink()
    result = drill(services.settings, backup)
    assert not result.passed
    assert "no key file" in result.said


@on_sqlite
def test_duplicates_are_found_by_the_hash_alone(services: Services, people: list[Participant]) -> None:
    with services.database.read() as session:
        hashes = session.scalars(select(RecruiterIdentity.identifier_hash)).all()
    assert len(set(hashes)) == 2
    assert all(len(value) == 64 for value in hashes)


@on_sqlite
def test_the_ledger_goes_along_so_that_a_new_machine_erases_again(
    services: Services, experimenter: Admin, people: list[Participant], tmp_path: Path
) -> None:
    older = tmp_path / "b" / "older.tar"
    older.parent.mkdir()
    back_up(services.database, services.settings, services.clips, older, with_clips=False)
    run = people[0].run_id
    experimenter.send("POST", f"/studies/short/runs/{run}/erase", {"confirm": run})
    back_up(
        services.database, services.settings, services.clips, tmp_path / "b" / "newer.tar", with_clips=False
    )
    again, lines = restored(older, f"sqlite:///{tmp_path / 'x.sqlite'}", tmp_path / "new")
    assert any(line.startswith("1 run erased again") for line in lines)
    with again.database.read() as session:
        erased = session.scalars(select(StudyRun.public_id).where(StudyRun.erased_at.is_not(None))).all()
    assert erased == [run]
    again.database.close()
    # An installation that lost its ledger does not take it from the backups.
    ledger_path(services.settings).unlink()
    back_up(
        services.database, services.settings, services.clips, tmp_path / "b" / "newest.tar", with_clips=False
    )
    assert run in (tmp_path / "b" / LEDGER_NAME).read_text()


def test_ledgers_are_merged_line_by_line() -> None:
    assert merge_ledgers(b'{"run": "a"}\n{"run": "cut', b'{"run": "b"}\n{"run": "a"}\n') == (
        b'{"run": "a"}\n{"run": "cut\n{"run": "b"}\n'
    )
    assert merge_ledgers(b"", b"") == b""
