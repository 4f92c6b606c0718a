"""The ways out of a run, and what a participant sees on the way."""

from pathlib import Path

import pytest
from playwright.sync_api import Page, Route

from tests.browser.server_process import ServerProcess
from tests.browser.studies import PLAIN
from tests.browser.visit import Visit, axe_violations

pytestmark = pytest.mark.browser


def test_who_does_not_agree_ends_with_nothing_stored(
    server: ServerProcess, tmp_path: Path, page: Page
) -> None:
    study = server.add_study(tmp_path / "clips", PLAIN)
    server.start()
    visit = Visit(page, server.address).open(study.link_token)
    page.click(".primary")
    page.wait_for_selector(".page > .tick")
    assert axe_violations(page) == []
    page.click("text=I do not agree")
    page.wait_for_selector("text=You are not taking part")
    [run] = server.rows("SELECT status, consented_at FROM study_runs")
    assert (run["status"], run["consented_at"]) == ("withdrawn", None)
    assert visit.problems == []


def test_a_long_address_breaks_instead_of_widening_the_page(
    server: ServerProcess, tmp_path: Path, page: Page
) -> None:
    address = "https://example.org/" + "a" * 90
    consent = PLAIN.replace("consent = '''\n", f"consent = '''\nWrite to {address}\n\n")
    study = server.add_study(tmp_path / "clips", consent)
    server.start()
    page.set_viewport_size({"width": 390, "height": 780})
    Visit(page, server.address).open(study.link_token)
    page.click(".primary")
    page.wait_for_selector(f"text={address}")
    assert page.evaluate("document.scrollingElement.scrollWidth - window.innerWidth") == 0


def test_the_focus_stays_on_the_button_while_consent_and_form_are_saved(
    server: ServerProcess, tmp_path: Path, page: Page
) -> None:
    study = server.add_study(tmp_path / "clips", PLAIN)
    server.start()
    Visit(page, server.address).open(study.link_token)
    page.click(".primary")
    page.check("input[type=checkbox]")
    press_while_it_is_held_up(page, "**/api/run/consent")
    page.wait_for_selector("form")
    page.fill("input.short", "34")
    page.check("input[value=normal]")
    press_while_it_is_held_up(page, "**/api/run/forms/*")
    page.wait_for_selector(".prose h1, .prose h2")
    forms = server.rows("SELECT 1 FROM form_answers")
    assert len(forms) == 1


def press_while_it_is_held_up(page: Page, address: str) -> None:
    """Go on by key, twice, while what is sent is held up; the focus must stay."""
    held: list[Route] = []
    page.route(address, lambda route: held.append(route), times=1)
    page.focus(".primary")
    page.keyboard.press("Enter")
    page.keyboard.press("Enter")
    page.wait_for_selector(".status:has-text('Saving')")
    assert page.evaluate("document.activeElement.matches('.primary')")
    held[0].continue_()


def test_a_fault_goes_when_fixed_and_stop_is_on_every_trial_screen(
    server: ServerProcess, tmp_path: Path, page: Page
) -> None:
    text = 'participant_title = { en = "A study of blinks" }\nlanguages'
    study = server.add_study(tmp_path / "clips", PLAIN.replace("languages", text, 1), frames=60)
    server.start()
    visit = Visit(page, server.address).open(study.link_token)
    assert (page.title(), page.inner_text("h1")) == ("A study of blinks", "A study of blinks")
    page.click(".primary")
    page.check("input[type=checkbox]")
    page.click(".primary")
    page.wait_for_selector("form")
    page.click(".primary")
    assert len(page.query_selector_all(".fault:not(:empty)")) == 2
    page.fill("input.short", "34")
    assert len(page.query_selector_all(".fault:not(:empty)")) == 1
    page.check("input[value=normal]")
    assert page.query_selector_all(".fault:not(:empty), .alert:not(:empty)") == []
    page.click(".primary")
    visit.instructions().practice()
    page.wait_for_selector(".ready")
    assert page.is_visible("text=Stop")
    page.keyboard.press(" ")
    page.wait_for_selector(".trial.playing")
    assert not page.is_visible("text=Stop")
    page.wait_for_selector(".scale")
    page.click("text=Stop")
    page.keyboard.press("3")
    page.click("text=Pause")
    page.wait_for_selector("text=See you later")
    assert server.rows("SELECT * FROM ratings WHERE kind = 'main'") == []
