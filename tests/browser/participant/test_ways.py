"""Measured sizes and the ways in and out of a visit: room, another person, practice, a busy server."""

import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest
from playwright.sync_api import BrowserContext, Page, expect

from tests.browser.server_process import ServerProcess
from tests.browser.studies import ARABIC, PLAIN, STUDY
from tests.browser.visit import Visit, axe_violations, fit_card
from tests.helpers.studies import StudyInDatabase

pytestmark = pytest.mark.browser
LAST_SIGN_AFTER_FIRST = """() => {
  const text = document.querySelector('h1').firstChild;
  const left = (index) => {
    const range = document.createRange();
    range.setStart(text, index);
    range.setEnd(text, index + 1);
    return range.getBoundingClientRect().left;
  };
  return text.data.endsWith('?') && left(text.length - 1) > left(0);
}"""
MEASURED = (
    "SELECT px_per_mm, repeats, spread_percent, ruler_check, distance_method, distance_typed_mm, occasion "
    "FROM calibrations"
)


@pytest.fixture(scope="module")
def served(
    tmp_path_factory: pytest.TempPathFactory, built_page: Path
) -> Iterator[tuple[ServerProcess, dict[str, StudyInDatabase]]]:
    """One server with the studies of this module."""
    folder = tmp_path_factory.mktemp("ways")
    process = ServerProcess(folder / "data")
    declared = {"measured": STUDY, "plain": PLAIN, "arabic": ARABIC}
    studies = {
        name: process.add_study(folder / name, text.replace('"browser"', f'"{name}"', 1), 30)
        for name, text in declared.items()
    }
    process.start()
    yield process, studies
    process.stop()


Served = tuple[ServerProcess, dict[str, StudyInDatabase]]


def test_repeats_that_differ_are_followed_by_one_more_and_all_is_stored(served: Served, page: Page) -> None:
    server, studies = served
    visit = Visit(page, server.address).open(studies["measured"].link_token).begin()
    page.wait_for_selector(".hand")
    assert axe_violations(page) == []
    fit_card(page, 320, 360)
    page.wait_for_selector("text=The two sizes differ by 12%")
    assert axe_violations(page) == []
    page.fill(".card-area input", "358")
    page.click("text=It fits")
    page.click("text=Yes, within")
    page.click("text=Enter the distance")
    page.wait_for_selector("input.short")
    page.click(".primary")
    visit.instructions()
    row = server.rows_soon(MEASURED, 1)[0]
    assert row["px_per_mm"] == pytest.approx(359 / 85.6, abs=1e-3)
    assert row["spread_percent"] == pytest.approx(200 / 359, abs=0.01)
    assert (row["repeats"], row["ruler_check"], row["occasion"]) == (3, "agrees", "first")
    assert (row["distance_method"], row["distance_typed_mm"]) == ("typed", 600)


def test_another_person_starts_over_where_somebody_has_begun(
    served: Served, page: Page, context: BrowserContext
) -> None:
    server, studies = served
    link = studies["plain"].link_token
    Visit(page, server.address).open(link).begin().instructions()
    page.reload()
    page.wait_for_selector(".prose")  # who reloads the tab is the same person
    page.close()
    second = context.new_page()
    visit = Visit(second, server.address).open(link)
    second.wait_for_selector("text=Someone has started this study on this device")
    assert axe_violations(second) == []
    before = len(server.rows("SELECT id FROM study_runs"))
    second.click("text=Start as another person")
    visit.begin()
    assert len(server.rows("SELECT id FROM study_runs")) == before + 1


def test_room_is_asked_for_before_anything_begins_and_who_declines_is_led_back(
    served: Served, page: Page
) -> None:
    server, studies = served
    back = {"kind": "generic", "redirect_declined": "https://x.example/no?id={participant}"}
    link = server.link(studies["plain"], "general", recruiter=back)
    before = len(server.rows("SELECT id FROM study_runs"))
    page.set_viewport_size({"width": 310, "height": 700})
    visit = Visit(page, server.address).open(link, "?participant=p%201")
    page.wait_for_selector("text=The window is too small")
    assert page.get_attribute("a.button", "href") == "https://x.example/no?id=p%201"
    assert axe_violations(page) == []
    assert len(server.rows("SELECT id FROM study_runs")) == before
    page.set_viewport_size({"width": 1280, "height": 800})
    page.wait_for_selector("text=About")
    page.click(".primary")
    page.click("text=I do not agree")
    page.wait_for_selector("text=You are not taking part")
    assert page.get_attribute("a.button", "href") == "https://x.example/no?id=p%201"
    assert visit.problems == []


def test_practice_comes_once_more_where_a_key_was_pressed_during_the_clip(served: Served, page: Page) -> None:
    server, studies = served
    visit = Visit(page, server.address).open(studies["plain"].link_token).begin().instructions()
    page.wait_for_selector("text=not part of the study")
    page.click(".primary")
    page.wait_for_selector(".ready")
    page.keyboard.press(" ")
    page.wait_for_selector(".trial.playing")
    page.keyboard.press("x")
    page.wait_for_selector(".scale")
    page.keyboard.press("5")
    page.wait_for_selector("text=Please try this one again")
    page.keyboard.press("Enter")
    visit.rate("5")
    page.wait_for_selector("text=Good. Please continue like this")
    page.keyboard.press("Enter")
    page.wait_for_selector("text=Practice is complete")
    assert visit.problems == []


def test_a_locked_database_is_not_called_a_lost_connection(served: Served, page: Page) -> None:
    server, studies = served
    Visit(page, server.address).open(studies["plain"].link_token)
    file = server.settings.resolved_database_url.removeprefix("sqlite:///")
    with closing(sqlite3.connect(file, isolation_level=None)) as other:
        other.execute("BEGIN IMMEDIATE")
        page.click(".primary")
        page.wait_for_selector("text=The study is busy at the moment")
        assert not page.is_visible("text=check your connection")
        other.execute("ROLLBACK")
    page.wait_for_selector(".page > .tick")


def test_arabic_is_spoken_and_runs_from_right_to_left(served: Served, page: Page) -> None:
    server, studies = served
    visit = Visit(page, server.address).open(studies["arabic"].link_token)
    expect(page.locator("html")).to_have_attribute("dir", "rtl")
    assert page.evaluate(LAST_SIGN_AFTER_FIRST), "the question mark of an English title is at its end"
    page.click("text=بدء")
    page.check("input[type=checkbox]")
    assert axe_violations(page) == []
    page.click("text=متابعة")
    visit.form()
    visit.instructions()
    page.wait_for_selector(".prose")
    page.click(".primary")
    page.wait_for_selector(".ready")
    page.keyboard.press(" ")
    page.wait_for_selector(".scale")
    first, last = (page.locator(f".key[data-value='{value}']").bounding_box() for value in (1, 7))
    assert first is not None
    assert last is not None
    assert first["x"] > last["x"]
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    page.keyboard.press("ArrowLeft")
    assert page.evaluate("document.activeElement.dataset.value") == "1"
    page.keyboard.press("4")
    page.wait_for_selector(".feedback")
