"""The builder in a real browser: forms and text say the same, work is kept, edits are judged."""

import re
import tomllib

import pytest
from playwright.sync_api import Page, expect

from tests.browser.admin.conftest import Dashboard
from tests.helpers.admins import PASSWORD

pytestmark = pytest.mark.browser


@pytest.fixture(autouse=True)
def nothing_kept(dashboard: Dashboard) -> None:
    """Each test begins with what is stored."""
    dashboard.open("/").evaluate("localStorage.clear()")


def opened(dashboard: Dashboard, section: str) -> Page:
    page = dashboard.open(f"/studies/short/build?section={section}")
    page.get_by_role("button", name="Save as a new version").wait_for()
    return page


def text_of(page: Page) -> str:
    expect(page.get_by_text("Not saved; your work is in this browser.")).to_be_visible()
    return str(page.get_by_label("Definition", exact=True).input_value())


def test_a_form_changes_its_own_line_of_the_text(dashboard: Dashboard) -> None:
    page = opened(dashboard, "order")
    page.get_by_role("switch", name="Show TOML").click()
    before = page.get_by_label("Definition", exact=True).input_value()
    page.get_by_label("Trials", exact=True).fill("7")
    expect(page.get_by_label("Definition", exact=True)).to_have_value(re.compile(r"trials = 7"))
    changed = set(text_of(page).splitlines()) ^ set(before.splitlines())
    assert {line for line in changed if line} <= {
        "[practice]",
        "trials = 7",
        *(f"trials = {n}" for n in range(9)),
    }


def test_the_text_changes_the_forms(dashboard: Dashboard) -> None:
    page = opened(dashboard, "study")
    page.get_by_role("switch", name="Show TOML").click()
    editor = page.get_by_label("Definition", exact=True)
    editor.fill(f"# mine\n{editor.input_value()}".replace('title = "', 'title = "New: '))
    expect(page.get_by_role("textbox", name="Title", exact=True)).to_have_value(re.compile("^New: "))
    editor.fill("title = ")
    expect(page.get_by_text("This is not valid TOML")).to_be_visible()
    page.get_by_role("button", name="Undo").click()
    expect(page.get_by_role("textbox", name="Title", exact=True)).to_be_visible()


def test_a_scale_whose_points_are_all_labelled_is_drawn(dashboard: Dashboard) -> None:
    page = opened(dashboard, "trial")
    page.get_by_role("switch", name="Show TOML").click()
    editor = page.get_by_label("Definition", exact=True)
    text = re.sub(r"^(low|high|minimum|maximum|labels) = .*\n", "", editor.input_value(), flags=re.MULTILINE)
    labels = 'maximum = 2\nlabels = [{ en = "annoying" }, { en = "imperceptible" }]\n'
    editor.fill(text.replace("[trial.scale]\n", f"[trial.scale]\n{labels}"))
    preview = page.get_by_role("group", name="Preview of the trial")
    expect(preview.get_by_text("1 annoying")).to_be_visible()
    expect(preview.get_by_text("2 imperceptible")).to_be_visible()


def test_steps_are_undone_and_done_again(dashboard: Dashboard) -> None:
    page = opened(dashboard, "study")
    title = page.get_by_role("textbox", name="Title", exact=True)
    was = title.input_value()
    title.fill("Another title")
    page.get_by_role("button", name="Undo").click()
    expect(title).to_have_value(was)
    page.get_by_role("button", name="Redo").click()
    expect(title).to_have_value("Another title")


def test_work_is_kept_over_a_reload_and_a_lost_sign_in(dashboard: Dashboard) -> None:
    page = opened(dashboard, "texts")
    page.get_by_label("Debrief (Markdown)").fill("Kept words.")
    expect(page.get_by_text("Not saved; your work is in this browser.")).to_be_visible()
    page.get_by_role("tab", name="Clips").click()
    # A way back before the other tab is shown leaves the builder where it is: nothing is to be brought back.
    page.get_by_role("button", name="Save as a new version").wait_for(state="detached")
    page.get_by_role("tab", name="Build").click()
    expect(page.get_by_text("was restored")).to_be_visible()
    cookies = page.context.cookies()
    page.context.clear_cookies()
    page.goto(f"{dashboard.server.address}/admin/studies/short/build?section=texts")
    page.get_by_label("Name").fill("ada")
    page.locator("input[autocomplete=current-password]").fill(PASSWORD)
    page.get_by_role("button", name="Sign in").click()
    expect(page.get_by_text("was restored")).to_be_visible()
    assert page.context.cookies() != cookies
    opened(dashboard, "texts")
    expect(page.get_by_label("Debrief (Markdown)")).to_have_value("Kept words.")
    page.get_by_role("button", name="Discard it").click()
    expect(page.get_by_label("Debrief (Markdown)")).not_to_have_value("Kept words.")


def test_words_typed_as_the_sign_in_is_lost_are_kept(dashboard: Dashboard) -> None:
    page = opened(dashboard, "texts")
    cookies = page.context.cookies()
    page.context.clear_cookies()
    page.get_by_label("Debrief (Markdown)").fill("Typed without a session.")
    page.get_by_role("button", name="Sign in").wait_for()
    page.context.add_cookies(cookies)  # type: ignore[arg-type]
    opened(dashboard, "texts")
    expect(page.get_by_label("Debrief (Markdown)")).to_have_value("Typed without a session.")


def test_an_edit_that_changes_what_is_measured_is_said_before_it_is_saved(dashboard: Dashboard) -> None:
    page = opened(dashboard, "trial")
    page.get_by_label("Maximum", exact=True).first.fill("5")
    expect(page.get_by_text("Saving starts a new data series")).to_be_visible()
    expect(page.get_by_text("“Maximum” of “Scale” of “Trial”: 7 becomes 5")).to_be_visible()
    page.get_by_role("button", name="Discard changes").click()
    expect(page.get_by_text("Saving starts a new data series")).to_be_hidden()


def test_what_is_wrong_is_named_and_led_to(dashboard: Dashboard) -> None:
    page = opened(dashboard, "order")
    page.get_by_label("Repeats").fill("0")
    expect(page.get_by_role("button", name="Save as a new version")).to_be_disabled()
    page.get_by_role("link", name="Study", exact=True).click()
    page.get_by_role("link", name=re.compile("^“Repeats”")).click()
    expect(page.get_by_text("expected 1 or more, got 0").first).to_be_visible()


def test_a_form_of_the_bank_is_saved_as_a_new_version(dashboard: Dashboard) -> None:
    page = opened(dashboard, "forms")
    page.get_by_role("button", name="Add from the question bank").click()
    page.get_by_role("menuitem", name="Comments").click()
    save = page.get_by_role("button", name="Save as a new version")
    expect(save).to_be_enabled()
    save.click()
    expect(page.get_by_text("short, version 2")).to_be_visible()
    expect(page.get_by_text("Saved as version 2.")).to_be_visible()
    page.get_by_role("switch", name="Show TOML").click()
    said = tomllib.loads(str(page.get_by_label("Definition", exact=True).input_value()))
    assert said["forms"][-1]["name"] == "comments"
