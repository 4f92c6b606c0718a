"""The migration that encrypts recruiters' IDs: nothing stays in the open, and back goes all or nothing."""

from pathlib import Path

import pytest
from alembic.util import CommandError
from sqlalchemy import select, text

from server.context import Services, open_services
from server.core.migrate import current_revision, downgrade, newest_revision, upgrade
from server.core.settings import Settings
from server.models import StudyRun
from server.operations.restore import restore
from server.participation.identity_repository import known_as
from tests.helpers.golden_backups import golden_backup, golden_keys

BEFORE, SEALED = "0024", "0025"


@pytest.fixture
def golden(tmp_path: Path) -> Services:
    """A database with recruiters' IDs."""
    url = f"sqlite:///{tmp_path / 'x.sqlite'}"
    services = open_services(Settings(database_url=url, data_folder=tmp_path / "data"))
    restore(
        services.database,
        services.settings,
        services.clips,
        golden_backup(SEALED, tmp_path),
        keys=golden_keys(SEALED),
        despite_erasures=True,
    )
    return services


def ids(services: Services) -> list[str]:
    with services.database.read() as session:
        known = [known_as(session, run) for run in session.scalars(select(StudyRun).order_by(StudyRun.id))]
    return [person.identifier for person in known if person and person.identifier]


def file_of(services: Services) -> bytes:
    with services.database.engine.connect() as connection:
        connection.execute(text("PRAGMA wal_checkpoint(TRUNCATE)"))
    return Path(str(services.database.url.database)).read_bytes()


def test_no_id_stays_in_the_file(golden: Services) -> None:
    known = ids(golden)
    assert known
    downgrade(golden.database, BEFORE)
    with golden.database.write_connection() as connection:
        values = {"id": "an-id-that-is-nowhere-else"}
        connection.execute(text("UPDATE recruiter_identities SET identifier = :id"), values)
    assert values["id"].encode() in file_of(golden)
    upgrade(golden.database)
    assert set(ids(golden)) == {values["id"]}
    assert values["id"].encode() not in file_of(golden)
    golden.database.close()


def test_an_id_that_does_not_open_is_not_dropped(golden: Services) -> None:
    known = ids(golden)
    with golden.database.write_connection() as connection:
        kept = connection.execute(text("SELECT wrapped_key FROM identity_keys LIMIT 1")).scalar_one()
        wrong = text("UPDATE identity_keys SET wrapped_key = :wrong WHERE wrapped_key = :kept")
        connection.execute(wrong, {"wrong": "A" * 56, "kept": kept})
    with pytest.raises(CommandError, match="1 recruiters' IDs do not open with this secret key"):
        downgrade(golden.database, BEFORE)
    assert current_revision(golden.database) == newest_revision()
    with golden.database.write_connection() as connection:
        right = text("UPDATE identity_keys SET wrapped_key = :kept WHERE wrapped_key = :wrong")
        connection.execute(right, {"wrong": "A" * 56, "kept": kept})
    assert ids(golden) == known
    golden.database.close()
