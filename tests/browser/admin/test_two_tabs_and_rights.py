"""Work that is not saved, in several tabs and over a lost session, and pages whose right is missing."""

import re
from collections.abc import Iterator

import pytest
from playwright.sync_api import BrowserContext, Page, expect

from server.accounts import invitations
from server.cli_common import migrated_services
from server.models import AdminSession
from tests.browser.admin.conftest import Dashboard
from tests.browser.visit import axe_violations
from tests.helpers.admins import PASSWORD

pytestmark = pytest.mark.browser

DEBRIEF = "Debrief (Markdown)"
SAVE = "Save as a new version"


@pytest.fixture(autouse=True)
def nothing_kept(dashboard: Dashboard) -> None:
    """Each test begins with what is stored."""
    dashboard.open("/").evaluate("localStorage.clear(); sessionStorage.clear()")


def builder(page: Page, dashboard: Dashboard, section: str = "texts") -> Page:
    page.goto(f"{dashboard.server.address}/admin/studies/short/build?section={section}")
    page.get_by_role("button", name=SAVE).wait_for()
    return page


def typed(page: Page, words: str) -> None:
    page.get_by_label(DEBRIEF).fill(words)
    expect(page.get_by_text("Not saved; your work is in this browser.")).to_be_visible()


@pytest.fixture
def second(dashboard: Dashboard) -> Iterator[Page]:
    page = dashboard.page.context.new_page()
    yield page
    page.close()


def test_saving_in_one_tab_keeps_the_unsaved_work_of_the_other(dashboard: Dashboard, second: Page) -> None:
    first = builder(dashboard.page, dashboard)
    typed(first, "Words of the first tab.")
    builder(second, dashboard)
    typed(second, "Words of the second tab.")
    expect(second.get_by_role("button", name=SAVE)).to_be_enabled()
    second.get_by_role("button", name=SAVE).click()
    expect(second.get_by_text(re.compile(r"Saved as version \d+"))).to_be_visible()
    first.reload()
    expect(first.get_by_text("was restored")).to_be_visible()
    expect(first.get_by_label(DEBRIEF)).to_have_value("Words of the first tab.")
    expect(first.get_by_text("The study has changed since then")).to_be_visible()


def test_edits_of_two_tabs_are_both_kept(dashboard: Dashboard, second: Page) -> None:
    """The second to save gets the version of the first, with its own changes in it again."""
    first = builder(dashboard.page, dashboard)
    builder(second, dashboard, "study")
    typed(first, "Kept next to another edit.")
    second.get_by_role("textbox", name="Title", exact=True).fill("A title of the second tab")
    expect(second.get_by_role("button", name=SAVE)).to_be_enabled()
    second.get_by_role("button", name=SAVE).click()
    expect(second.get_by_text(re.compile(r"Saved as version \d+"))).to_be_visible()
    first.get_by_role("button", name=SAVE).click()
    met = first.get_by_role("alert").filter(has_text="was saved while you edited")
    expect(met).to_contain_text("“Title”: A title of the second tab")
    expect(met).not_to_contain_text("You both changed")
    expect(first.get_by_label(DEBRIEF)).to_have_value("Kept next to another edit.")
    first.get_by_role("button", name=SAVE).click()
    expect(first.get_by_text(re.compile(r"Saved as version \d+"))).to_be_visible()
    first.reload()
    expect(first.get_by_role("heading", level=1)).to_have_text("A title of the second tab")
    expect(first.get_by_label(DEBRIEF)).to_have_value("Kept next to another edit.")


def test_a_field_that_both_changed_is_chosen_by_the_second(dashboard: Dashboard, second: Page) -> None:
    first = builder(dashboard.page, dashboard)
    builder(second, dashboard)
    typed(first, "Words of the first.")
    typed(second, "Words of the second.")
    expect(second.get_by_role("button", name=SAVE)).to_be_enabled()
    second.get_by_role("button", name=SAVE).click()
    expect(second.get_by_text(re.compile(r"Saved as version \d+"))).to_be_visible()
    first.get_by_role("button", name=SAVE).click()
    field = first.get_by_role("group", name="The text “Debrief” in English (en)", exact=True)
    expect(field).to_contain_text("Words of the second.; yours: Words of the first.")
    expect(first.get_by_label(DEBRIEF)).to_have_value("Words of the first.")
    field.get_by_text(re.compile(r"^Version \d+$")).click()
    expect(first.get_by_label(DEBRIEF)).to_have_value("Words of the second.")
    field.get_by_text("Yours", exact=True).click()
    expect(first.get_by_label(DEBRIEF)).to_have_value("Words of the first.")
    assert axe_violations(first) == []


def test_discarding_in_one_tab_keeps_the_unsaved_work_of_the_other(
    dashboard: Dashboard, second: Page
) -> None:
    first = builder(dashboard.page, dashboard)
    typed(first, "To be kept.")
    builder(second, dashboard)
    typed(second, "To be given up.")
    second.get_by_role("button", name="Discard changes").click()
    expect(second.get_by_text(re.compile(r"Saved as version \d+"))).to_be_visible()
    first.reload()
    expect(first.get_by_label(DEBRIEF)).to_have_value("To be kept.")


def test_work_of_a_closed_tab_is_offered_and_opened_in_another(dashboard: Dashboard, second: Page) -> None:
    lost = dashboard.page.context.new_page()
    builder(lost, dashboard)
    typed(lost, "Left behind.")
    lost.close()
    builder(second, dashboard)
    expect(second.get_by_label(DEBRIEF)).not_to_have_value("Left behind.")
    second.get_by_role("button", name="Open it here").click()
    expect(second.get_by_label(DEBRIEF)).to_have_value("Left behind.")


def test_two_tabs_of_which_one_was_duplicated_keep_two_drafts(dashboard: Dashboard, second: Page) -> None:
    """A duplicated tab begins with a copy of the first one's session storage."""
    first = builder(dashboard.page, dashboard)
    copied = first.evaluate("JSON.stringify({ ...sessionStorage })")
    second.goto(f"{dashboard.server.address}/admin/sign-in")
    second.evaluate("(all) => Object.assign(sessionStorage, JSON.parse(all))", copied)
    builder(second, dashboard)
    typed(first, "Of the first.")
    typed(second, "Of the second.")
    for page, words in ((first, "Of the first."), (second, "Of the second.")):
        page.reload()
        expect(page.get_by_label(DEBRIEF)).to_have_value(words)


def end_sessions(dashboard: Dashboard) -> None:
    with (
        migrated_services(dashboard.server.settings) as services,
        services.database.write() as session,
    ):
        session.query(AdminSession).delete()


def test_what_was_typed_on_a_page_is_there_after_signing_in_again(dashboard: Dashboard) -> None:
    page = dashboard.open("/studies/short/settings?part=danger")
    field = page.get_by_label("Short name of the copy")
    field.fill("typed-before")
    end_sessions(dashboard)
    page.get_by_role("button", name=re.compile("^Copy")).click()
    dialog = page.get_by_role("dialog", name="Your session has expired")
    expect(dialog.get_by_label("Name")).to_have_value("ada")
    dialog.locator("input[autocomplete=current-password]").fill(PASSWORD)
    dialog.get_by_role("button", name="Sign in", exact=True).click()
    expect(dialog).to_be_hidden()
    expect(field).to_have_value("typed-before")


@pytest.fixture
def looking(dashboard: Dashboard) -> Iterator[BrowserContext]:
    """The browser of somebody who may view and export."""
    with migrated_services(dashboard.server.settings) as services:
        _, token = invitations.invite(services.database, "viewer", "", None)
    browser = dashboard.page.context.browser
    assert browser is not None
    context = browser.new_context(viewport={"width": 1280, "height": 800}, locale="en-GB")
    page = context.new_page()
    page.goto(f"{dashboard.server.address}/admin/invitation#{token}")
    page.get_by_label("User name").fill(f"Vera {token[:6]}")
    page.locator("input[autocomplete=new-password]").fill(PASSWORD)
    page.get_by_role("button", name="Create account").click()
    page.get_by_role("heading", name="Studies").wait_for()
    yield context
    context.close()


def test_the_start_page_says_why_an_account_comes_first_and_that_it_is_being_made(
    dashboard: Dashboard,
) -> None:
    with migrated_services(dashboard.server.settings) as services:
        _, token = invitations.invite(services.database, "owner", "", None)
    browser = dashboard.page.context.browser
    assert browser is not None
    context = browser.new_context(viewport={"width": 1280, "height": 800}, locale="en-GB")
    page = context.new_page()
    page.goto(f"{dashboard.server.address}/admin/start#invitation={token}")
    page.get_by_role("link", name="Create account and choose a table").click()
    expect(page.get_by_text("the next page takes your table")).to_be_visible()
    page.get_by_label("User name").fill("Theo")
    page.locator("input[autocomplete=new-password]").fill(PASSWORD)
    page.route("**/account", lambda route: page.wait_for_timeout(1_000) or route.continue_())
    page.get_by_role("button", name="Create account").click(no_wait_after=True)
    expect(page.get_by_text("Creating your account.")).to_be_visible()
    page.get_by_role("heading", name="Analyze a table").wait_for()
    context.close()


FORBIDDEN = {
    "/studies/short/build": "This page needs the right “edit”",
    "/studies/short/links": "This page needs the right “run”",
    "/studies/short/settings": "This page needs the right “run”",
    "/studies/new": "You cannot create studies yet",
    "/people": "This page is for owners of the server",
    "/backups": "This page is for owners of the server",
    "/audit": "This page is for owners of the server",
}
OPEN = ("", "/clips", "/rehearsal", "/monitor", "/results", "/data", "/participants")
CHANGING = re.compile(
    "^((Save|Make|Create|Delete|Add|Begin|Start|Set|Seal|Archive|Exclude|Erase|Withdraw|Build|Upload)\\b|Copy$)"
)


def test_a_viewer_finds_no_form_under_any_address(dashboard: Dashboard, looking: BrowserContext) -> None:
    """Pages whose right is missing say which; the others offer nothing that would be refused."""
    page = looking.pages[0]
    for path, sentence in FORBIDDEN.items():
        page.goto(f"{dashboard.server.address}/admin{path}")
        expect(page.get_by_text(sentence)).to_be_visible()
        expect(page.get_by_role("main").get_by_role("textbox")).to_have_count(0)
    for path in OPEN:
        page.goto(f"{dashboard.server.address}/admin/studies/short{path}")
        page.get_by_role("heading", level=1).wait_for()
        page.wait_for_load_state("networkidle")
        offered = [name for name in page.get_by_role("button").all_inner_texts() if CHANGING.match(name)]
        assert offered == [], path
