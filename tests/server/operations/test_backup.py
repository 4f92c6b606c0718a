"""Copies and backups lose nothing, and refuse whatever would mix two installations."""

import io
import json
import stat
import tarfile
from pathlib import Path

import pytest
from sqlalchemy import text

from experiments.errors import InputError
from server.context import Services, open_services
from server.core.db import Database
from server.core.settings import Settings
from server.operations.backup import back_up
from server.operations.copying import copy_database
from server.operations.restore import restore
from server.privacy.rows import Content, content_of, snapshot, tables_of
from tests.helpers.databases import BACKENDS
from tests.helpers.studies import Participant

onto_both = pytest.mark.parametrize("empty_database_url", BACKENDS, indirect=True)
from_sqlite = pytest.mark.parametrize("database_url", ["sqlite"], indirect=True)


@pytest.fixture
def with_data(services: Services, participant: Participant) -> Services:
    """A study that one person has finished rating and another has begun; words of many kinds."""
    participant.agree()
    participant.request("PUT", "/forms/about", {"answers": {"age": 30, "glasses": ["lenses"]}})
    participant.rate_all()
    other = Participant(participant.client, participant.link)
    other.agree()
    trial = other.state()["trials"][0]
    assert other.rate(trial, comment='Ünïcode, "quotes"\nand a line 🙂').status_code == 201
    return services


def contents(url: str) -> dict[str, Content]:
    database = Database(Settings(database_url=url).resolved_database_url)
    with snapshot(database) as connection:
        found = {table.name: content_of(connection, table) for table in tables_of(connection)}
    database.close()
    return found


def another(settings: Settings, url: str, folder: Path, key: str = "") -> Services:
    values = settings.model_dump() | {"database_url": url, "data_folder": folder, "secret_key": key}
    return open_services(Settings(**values))


@onto_both
def test_a_copy_holds_every_row_and_goes_on_counting(
    with_data: Services, settings: Settings, empty_database_url: str
) -> None:
    source = settings.database_url
    copied = copy_database(source, empty_database_url)
    assert copied == contents(source) == contents(empty_database_url)
    assert copied["trial_ratings"].rows == 13
    target = Database(Settings(database_url=empty_database_url).database_url)
    with target.write_connection() as connection:
        # The next id is a new one, on PostgreSQL too.
        connection.execute(
            text(
                "INSERT INTO audit_entries (at, actor, action, target_kind, target, details) "
                "VALUES ('2026-01-01 00:00:00', 'a', 'b', 'c', 'd', '{}')"
            )
        )
        views = connection.execute(text("SELECT count(*) FROM ratings")).scalar()
    target.close()
    assert views == 13


@from_sqlite
@pytest.mark.parametrize("empty_database_url", ["sqlite"], indirect=True)
def test_what_cannot_be_copied(
    with_data: Services, settings: Settings, empty_database_url: str, tmp_path: Path
) -> None:
    with pytest.raises(InputError, match="same database"):
        copy_database(settings.database_url, settings.database_url)
    with pytest.raises(InputError, match=r"revision None, expected .*server database upgrade"):
        copy_database(empty_database_url, f"sqlite:///{tmp_path}/x.sqlite")
    with pytest.raises(InputError, match="cannot open"):
        copy_database(f"sqlite:///{tmp_path}/nowhere/x.sqlite", empty_database_url)
    with pytest.raises(InputError, match="expected a URL"):
        copy_database("what is this", empty_database_url)
    copy_database(settings.database_url, empty_database_url)
    with pytest.raises(InputError, match="already contains rows"):
        copy_database(settings.database_url, empty_database_url)


@onto_both
def test_a_backup_comes_back_whole_on_either_database(
    with_data: Services, settings: Settings, empty_database_url: str, tmp_path: Path
) -> None:
    path = tmp_path / "b.tar"
    described = back_up(with_data.database, with_data.settings, with_data.clips, path)
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert [entry.name for entry in tmp_path.glob("*.tar*")] == ["b.tar"]
    target = another(settings, empty_database_url, tmp_path / "new")
    restore(target.database, target.settings, target.clips, path, despite_erasures=True)
    assert contents(empty_database_url) == contents(settings.database_url)
    for sha256 in described.clips:
        assert target.clips.size(sha256) == with_data.clips.size(sha256) is not None
    assert target.settings.key == settings.key
    assert stat.S_IMODE((tmp_path / "new" / "secret_key").stat().st_mode) == 0o600
    with pytest.raises(InputError, match=r"already contains rows .*set PALPEBRA_DATA_FOLDER to a new folder"):
        restore(target.database, target.settings, target.clips, path, despite_erasures=True)
    target.database.close()


@from_sqlite
@pytest.mark.parametrize("empty_database_url", ["sqlite"], indirect=True)
class TestRefusals:
    def test_another_secret_key(
        self, with_data: Services, settings: Settings, empty_database_url: str, tmp_path: Path
    ) -> None:
        back_up(with_data.database, with_data.settings, with_data.clips, tmp_path / "b.tar", with_clips=False)
        target = another(settings, empty_database_url, tmp_path / "new", key="another key")
        with pytest.raises(InputError, match=r"different secret key than the backup.* remove /"):
            restore(target.database, target.settings, target.clips, tmp_path / "b.tar", despite_erasures=True)
        target.database.close()

    def test_a_damaged_file_restores_nothing(
        self, with_data: Services, settings: Settings, empty_database_url: str, tmp_path: Path
    ) -> None:
        whole, changed = tmp_path / "b.tar", tmp_path / "c.tar"
        back_up(with_data.database, with_data.settings, with_data.clips, whole)
        with tarfile.open(whole) as source, tarfile.open(changed, "w") as target_tar:
            for entry in source:
                content = source.extractfile(entry).read()  # type: ignore[union-attr]
                if entry.name == "backup.json":
                    described = json.loads(content)
                    described["tables"]["trial_ratings"]["sha256"] = "0" * 64
                    content = json.dumps(described).encode()
                entry.size = len(content)
                target_tar.addfile(entry, io.BytesIO(content))
        target = another(settings, empty_database_url, tmp_path / "new")
        with pytest.raises(InputError, match="the backup is damaged, nothing was restored"):
            restore(target.database, target.settings, target.clips, changed, despite_erasures=True)
        cut = tmp_path / "cut.tar"
        cut.write_bytes(whole.read_bytes()[: whole.stat().st_size // 3])
        with pytest.raises(InputError):
            restore(target.database, target.settings, target.clips, cut, despite_erasures=True)
        (tmp_path / "text.tar").write_text("hello")
        with pytest.raises(InputError, match=r"no backup of `server backup`; choose a file that it wrote$"):
            restore(
                target.database, target.settings, target.clips, tmp_path / "text.tar", despite_erasures=True
            )
        with pytest.raises(InputError, match="cannot be read"):
            restore(
                target.database,
                target.settings,
                target.clips,
                tmp_path / "nothing.tar",
                despite_erasures=True,
            )
        assert contents(empty_database_url) == {}
        assert not (tmp_path / "new" / "secret_key").exists()
        target.database.close()

    @pytest.mark.parametrize(("path", "keys"), [("file/b.tar", None), ("b.tar", "file/keys.json")])
    def test_a_file_where_the_folder_should_be(
        self, services: Services, empty_database_url: str, path: str, keys: str | None, tmp_path: Path
    ) -> None:
        (tmp_path / "file").write_text("")
        with pytest.raises(InputError, match=r"file: expected a folder, but .*file is a file$"):
            back_up(
                services.database,
                services.settings,
                services.clips,
                tmp_path / path,
                keys=tmp_path / keys if keys else None,
            )
        assert not (tmp_path / "b.tar").exists(), "no backup without its keys"

    def test_folders_that_are_missing_are_created(
        self, services: Services, empty_database_url: str, tmp_path: Path
    ) -> None:
        target, keys = tmp_path / "new" / "b.tar", tmp_path / "safe" / "keys.json"
        back_up(services.database, services.settings, services.clips, target, keys=keys)
        assert target.is_file()
        assert keys.is_file()

    @pytest.mark.parametrize(
        ("path", "keys"), [("b.tar", "b.tar"), ("erasures.ndjson", None), ("b.tar", "erasures.ndjson")]
    )
    def test_one_file_in_anothers_place(
        self, services: Services, empty_database_url: str, path: str, keys: str | None, tmp_path: Path
    ) -> None:
        """Backup, key file and the separate copy of the ledger of erasures are three files."""
        with pytest.raises(InputError, match="already used in this call"):
            back_up(
                services.database,
                services.settings,
                services.clips,
                tmp_path / path,
                keys=tmp_path / keys if keys else None,
            )
        assert not (tmp_path / path).exists()
