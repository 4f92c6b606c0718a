"""The ways out of a run, and what a participant is told on the way."""

from pathlib import Path

import pytest
from playwright.sync_api import Page

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


def test_a_fault_goes_when_mended_and_stop_stands_on_every_trial_screen(
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
