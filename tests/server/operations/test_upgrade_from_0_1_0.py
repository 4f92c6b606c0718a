"""What version 0.1.0 (commit c84c2e8) stored and exported, under the program of today."""

import csv
import io
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from sqlalchemy import text
from sqlalchemy.exc import DBAPIError

from server.accounts.identity import OPERATOR
from server.context import Services, open_services
from server.core import migrate
from server.core.migrate import current_revision, downgrade, newest_revision, upgrade
from server.core.settings import Settings
from server.exports.formats import FORMATS
from server.exports.schemas import Extract
from server.studies.lookup import find_study
from tests.helpers.databases import BACKENDS
from tests.helpers.older_databases import (
    SECRET_KEY,
    STUDIES,
    load_older_database,
    older_ratings_csv,
)

both = pytest.mark.parametrize("empty_database_url", BACKENDS, indirect=True)


@pytest.fixture
def migrated(empty_database_url: str, tmp_path: Path) -> Iterator[Services]:
    """The older database, brought to the newest revision."""
    load_older_database(empty_database_url).close()
    settings = Settings(
        database_url=empty_database_url,
        data_folder=tmp_path / "data",
        frontend_folder=tmp_path / "pages",
        secret_key=SECRET_KEY,
    )
    services = open_services(settings)
    assert current_revision(services.database) == "0001"
    upgrade(services.database)
    assert current_revision(services.database) == newest_revision()
    yield services
    services.database.close()


def exported(services: Services, study: str) -> bytes:
    """The answers in the order of columns that exports had until 0.2, as `--old-order` gives it."""
    extract = Extract("all", old_order=True)
    with services.database.read() as session:
        return b"".join(FORMATS["csv"](session, find_study(session, study, OPERATOR, "view"), extract))


def older_columns_of(content: bytes, header: list[str]) -> bytes:
    """A CSV cut down to these columns, which must be its first ones."""
    rows = list(csv.reader(io.StringIO(content.decode(), newline="")))
    assert rows[0][: len(header)] == header
    stream = io.StringIO()
    csv.writer(stream, lineterminator="\n").writerows(row[: len(header)] for row in rows)
    return stream.getvalue().encode()


@both
@pytest.mark.parametrize("study", STUDIES)
def test_the_ratings_csv_has_the_same_bytes(migrated: Services, study: str) -> None:
    older = older_ratings_csv(study)
    header = older.split(b"\n", 1)[0].decode().split(",")
    found, pseudonyms = raw_names(older_columns_of(exported(migrated, study), header), older)
    assert found == older
    for raw, names in pseudonyms.items():
        assert len(names) == 1, f"{raw} has several pseudonyms"
    assert len(set().union(*pseudonyms.values())) == len(pseudonyms)


def raw_names(exported: bytes, older: bytes) -> tuple[bytes, dict[str, set[str]]]:
    """The export with the raw names of before put back, and the pseudonyms of each; runs' own ids stay."""
    tables = [list(csv.reader(io.StringIO(one.decode(), newline=""))) for one in (exported, older)]
    place, run = tables[0][0].index("participant"), tables[0][0].index("run")
    pseudonyms: dict[str, set[str]] = {}
    for row, before in zip(*tables, strict=True):
        if row[place] != before[place]:
            assert re.fullmatch("p[0-9a-f]{12}", row[place])
            assert before[place] != before[run]
            pseudonyms.setdefault(before[place], set()).add(row[place])
            row[place] = before[place]
    stream = io.StringIO()
    csv.writer(stream, lineterminator="\n").writerows(tables[0])
    return stream.getvalue().encode(), pseudonyms


@both
def test_old_runs_get_their_origin_and_old_versions_their_series(migrated: Services) -> None:
    with migrated.database.read() as session:
        query = text("SELECT id, origin FROM study_runs WHERE study_id = 1 ORDER BY id")
        origins = dict(tuple(row) for row in session.execute(query))
        versions = text("SELECT number, series FROM study_versions WHERE study_id = 1 ORDER BY number")
        assert [tuple(row) for row in session.execute(versions)] == [(1, 1), (2, 1), (3, 2)]
    people = {3, 4, 8, 9, 10, 12, 13}
    assert origins == dict.fromkeys(people, "participant") | {
        1: "pilot",
        2: "simulated",
        5: "simulated",
        6: "simulated",
        7: "preview",
        11: "simulated",
    }


@both
def test_the_origin_of_a_run_cannot_be_changed(migrated: Services) -> None:
    change = text("UPDATE study_runs SET origin = 'participant' WHERE id = 5")
    refused = pytest.raises(DBAPIError, match="the origin of a run does not change")
    with refused, migrated.database.write() as session:
        session.execute(change)
    with migrated.database.write() as session:
        session.execute(text("UPDATE study_runs SET origin = 'simulated', slot = 3 WHERE id = 5"))


@both
def test_down_to_the_older_revision_and_up_again_keeps_every_row(migrated: Services) -> None:
    before = exported(migrated, "short")
    downgrade(migrated.database, "0001")
    with migrated.database.read() as session:
        query = text("SELECT count(*) FROM study_runs WHERE synthetic OR preview")
        assert session.scalar(query) == 5
    upgrade(migrated.database)
    assert exported(migrated, "short") == before


@both
def test_upgrade_that_ends_half_way_leaves_the_older_database(
    empty_database_url: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    older = load_older_database(empty_database_url)
    tables = ("studies", "study_versions", "ratings")

    def rows() -> list[int]:
        with older.engine.connect() as connection:
            return [connection.execute(text(f"SELECT count(*) FROM {name}")).scalar_one() for name in tables]

    before = rows()

    def stop(*_: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr(migrate, "make_views", stop)  # the last step: all migrations have run by then
        with pytest.raises(KeyboardInterrupt):
            upgrade(older)
    assert current_revision(older) == "0001"
    assert rows() == before
    upgrade(older)
    assert current_revision(older) == newest_revision()
    older.close()
