"""The database's views are those of the code after every upgrade, with what others may do with them."""

import os
import subprocess
import sys
import uuid
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path

import pytest
from sqlalchemy import event, inspect, text

from experiments.columns.view import MADE_FROM
from experiments.errors import InputError
from experiments.kinds import views
from server.core.db import Database
from server.core.migrate import current_revision, downgrade, is_up_to_date, newest_revision, upgrade
from server.core.settings import Settings
from tests.conftest import REPOSITORY
from tests.helpers.databases import BACKENDS, run_server_command

both = pytest.mark.parametrize("empty_database_url", BACKENDS, indirect=True)
on_postgres = pytest.mark.parametrize("empty_database_url", BACKENDS[1:], indirect=True)
OLDER = "CREATE VIEW ratings AS SELECT name AS study FROM studies"


@pytest.fixture
def database(empty_database_url: str) -> Iterator[Database]:
    """A database of the newest revision."""
    opened = Database(empty_database_url)
    upgrade(opened)
    yield opened
    opened.close()


def run(database: Database, *statements: str) -> None:
    with database.write_engine.begin() as connection:
        for statement in statements:
            connection.exec_driver_sql(statement)


def columns(database: Database, view: str = "ratings") -> tuple[str, ...]:
    with database.engine.connect() as connection:
        return tuple(connection.execute(text(f"SELECT * FROM {view}")).keys())


@contextmanager
def written(database: Database) -> Iterator[list[str]]:
    """The statements that are run within."""
    found: list[str] = []

    def note(_connection: object, _cursor: object, statement: str, *_: object) -> None:
        found.append(statement)

    engines = {database.engine, database.write_engine}
    for engine in engines:
        event.listen(engine, "before_cursor_execute", note)
    yield found
    for engine in engines:
        event.remove(engine, "before_cursor_execute", note)


@both
@pytest.mark.parametrize(
    "changed", [("DROP VIEW ratings", OLDER), ("DROP VIEW ratings",)], ids=["old", "gone"]
)
def test_views_of_another_program_are_made_again_without_a_new_revision(
    database: Database, changed: tuple[str, ...]
) -> None:
    assert is_up_to_date(database)
    run(database, *changed)
    assert current_revision(database) == newest_revision()
    assert not is_up_to_date(database)
    upgrade(database)
    assert is_up_to_date(database)
    assert {view.name: columns(database, view.name) for view in views()} == {
        view.name: view.names for view in views()
    }


@both
def test_a_start_where_nothing_changed_writes_nothing_and_asks_little(database: Database) -> None:
    with written(database) as statements:
        assert upgrade(database) == (newest_revision(), newest_revision())
    words = {statement.split()[0] for statement in statements}
    assert words <= {"BEGIN", "SELECT", "PRAGMA", "SHOW", "select"}
    assert 0 < len(statements) < 20
    assert not [statement for statement in statements if "version_num =" in statement]


@both
def test_a_view_of_a_kind_that_is_gone_goes_and_one_of_somebody_else_stays(database: Database) -> None:
    made = "CREATE VIEW {} AS SELECT 1 AS one"
    gone = made.format("sketches").replace("SELECT", f"-- {MADE_FROM}\nSELECT")
    run(database, gone, made.format('"Mean by day"'))
    if not database.is_sqlite:
        run(database, f"COMMENT ON VIEW sketches IS '{MADE_FROM} (of then)'")
    assert not is_up_to_date(database)
    upgrade(database)
    assert is_up_to_date(database)
    found = set(inspect(database.engine).get_view_names())
    assert found == {"Mean by day", *(view.name for view in views())}


@both
def test_servers_that_start_together_make_the_views_once(database: Database, empty_database_url: str) -> None:
    run(database, "DROP VIEW ratings", OLDER)
    others = [Database(empty_database_url) for _ in range(6)]
    made: list[str] = []
    for one in others:
        event.listen(
            one.write_engine,
            "before_cursor_execute",
            lambda _connection, _cursor, statement, *_: made.append(statement),
        )
    with ThreadPoolExecutor(len(others)) as threads:
        assert set(threads.map(upgrade, others)) == {(newest_revision(), newest_revision())}
    assert sum(statement.startswith("CREATE VIEW ratings") for statement in made) == 1
    assert columns(database) == next(view.names for view in views() if view.name == "ratings")
    for one in others:
        one.close()


@both
def test_commands_bring_the_views_and_say_that_they_differ(
    database: Database, empty_database_url: str, tmp_path: Path
) -> None:
    settings = Settings(database_url=empty_database_url, data_folder=tmp_path / "data", secret_key="a key")
    upgraded, same = (
        "; run `server database upgrade`",
        f"found {newest_revision()}, expected {newest_revision()}",
    )
    assert run_server_command(settings, "database", "status").stdout.strip() == same
    run(database, "DROP VIEW traces")
    told = run_server_command(settings, "database", "status").stdout.strip()
    assert told == f"found {newest_revision()} and other views, expected {newest_revision()}{upgraded}"
    doctor = run_server_command(settings, "doctor").stdout
    assert "server database upgrade" in " ".join(doctor.split())
    assert run_server_command(settings, "database", "upgrade").returncode == 0
    assert run_server_command(settings, "database", "status").stdout.strip() == same
    assert "server database upgrade" not in " ".join(run_server_command(settings, "doctor").stdout.split())


@both
def test_a_way_down_leaves_no_views_and_up_again_they_are_there(database: Database) -> None:
    before = {view.name: columns(database, view.name) for view in views()}
    downgrade(database, "0005")
    assert inspect(database.engine).get_view_names() == []
    upgrade(database)
    assert {view.name: columns(database, view.name) for view in views()} == before


@both
def test_alembic_goes_down_to_no_program_that_would_miss_its_views(
    database: Database, empty_database_url: str
) -> None:
    called = subprocess.run(
        [sys.executable, "-m", "alembic", "downgrade", "0032"],
        cwd=REPOSITORY,
        env={**os.environ, "DATABASE_URL": empty_database_url},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert called.returncode != 0
    assert "restore an old backup with the old program" in called.stdout + called.stderr
    assert "Traceback" not in called.stderr
    assert is_up_to_date(database)


@contextmanager
def roles(database: Database, *names: str) -> Iterator[list[str]]:
    """Roles of these names, each made unlike those of other tests."""
    made = [f"{name}_{uuid.uuid4().hex[:8]}" for name in names]
    run(database, *(f"CREATE ROLE \"{one}\" LOGIN PASSWORD 'x'" for one in made))
    yield made
    run(database, *(f'DROP OWNED BY "{one}"; DROP ROLE "{one}"' for one in made))


def rights(database: Database) -> set[tuple[str, ...]]:
    """Every right on a view or its columns, with who has it."""
    query = (
        "SELECT relname, '', acl::text FROM pg_class, unnest(relacl) acl WHERE relkind = 'v' "
        "AND relnamespace = current_schema()::regnamespace "
        "UNION ALL SELECT relname, attname, acl::text "
        "FROM pg_class JOIN pg_attribute ON attrelid = pg_class.oid, unnest(attacl) acl "
        "WHERE relkind = 'v' AND relnamespace = current_schema()::regnamespace"
    )
    with database.engine.connect() as connection:
        return {tuple(row) for row in connection.exec_driver_sql(query)}


@on_postgres
def test_what_others_may_do_with_a_view_outlives_it(database: Database) -> None:
    with roles(database, "analyst", "Cö reader", "third") as (analyst, reader, third):
        run(
            database,
            f'GRANT SELECT ON ratings, comparisons TO "{analyst}" WITH GRANT OPTION',
            f'GRANT SELECT (study, rt), UPDATE (study) ON ratings TO "{reader}"',
            "GRANT SELECT ON thresholds TO PUBLIC",
            "ALTER VIEW traces SET (security_barrier = true)",
            # The user who makes a view gives it to the third role, from whom the owner took this one.
            f'ALTER DEFAULT PRIVILEGES GRANT SELECT ON TABLES TO "{third}"',
        )
        before, options = rights(database), options_of(database)
        assert sum(third in right[2] for right in before) == 0
        run(database, "COMMENT ON VIEW ratings IS 'of an older program'")
        assert not is_up_to_date(database)
        upgrade(database)
        assert is_up_to_date(database)
        assert (rights(database), options_of(database)) == (before, options)
        assert any("palpebra_member=r" in right[2] for right in before)
        assert "security_barrier=true" in options["traces"]
        assert all("security_invoker=true" in of_view for of_view in options.values())
        assert sum(analyst in right[2] for right in before) == 2
        assert sum("Cö reader" in right[2] for right in before) == 2
        run(database, f'ALTER DEFAULT PRIVILEGES REVOKE SELECT ON TABLES FROM "{third}"')


def options_of(database: Database) -> dict[str, list[str]]:
    query = (
        "SELECT relname, reloptions FROM pg_class WHERE relkind = 'v' "
        "AND relnamespace = current_schema()::regnamespace"
    )
    with database.engine.connect() as connection:
        return {name: sorted(options) for name, options in connection.exec_driver_sql(query)}


@on_postgres
def test_a_right_on_a_column_that_is_gone_goes_with_it(database: Database) -> None:
    with roles(database, "analyst") as (analyst,):
        run(
            database,
            "DROP VIEW ratings",
            "CREATE VIEW ratings AS SELECT name AS study, id AS formerly FROM studies",
            f'GRANT SELECT (study, formerly) ON ratings TO "{analyst}"',
        )
        upgrade(database)
        assert [right[:2] for right in rights(database) if analyst in right[2]] == [("ratings", "study")]


@on_postgres
def test_a_view_that_others_are_made_of_is_refused_in_one_line_and_nothing_is_changed(
    database: Database,
) -> None:
    run(
        database,
        "CREATE VIEW means AS SELECT study, avg(rt) AS rt FROM ratings GROUP BY study",
        "COMMENT ON VIEW ratings IS 'of an older program'",
    )
    before = rights(database)
    with pytest.raises(InputError, match="view means depends on view ratings") as raised:
        upgrade(database)
    assert "\n" not in str(raised.value)
    assert rights(database) == before
    assert columns(database, "means") == ("study", "rt")
    run(database, "DROP VIEW means")
    upgrade(database)
    assert is_up_to_date(database)


@on_postgres
def test_a_user_who_does_not_own_the_views_is_reported_in_one_line(database: Database) -> None:
    with roles(database, "app") as (app,):
        run(
            database,
            f'GRANT ALL ON SCHEMA public TO "{app}"',
            f'GRANT ALL ON ALL TABLES IN SCHEMA public TO "{app}"',
            "COMMENT ON VIEW ratings IS 'of an older program'",
        )
        address = database.url.set(username=app, password="x").render_as_string(hide_password=False)
        other = Database(address)
        with pytest.raises(
            InputError, match=r"must be owner of .*; make the user of DATABASE_URL the owner"
        ) as raised:
            upgrade(other)
        other.close()
        assert "\n" not in str(raised.value)
        upgrade(database)
        assert is_up_to_date(database)
