"""Space and Enter press a page's one button, also after presses of the mouse."""

from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from tests.browser.server_process import ServerProcess
from tests.browser.studies import PLAIN
from tests.browser.visit import Visit

pytestmark = pytest.mark.browser


def test_space_goes_on_after_presses_of_the_mouse(server: ServerProcess, tmp_path: Path, page: Page) -> None:
    study = server.add_study(tmp_path / "clips", PLAIN)
    server.start()
    visit = Visit(page, server.address).open(study.link_token).begin()
    page.wait_for_selector("text=Step 3 of 3")
    page.reload()
    page.wait_for_selector("text=Step 3 of 3")
    page.keyboard.press(" ")
    page.wait_for_selector("text=not part of the study")
    page.click(".primary")
    page.click(".below .primary")
    page.click(".key >> nth=4")
    page.wait_for_selector(".feedback")
    page.keyboard.press(" ")
    page.wait_for_selector("text=Practice is complete")
    page.keyboard.press(" ")
    visit.trials()
    expect(page.get_by_role("button", name="Start as another person")).to_be_visible()
    page.get_by_role("button", name="Start as another person").click()
    page.wait_for_selector("text=About")
    assert visit.problems == []


def test_feedback_says_nothing_of_the_reload_before_it(
    server: ServerProcess, tmp_path: Path, page: Page
) -> None:
    study = server.add_study(tmp_path / "clips", PLAIN)
    server.start()
    Visit(page, server.address).open(study.link_token).begin()

    def go_on(selector: str) -> None:
        while not page.query_selector(selector):
            page.wait_for_selector(f".primary, {selector}")
            page.keyboard.press("Enter")
            page.wait_for_timeout(300)

    go_on(".ready")
    page.click(".clip")
    page.wait_for_selector(".scale")
    page.reload()
    go_on(".scale")
    expect(page.get_by_text("already seen")).to_be_visible()
    page.keyboard.press("5")
    page.wait_for_selector(".feedback")
    expect(page.get_by_text("already seen")).to_have_count(0)
