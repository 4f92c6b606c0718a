"""The screens of motion checks and of warnings: by key and by touch, for everybody, on narrow screens too."""

import time
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page

from tests.browser.server_process import ServerProcess
from tests.browser.studies import PLAIN
from tests.browser.visit import Visit, axe_violations
from tests.helpers.motion_checks import CHECKS, checked

pytestmark = pytest.mark.browser

FEW = CHECKS.replace("per_block = 2", "per_block = 1").replace("clips = 12", "clips = 4")
CHECKED = checked(PLAIN, FEW.replace('"direction"', '"shape"'))
WARNED = PLAIN.replace("per_cell = 3", "per_cell = 8") + (
    '\n[warnings]\nmaximum = 1\nthen = "go_on"\n\n[[warnings.rules]]\nrule = "same_answer"\nanswers = 5\n'
)
NARROW = {"width": 390, "height": 844}


def to_the_check(visit: Visit, start: str = " ") -> None:
    """Through the trials up to the first check's question."""
    page = visit.page
    while True:
        page.wait_for_selector(".ready, .break")
        if page.query_selector(".break"):
            page.click(".primary")
            continue
        page.keyboard.press(start)
        page.wait_for_selector(".scale, .pair-answer")
        if page.query_selector(".pair-answer"):
            return
        before = page.query_selector(".scale")
        page.keyboard.press("4")
        assert before is not None
        before.wait_for_element_state("hidden")


def wide(page: Page) -> int:
    return int(page.evaluate("document.documentElement.scrollWidth - window.innerWidth"))


def stored_checks(server: ServerProcess, number: int) -> list[str]:
    """The answers to so many checks, as soon as the page has sent them."""
    checks: list[str] = []
    end = time.monotonic() + 20
    while len(checks) < number and time.monotonic() < end:
        time.sleep(0.1)
        answers = [row["payload"] for row in server.rows("SELECT payload FROM trial_ratings ORDER BY id")]
        checks = [one for one in answers if '"check"' in one]
    return checks


def begun(server: ServerProcess, page: Page, text: str, folder: Path) -> Visit:
    study = server.add_study(folder / "clips", text, frames=4)
    server.start()
    return Visit(page, server.address).open(study.link_token).begin().instructions().practice()


def test_a_check_is_answered_by_key_and_can_be_gone_around(
    server: ServerProcess, tmp_path: Path, page: Page
) -> None:
    visit = begun(server, page, CHECKED, tmp_path)
    to_the_check(visit)
    assert axe_violations(page) == []
    assert page.get_by_role("button", name="Stop").is_visible()
    question = page.wait_for_selector("h1.question")
    page.keyboard.press("2")
    assert question is not None
    question.wait_for_element_state("hidden")
    to_the_check(visit)
    page.set_viewport_size(NARROW)
    assert axe_violations(page) == []
    assert wide(page) <= 0
    page.screenshot(path=str(tmp_path / "check-390.png"))
    page.click("text=I cannot see moving patterns")
    left_out = page.wait_for_selector("text=This one is left out")
    assert left_out is not None
    assert page.get_by_role("button", name="Stop").is_visible()
    assert axe_violations(page) == []
    page.click(".primary")
    # A check may be the last trial of all: what comes next depends on the order.
    left_out.wait_for_element_state("hidden")
    checks = stored_checks(server, 2)
    assert '"check": 2' in checks[0]
    assert '"other_way": true' in checks[1]
    assert visit.problems == []


def test_a_check_is_answered_by_touch(server: ServerProcess, tmp_path: Path, chromium: Browser) -> None:
    context = chromium.new_context(viewport=NARROW, has_touch=True, is_mobile=True, locale="en-GB")
    page = context.new_page()
    visit = begun(server, page, CHECKED, tmp_path)
    to_the_check(visit)
    page.wait_for_timeout(400)  # a tap that follows the clip at once is not taken for an answer
    page.locator(".pair-answer").nth(2).tap()
    page.wait_for_selector(".pair-answer", state="detached")
    page.wait_for_selector(".ready, .break, .code, .scale")
    assert visit.problems == []
    context.close()
    answers = [row["payload"] for row in server.rows("SELECT payload FROM trial_ratings ORDER BY id")]
    assert any('"check": 3' in one for one in answers)


def test_a_warning_is_read_and_left_by_key(server: ServerProcess, tmp_path: Path, page: Page) -> None:
    visit = begun(server, page, WARNED, tmp_path)
    warning = "h1:has-text('A word in between')"
    while page.wait_for_selector(f".ready, {warning}") and not page.query_selector(warning):
        visit.rate("4")
    assert axe_violations(page) == []
    page.set_viewport_size(NARROW)
    assert axe_violations(page) == []
    assert wide(page) <= 0
    page.screenshot(path=str(tmp_path / "warning-390.png"))
    page.focus(".primary")
    page.keyboard.press("Enter")
    page.wait_for_selector(".ready, .break")
    shown = server.rows_soon("SELECT type FROM run_events WHERE type = 'warning_shown'", 1)
    assert len(shown) == 1
    assert visit.problems == []
