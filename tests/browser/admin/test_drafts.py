"""Unsaved work of the builder on the server: in another browser, next to other editors, with comments."""

import re
from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, Page, expect

from server.accounts import invitations
from server.cli_common import migrated_services
from tests.browser.admin.conftest import Dashboard
from tests.browser.visit import axe_violations
from tests.helpers.admins import PASSWORD

pytestmark = pytest.mark.browser
DEBRIEF = "Debrief (Markdown)"
SAVE = "Save as a new version"


def builder(page: Page, dashboard: Dashboard, section: str = "texts") -> Page:
    page.goto(f"{dashboard.server.address}/admin/studies/short/build?section={section}")
    page.get_by_role("button", name=SAVE).wait_for()
    return page


def version_saved(page: Page) -> None:
    save = page.get_by_role("button", name=SAVE)
    expect(save).to_be_enabled()
    save.click()
    expect(page.get_by_text(re.compile(r"Saved as version \d+"))).to_be_visible()


@pytest.fixture
def elsewhere(dashboard: Dashboard, chromium: Browser) -> Iterator[Page]:
    """The same person in another browser: the session is the same, nothing else is."""
    context = chromium.new_context(viewport={"width": 1280, "height": 800}, locale="en-GB")
    context.add_cookies(dashboard.page.context.cookies())  # type: ignore[arg-type]
    yield context.new_page()
    context.close()


def test_a_draft_is_offered_in_another_browser_with_its_difference(
    dashboard: Dashboard, elsewhere: Page
) -> None:
    page = builder(dashboard.page, dashboard)
    page.get_by_label(DEBRIEF).fill("Words from the laboratory.")
    expect(page.get_by_text("A draft is on the server, too.")).to_be_visible()
    builder(elsewhere, dashboard)
    expect(elsewhere.get_by_label(DEBRIEF)).not_to_have_value("Words from the laboratory.")
    expect(elsewhere.get_by_text("in another browser, is on the server.")).to_be_visible()
    elsewhere.get_by_text("Show what it changes (1 field)").click()
    expect(elsewhere.get_by_role("listitem")).to_contain_text(["becomes Words from the laboratory."])
    expect(elsewhere.get_by_text("you, in another tab or browser (unsaved changes)")).to_be_visible()
    assert axe_violations(elsewhere) == []
    elsewhere.get_by_role("button", name="Open the draft").click()
    expect(elsewhere.get_by_label(DEBRIEF)).to_have_value("Words from the laboratory.")
    expect(elsewhere.get_by_text("A draft is on the server, too.")).to_be_visible()
    elsewhere.reload()
    expect(elsewhere.get_by_label(DEBRIEF)).to_have_value("Words from the laboratory.")
    with elsewhere.expect_response(
        lambda answer: answer.request.method == "DELETE" and "/drafts/" in answer.url
    ):
        version_saved(elsewhere)
    drafts = f"{dashboard.server.address}/api/admin/studies/short/drafts"
    assert elsewhere.request.get(drafts).json() == []


def test_a_draft_is_discarded_on_the_server(dashboard: Dashboard, elsewhere: Page) -> None:
    page = builder(dashboard.page, dashboard)
    page.get_by_label(DEBRIEF).fill("To be given up.")
    expect(page.get_by_text("A draft is on the server, too.")).to_be_visible()
    builder(elsewhere, dashboard)
    elsewhere.get_by_role("button", name="Discard the draft").click()
    elsewhere.get_by_role("dialog").get_by_role("button", name="Discard", exact=True).click()
    expect(elsewhere.get_by_text("in another browser, is on the server.")).to_have_count(0)
    assert elsewhere.request.get(f"{dashboard.server.address}/api/admin/studies/short/drafts").json() == []
    page.get_by_role("button", name="Discard changes").click()


def test_the_page_says_who_else_is_editing(dashboard: Dashboard, chromium: Browser) -> None:
    with migrated_services(dashboard.server.settings) as services:
        _, token = invitations.invite(services.database, "owner", "", None)
    context = chromium.new_context(locale="en-GB")
    other = context.new_page()
    other.goto(f"{dashboard.server.address}/admin/invitation#{token}")
    other.get_by_label("User name").fill("bea")
    other.locator("input[autocomplete=new-password]").fill(PASSWORD)
    other.get_by_role("button", name="Create account").click()
    other.get_by_role("heading", name="Studies").wait_for()
    page = builder(dashboard.page, dashboard)
    page.get_by_label(DEBRIEF).fill("Being written.")
    expect(page.get_by_text("A draft is on the server, too.")).to_be_visible()
    builder(other, dashboard)
    expect(other.get_by_text("Also has this page open")).to_contain_text("ada (unsaved changes)")
    expect(other.get_by_text("in another browser, is on the server.")).to_have_count(0)  # drafts are private
    expect(page.get_by_text("Also has this page open")).to_contain_text("bea")
    context.close()
    page.get_by_role("button", name="Discard changes").click()


def test_comments_survive_edits_that_meet(dashboard: Dashboard) -> None:
    first = builder(dashboard.page, dashboard, "study")
    first.get_by_role("switch", name="Show TOML").click()
    editor = first.get_by_label("Definition", exact=True)
    editor.fill(f"# why this study exists\n{editor.input_value()}")
    expect(first.get_by_text("Not saved; your work is in this browser.")).to_be_visible()
    second = builder(first.context.new_page(), dashboard, "study")
    second.get_by_role("textbox", name="Title", exact=True).fill("A title of the second tab")
    version_saved(second)
    second.close()
    first.get_by_role("button", name=SAVE).click()
    expect(first.get_by_text("was saved while you edited")).to_be_visible()
    first.get_by_role("switch", name="Show TOML").click()
    merged = first.get_by_label("Definition", exact=True)
    expect(merged).to_have_value(re.compile("^# why this study exists\n"))
    expect(merged).to_have_value(re.compile("A title of the second tab"))
    expect(first.get_by_text("You both changed comments")).to_have_count(0)
    version_saved(first)
