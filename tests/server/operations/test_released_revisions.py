"""Every released revision, with data in it: restored, migrated to the newest, one step down and up again."""

from pathlib import Path

import pytest

from server.context import open_services
from server.core.migrate import current_revision, downgrade, newest_revision, upgrade
from server.core.settings import Settings
from server.operations.restore import restore
from server.participation.identity_repository import readable_identities
from server.participation.tally_pools import Recount
from server.privacy.rows import Content, content_of, snapshot, tables_of
from tests.helpers.databases import BACKENDS
from tests.helpers.golden_backups import REVISIONS, golden_backup, golden_keys


def test_the_newest_revision_has_its_backup() -> None:
    assert newest_revision() in REVISIONS


@pytest.mark.parametrize("empty_database_url", BACKENDS, indirect=True)
@pytest.mark.parametrize("revision", REVISIONS)
def test_a_released_revision_is_migrated_with_its_rows(
    revision: str, empty_database_url: str, tmp_path: Path
) -> None:
    settings = Settings(database_url=empty_database_url, data_folder=tmp_path / "data")
    services = open_services(settings)
    keys = golden_keys(revision)
    described = restore(
        services.database,
        services.settings,
        services.clips,
        golden_backup(revision, tmp_path),
        keys=keys,
        despite_erasures=True,
    )
    assert described.revision == revision
    assert current_revision(services.database) == newest_revision()

    def contents() -> dict[str, Content]:
        with snapshot(services.database) as connection:
            return {table.name: content_of(connection, table) for table in tables_of(connection)}

    migrated = contents()
    if keys:
        assert migrated["identity_keys"].rows == migrated["recruiter_identities"].rows == 1
    assert migrated["trial_ratings"].rows == described.tables["trial_ratings"].rows == 13
    downgrade(services.database)
    upgrade(services.database)
    if len(REVISIONS) > 1:  # below the first revision there are no tables to keep rows in
        assert {name: found.rows for name, found in contents().items()} == {
            name: found.rows for name, found in migrated.items()
        }
    assert current_revision(services.database) == newest_revision()
    with services.database.read() as session:
        assert all(readable_identities(session))
        assert list(Recount(services.versions).differing(session)) == []
    services.database.close()
