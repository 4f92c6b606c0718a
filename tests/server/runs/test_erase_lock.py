"""Two who erase one run at once, on PostgreSQL, where rows are held (SQLite has one writer)."""

import threading
import time

import pytest
from fastapi.testclient import TestClient
from sqlalchemy import text

from server.accounts.identity import OPERATOR
from server.context import Services
from server.core.errors import Conflict
from server.models import AuditEntry
from server.privacy.erasures import erase
from server.privacy.ledger import erasures_in_ledger
from server.studies.lookup import find_study
from tests.helpers.studies import Participant, StudyInDatabase

pytestmark = [
    pytest.mark.postgres,
    pytest.mark.parametrize("database_url", ["postgres"], indirect=True),
]
WAITING = text(
    "SELECT count(*) FROM pg_stat_activity WHERE datname = current_database() "
    "AND wait_event_type = 'Lock' AND query ILIKE '%study_runs%FOR UPDATE%'"
)
PATIENCE_S = 60.0


def test_the_second_waits_for_the_first_and_erases_nothing_again(
    services: Services, client: TestClient, study: StudyInDatabase
) -> None:
    person = Participant(client, study.link_token).agree()
    person.rate_all()
    refusals: list[Conflict] = []

    def second() -> None:
        try:
            with services.database.write() as session:
                known = find_study(session, study.name, OPERATOR, "edit")
                erase(session, services.settings, known, person.run_id, person.run_id, OPERATOR)
        except Conflict as refusal:
            refusals.append(refusal)

    other = threading.Thread(target=second)
    with services.database.write() as session:
        known = find_study(session, study.name, OPERATOR, "edit")
        erase(session, services.settings, known, person.run_id, person.run_id, OPERATOR)
        other.start()
        assert waits(services), "the second one does not wait for the row"
        assert refusals == []
    other.join(PATIENCE_S)
    assert [refusal.message for refusal in refusals] == ["The data of this run were already erased."]
    assert erasures_in_ledger(services.settings) == [person.run_id]
    with services.database.read() as session:
        assert session.query(AuditEntry).filter(AuditEntry.action == "run erased").count() == 1


def waits(services: Services) -> bool:
    """True once a statement waits for the row of a run."""
    ends = time.monotonic() + PATIENCE_S
    while time.monotonic() < ends:
        with services.database.engine.connect() as connection:
            if connection.scalar(WAITING):
                return True
        time.sleep(0.02)
    return False
