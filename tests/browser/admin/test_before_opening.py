"""What the pages say before a study goes live, and of clips that nobody can see."""

import os
from pathlib import Path

import pytest
from fastapi.testclient import TestClient
from playwright.sync_api import Page, expect

from server.app import create_app
from server.cli_common import migrated_services
from server.models import Study
from tests.browser.admin.conftest import Dashboard
from tests.helpers.studies import SHORT, Participant, add_study
from tests.server.monitor.test_failing_clips import take_part

pytestmark = pytest.mark.browser
DRAFT = SHORT.replace('"Do you agree?"', '"# [Title]\\n\\nA study on [topic]. Responsible: [name]."')
DRAFT = DRAFT.replace('name = "short"', 'name = "unfilled"')
SCREENS = {"wide": (1440, 900), "narrow": (390, 844)}


def picture(page: Page, name: str) -> None:
    """Keep the page as pictures where a folder is given: for people to look at."""
    folder = os.environ.get("PALPEBRA_TEST_PICTURES")
    if folder is None:
        return
    before = page.viewport_size
    for screen, (width, height) in SCREENS.items():
        page.set_viewport_size({"width": width, "height": height})
        page.wait_for_timeout(300)
        page.screenshot(path=Path(folder) / f"{name}-{screen}.png")
    if before is not None:
        page.set_viewport_size(before)


@pytest.fixture(scope="module")
def failing(dashboard: Dashboard, tmp_path_factory: pytest.TempPathFactory) -> str:
    """The file of a clip that three people could not see; besides a draft whose consent is not filled in."""
    with migrated_services(dashboard.server.settings) as services:
        add_study(services, tmp_path_factory.mktemp("unfilled"), DRAFT, status="draft")
        study = add_study(services, tmp_path_factory.mktemp("broken"), SHORT, name="broken")
        with services.database.read() as session:
            version = session.query(Study).filter_by(name="broken").one().versions[0]
            clip, file = version.clips[0].clip_sha256, version.clips[0].file
    with TestClient(create_app(dashboard.server.settings)) as client:
        for _ in range(3):
            take_part(Participant(client, study.link_token), {clip})
    return file


def test_unfilled_placeholders_keep_the_study_from_going_live(dashboard: Dashboard, failing: str) -> None:
    page = dashboard.open("/studies/unfilled")
    page.get_by_role("button", name="Set live").click()
    dialog = page.get_by_role("dialog")
    expect(dialog.get_by_text("texts.en.consent")).to_contain_text("[Title], [topic], [name]")
    expect(dialog.get_by_role("button", name="Set live")).to_be_disabled()
    picture(page, "unfilled")
    dialog.get_by_role("button", name="Cancel").click()


def test_a_clip_that_nobody_can_see_is_named_on_every_page_of_its_study(
    dashboard: Dashboard, failing: str
) -> None:
    for path in ("", "/monitor"):
        page = dashboard.open(f"/studies/broken{path}")
        alarm = page.get_by_role("alert").filter(has_text="cannot be shown to participants")
        expect(alarm).to_contain_text(f"{failing}: not shown to 3 of 3 people")
        expect(alarm).to_contain_text("Decoding error")
        picture(page, f"failing{path.replace('/', '-')}")


def test_links_of_recruiters_are_offered_once_a_recruiter_is_set(dashboard: Dashboard, failing: str) -> None:
    page = dashboard.open("/studies/broken")
    page.get_by_role("button", name="Close").click()
    page.get_by_role("dialog").get_by_role("button", name="Close", exact=True).last.click()
    page.get_by_role("button", name="Set live").click()
    page.get_by_role("dialog").get_by_role("button", name="Set live").click()
    opened = page.get_by_role("dialog").filter(has_text="Participants can start")
    expect(opened).to_contain_text("first choose the service under")
    expect(opened).not_to_contain_text("PROLIFIC_PID")
    picture(page, "opened")
