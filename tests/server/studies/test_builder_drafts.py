"""Unsaved work of the builder on the server, and who has the builder open."""

from datetime import timedelta
from typing import Any

from fastapi.testclient import TestClient
from sqlalchemy import select

from server.context import Services
from server.core.values import now
from server.models import AdminSession, BuilderDraft
from server.privacy.retention import DRAFTS_FOR, every_study
from server.studies.service import MAX_DRAFT_BYTES, MAX_DRAFTS, OPEN_FOR
from tests.helpers.admins import Admin, signed_in
from tests.helpers.studies import StudyInDatabase

WORK: dict[str, Any] = {
    "toml": "title = 'mine'",
    "data": None,
    "revision": 1,
    "base": "title = 'was'",
    "places": None,
}
DRAFTS = "/studies/short/drafts"


def test_drafts_are_kept_per_person_and_tab_and_editors_are_named(
    client: TestClient, services: Services, experimenter: Admin, study: StudyInDatabase
) -> None:
    other = signed_in(client, services, "owner", "bea")
    work = WORK
    assert experimenter.send("POST", "/studies/short/editors/tab-1").json() == []
    assert experimenter.send("PUT", "/studies/short/drafts/tab-1", work).status_code == 204
    assert experimenter.send("PUT", "/studies/short/drafts/tab-2", work | {"revision": 2}).status_code == 204
    assert [draft["tab"] for draft in experimenter.get("/studies/short/drafts").json()] == ["tab-2", "tab-1"]
    assert experimenter.get("/studies/short/drafts").json()[1]["work"] == work
    assert other.get("/studies/short/drafts").json() == []
    assert experimenter.send("POST", "/studies/short/editors/tab-1").json() == [
        {"name": experimenter.name, "own": True, "edits": True}
    ]
    assert other.send("POST", "/studies/short/editors/tab-9").json() == [
        {"name": experimenter.name, "own": False, "edits": True}
    ]
    assert experimenter.send("DELETE", "/studies/short/drafts/tab-2").status_code == 204
    assert experimenter.send("DELETE", "/studies/short/drafts/no-tab").status_code == 204
    assert [draft["tab"] for draft in experimenter.get("/studies/short/drafts").json()] == ["tab-1"]
    # Tabs that nothing was heard of for a while are not named; their drafts stay.
    with services.database.write() as session:
        for row in session.scalars(select(BuilderDraft)):
            row.seen_at = now() - OPEN_FOR - timedelta(seconds=1)
    assert other.send("POST", "/studies/short/editors/tab-9").json() == []
    assert [draft["tab"] for draft in experimenter.get("/studies/short/drafts").json()] == ["tab-1"]
    for number in range(MAX_DRAFTS + 2):
        experimenter.send("PUT", f"/studies/short/drafts/more-{number}", work)
    kept = {draft["tab"] for draft in experimenter.get("/studies/short/drafts").json()}
    assert kept == {f"more-{number}" for number in range(2, MAX_DRAFTS + 2)}
    viewer = signed_in(client, services, "viewer", "vera")
    assert viewer.send("PUT", "/studies/short/drafts/tab-1", work).status_code == 403


def test_a_draft_larger_than_a_megabyte_is_refused_with_its_size(
    experimenter: Admin, study: StudyInDatabase
) -> None:
    large = WORK | {"data": {"title": "x" * MAX_DRAFT_BYTES}}
    refused = experimenter.send("PUT", f"{DRAFTS}/tab-1", large)
    assert refused.status_code == 422
    assert "at most 1,000,000 bytes, got 1,000," in refused.json()["error"]["message"]
    assert experimenter.get(DRAFTS).json() == []


def test_drafts_that_nobody_changed_for_90_days_are_deleted(
    services: Services, experimenter: Admin, study: StudyInDatabase
) -> None:
    for tab in ("old", "young"):
        experimenter.send("PUT", f"{DRAFTS}/{tab}", WORK)
    with services.database.write() as session:
        for row in session.scalars(select(BuilderDraft)):
            hours = 1 if row.tab == "old" else -1
            row.saved_at = now() - DRAFTS_FOR - timedelta(hours=hours)
    every_study(services.database, services.settings, lambda: False)
    assert [draft["tab"] for draft in experimenter.get(DRAFTS).json()] == ["young"]


def test_an_open_page_of_the_builder_does_not_keep_a_session(
    services: Services, experimenter: Admin, study: StudyInDatabase
) -> None:
    before = now() - timedelta(minutes=30)
    with services.database.write() as session:
        session.scalars(select(AdminSession)).one().last_seen_at = before

    def last_seen() -> Any:
        with services.database.read() as session:
            return session.scalars(select(AdminSession)).one().last_seen_at

    assert experimenter.send("POST", "/studies/short/editors/tab-1").status_code == 200
    assert last_seen() == before
    assert experimenter.get(DRAFTS).status_code == 200
    assert last_seen() > before
