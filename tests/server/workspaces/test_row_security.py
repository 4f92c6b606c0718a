"""The second wall: with the server's own checks taken out, PostgreSQL alone keeps laboratories apart."""

import uuid

import pytest
from fastapi import FastAPI
from sqlalchemy import Connection, select, text, true
from sqlalchemy.orm import Session

from experiments.errors import InputError
from server.accounts import workspace_repository
from server.context import Services
from server.core import row_security
from server.core import row_security as row_policies
from server.core.db import Database
from server.core.migrate import downgrade, newest_revision, upgrade
from server.core.repository import stored_revision
from server.models import RIGHTS, Base, Study
from tests.helpers.admins import Admin
from tests.helpers.older_databases import load_older_database
from tests.server.workspaces.test_isolation import (  # noqa: F401 - fixtures
    ADMIN,
    OWN,
    Laboratory,
    application,
    ask,
    endpoints,
    foreign,
    names_in,
    outsiders,
)

on_postgres = pytest.mark.parametrize(
    "database_url", [pytest.param("postgres", marks=pytest.mark.postgres)], indirect=True
)
empty_postgres = pytest.mark.parametrize(
    "empty_database_url", [pytest.param("postgres", marks=pytest.mark.postgres)], indirect=True
)
OF_EVERYBODY = ("accounts", "invitations", "workspaces", "audit", "backups", "tokens", "sessions", "session")
"""Addresses of objects that hang on no study: the server's own checks are their only wall."""


@pytest.fixture
def without_checks(monkeypatch: pytest.MonkeyPatch) -> None:
    """What asks whose a study is lets everybody do everything with every study."""

    def everything(_session: Session, studies: list[Study], _identity: object) -> dict[int, frozenset[str]]:
        return {study.id: frozenset(RIGHTS) for study in studies}

    monkeypatch.setattr(workspace_repository, "seen_by", lambda _identity: true())
    monkeypatch.setattr(workspace_repository, "rights_on", everything)


@on_postgres
@pytest.mark.parametrize("outsider", ["owner elsewhere", "nowhere", "administrator"])
def test_without_the_servers_own_checks_a_foreign_study_is_neither_read_nor_changed(
    application: FastAPI,  # noqa: F811
    services: Services,
    foreign: Laboratory,  # noqa: F811
    outsiders: dict[str, Admin],  # noqa: F811
    outsider: str,
    without_checks: None,
) -> None:
    known, before, asked = application.openapi()["components"]["schemas"], rows_of(services.database), 0
    for endpoint, about in endpoints(application):
        _, path = endpoint
        short = path.removeprefix(f"{ADMIN}/")
        if not names_in(path) or path.startswith(tuple(OWN)) or short.startswith(OF_EVERYBODY):
            continue
        answer = ask(outsiders[outsider], endpoint, about, foreign.addresses, known)
        assert answer.status_code in (403, 404), (endpoint, answer.text[:300])
        assert not [secret for secret in foreign.secrets if secret in answer.text], endpoint
        asked += 1
    assert asked > 40
    assert rows_of(services.database) == before


@pytest.mark.parametrize("outsider", ["owner elsewhere"])
def test_the_checks_that_are_taken_out_are_those_that_refuse(
    application: FastAPI,  # noqa: F811
    services: Services,
    foreign: Laboratory,  # noqa: F811
    outsiders: dict[str, Admin],  # noqa: F811
    outsider: str,
    without_checks: None,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(row_security, "act_for", lambda _account: None)
    monkeypatch.setattr("server.accounts.access.act_for", lambda _account: None)
    answer = outsiders[outsider].get(f"/studies/{foreign.study.name}")
    assert answer.status_code == 200, "the test above would pass for another reason"


def rows_of(database: Database) -> dict[str, list[tuple[object, ...]]]:
    """Every row of the tables that hang on studies, as the owner of the tables sees them."""
    with database.engine.connect() as connection:
        return {
            name: sorted(
                tuple(map(str, row)) for row in connection.execute(select(Base.metadata.tables[name]))
            )
            for name in row_policies.tables_apart()
        }


@on_postgres
def test_ones_own_studies_and_those_granted_are_seen_and_nothing_else(
    services: Services,
    foreign: Laboratory,  # noqa: F811
    outsiders: dict[str, Admin],  # noqa: F811
) -> None:
    with services.database.engine.connect() as connection:
        accounts = dict(connection.execute(text("SELECT name, id FROM accounts")).all())
        assert seen(connection, accounts["owner elsewhere"]) == ["own"]
        assert seen(connection, accounts["the owner"]) == [foreign.study.name]
        assert seen(connection, accounts["nowhere"]) == []
        connection.execute(
            text(
                "INSERT INTO study_grants (study_id, account_id, granted, granted_at) "
                "SELECT id, :account, 'view', now() FROM studies WHERE name = :name"
            ),
            {"account": accounts["nowhere"], "name": foreign.study.name},
        )
        assert seen(connection, accounts["nowhere"]) == [foreign.study.name]
        assert seen(connection, accounts["nowhere"], "SELECT count(*) FROM study_runs") == [1]
        assert seen(connection, accounts["owner elsewhere"], "SELECT count(*) FROM study_runs") == [0]
        connection.rollback()


def seen(connection: Connection, account: int, query: str = "SELECT name FROM studies") -> list[object]:
    """What a member's transaction gets."""
    with connection.begin_nested() as inner:
        connection.exec_driver_sql(row_security._narrowing_statement(account))
        found = list(connection.scalars(text(query)))
        inner.rollback()
    return found


@on_postgres
def test_every_table_is_behind_the_wall_or_is_named_as_hanging_on_no_study(services: Services) -> None:
    with services.database.engine.connect() as connection:
        query = "SELECT relname FROM pg_class WHERE relrowsecurity AND relkind = 'r'"
        assert set(connection.scalars(text(query))) == set(row_policies.tables_apart())
        views = connection.scalars(
            text(
                "SELECT reloptions::text FROM pg_class "
                "WHERE relkind = 'v' AND relnamespace = 'public'::regnamespace"
            )
        ).all()
        assert views
        assert all(options == "{security_invoker=true}" for options in views)
    assert set(Base.metadata.tables) == set(row_policies.tables_apart()) | row_policies.NOT_OF_A_STUDY
    assert services.database.keeps_rows_apart


@empty_postgres
def test_the_wall_goes_with_the_newest_revision_and_comes_back_with_it(empty_database_url: str) -> None:
    database = load_older_database(empty_database_url)
    before = number_of_ratings(database)
    upgrade(database)
    assert (policies(database) > 10, number_of_ratings(database)) == (True, before)
    downgrade(database, "0001")
    assert (policies(database), number_of_ratings(database)) == (0, before)
    with database.engine.connect() as connection:
        left = "SELECT count(*) FROM information_schema.role_table_grants WHERE grantee = 'palpebra_member'"
        assert connection.scalar(text(left)) == 0
    assert upgrade(database) == ("0001", newest_revision())
    assert policies(database) > 10
    database.close()


@empty_postgres
def test_a_user_who_does_not_own_the_tables_gets_no_wall_and_a_line_that_says_why(
    empty_database_url: str, caplog: pytest.LogCaptureFixture
) -> None:
    database, user = Database(empty_database_url), f"other_{uuid.uuid4().hex[:8]}"
    upgrade(database)
    with database.engine.begin() as connection:
        row_policies.take_down_wall(connection)
        connection.exec_driver_sql(f"CREATE ROLE {user} LOGIN PASSWORD 'x'")
        connection.exec_driver_sql(f"GRANT palpebra_member TO {user}")
        connection.exec_driver_sql(f"GRANT ALL ON SCHEMA public TO {user} WITH GRANT OPTION")
        connection.exec_driver_sql(f"GRANT ALL ON ALL TABLES IN SCHEMA public TO {user} WITH GRANT OPTION")
        connection.exec_driver_sql(f"GRANT ALL ON ALL SEQUENCES IN SCHEMA public TO {user} WITH GRANT OPTION")
        connection.exec_driver_sql(f"SET LOCAL ROLE {user}")
        assert row_policies.raise_wall(connection) is False
        connection.exec_driver_sql("RESET ROLE")
    assert policies(database) == 0
    assert "must be owner of" in caplog.text
    assert "REASSIGN OWNED" in caplog.text
    with database.engine.begin() as connection:
        connection.exec_driver_sql(f"DROP OWNED BY {user}")
        connection.exec_driver_sql(f"DROP ROLE {user}")
    database.close()


@empty_postgres
def test_an_upgrade_that_cannot_put_the_wall_up_again_changes_nothing(empty_database_url: str) -> None:
    owner = Database(empty_database_url)
    with owner.engine.begin() as connection:
        connection.exec_driver_sql("CREATE ROLE former_user LOGIN PASSWORD 'former'")
        connection.exec_driver_sql("GRANT ALL ON SCHEMA public TO former_user")
        assert row_policies._role_is_ours(connection)  # made, where this is the first test of the server
        connection.exec_driver_sql(f"GRANT {row_security.ROLE} TO former_user")
    former = Database(
        owner.url.set(username="former_user", password="former").render_as_string(hide_password=False)
    )
    try:
        upgrade(former)
        with owner.engine.begin() as connection:
            connection.exec_driver_sql("DROP TABLE shared_counts, builder_drafts")
            connection.exec_driver_sql("DROP INDEX ix_assigned_trials_not_main")
            connection.exec_driver_sql("ALTER TABLE study_runs DROP COLUMN recruiter")
            connection.exec_driver_sql("UPDATE alembic_version SET version_num = '0030'")
            # What this user may take down it may not put up again.
            connection.exec_driver_sql("REVOKE USAGE ON LANGUAGE sql FROM PUBLIC")
        before = policies(former)
        with pytest.raises(InputError, match="earlier version: permission denied for language"):
            upgrade(former)
        assert (policies(former), before > 10) == (before, True)
        with former.engine.connect() as connection:
            assert stored_revision(connection) == "0030"
    finally:
        former.close()
        with owner.engine.begin() as connection:
            connection.exec_driver_sql("DROP OWNED BY former_user")
            connection.exec_driver_sql(f"REVOKE {row_security.ROLE} FROM former_user")
            connection.exec_driver_sql("DROP ROLE former_user")
        owner.close()


def number_of_ratings(database: Database) -> int:
    with database.engine.connect() as connection:
        table = (
            "trial_ratings" if database.engine.dialect.has_table(connection, "trial_ratings") else "ratings"
        )
        return int(connection.scalar(text(f"SELECT count(*) FROM {table}")) or 0)


def policies(database: Database) -> int:
    with database.engine.connect() as connection:
        return int(connection.scalar(text("SELECT count(*) FROM pg_policies")) or 0)


@empty_postgres
def test_a_database_user_who_may_make_no_role_goes_without_and_gets_a_message(
    empty_database_url: str,
) -> None:
    owner = Database(empty_database_url)
    with owner.engine.begin() as connection:
        connection.exec_driver_sql("CREATE ROLE plain_user LOGIN PASSWORD 'plain'")
        connection.exec_driver_sql("GRANT ALL ON SCHEMA public TO plain_user")
    plain = Database(
        owner.url.set(username="plain_user", password="plain").render_as_string(hide_password=False)
    )
    try:
        upgrade(plain)
        assert (policies(plain), plain.keeps_rows_apart) == (0, False)
        with plain.read() as session:
            assert session.scalar(text("SELECT count(*) FROM studies")) == 0
        with owner.engine.begin() as connection:
            connection.exec_driver_sql(f"GRANT {row_security.ROLE} TO plain_user")
        upgrade(plain)
        del plain.keeps_rows_apart
        assert (policies(plain) > 10, plain.keeps_rows_apart) == (True, True)
    finally:
        plain.close()
        with owner.engine.begin() as connection:
            connection.exec_driver_sql("DROP OWNED BY plain_user")
            connection.exec_driver_sql(f"REVOKE {row_security.ROLE} FROM plain_user")
            connection.exec_driver_sql("DROP ROLE plain_user")
        owner.close()
