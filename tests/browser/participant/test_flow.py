"""The whole visit in a real Chromium against a real server process."""

import csv
import io
from pathlib import Path

import pytest
from playwright.sync_api import Browser, BrowserContext, Page

from tests.browser.server_process import ServerProcess
from tests.browser.studies import ARABIC, PLAIN, STUDY, without
from tests.browser.visit import Visit, axe_violations
from tests.helpers.databases import run_server_command

pytestmark = pytest.mark.browser
PRACTICE_PAGE = next(line for line in PLAIN.splitlines() if line.startswith('practice = "# Practice'))


def test_every_screen_is_accessible_and_the_ratings_arrive(
    server: ServerProcess, tmp_path: Path, page: Page
) -> None:
    study = server.add_study(tmp_path / "clips", STUDY)
    server.start()
    found: dict[str, list[str]] = {}
    seen: set[str] = set()

    def look(name: str) -> None:
        if name in seen:
            return
        seen.add(name)
        found[name] = axe_violations(page)
        wide = page.evaluate("document.documentElement.scrollWidth - innerWidth")
        if wide > 0:
            found[name].append(f"{wide} px wider than the window")

    visit = Visit(page, server.address, look).open(study.link_token)
    visit.begin().measure().instructions().practice()
    assert visit.trials() == 6
    assert {name: list_ for name, list_ in found.items() if list_} == {}
    assert len(seen) >= 15
    assert visit.problems == []
    rows = server.rows("SELECT * FROM ratings ORDER BY trial_index")
    assert {row["run_status"] for row in rows} == {"complete"}
    assert [row["response"] for row in rows if row["kind"] == "main"] == [4] * 6
    shown = [row for row in rows if row["kind"] != "attention"]
    assert all(row["method"] == "webcodecs" and row["key_to_first_frame_ms"] >= 0 for row in shown)
    # How many a busy machine loses is the matter of the timed tests.
    assert {row["frames_drawn"] + row["frames_missing"] for row in shown} == {8}
    assert {row["viewing_distance_mm"] for row in rows} == {600}
    out = tmp_path / "ratings.csv"
    assert run_server_command(server.settings, "export", "browser", "--out", str(out)).returncode == 0
    exported = list(csv.DictReader(io.StringIO(out.read_text())))
    assert [line["response"] for line in exported] == [str(row["response"]) for row in rows]


def test_reading_at_200_percent_needs_no_sideways_scrolling(
    server: ServerProcess, tmp_path: Path, chromium: Browser
) -> None:
    # 1280 x 800 at 200% zoom is a window of 640 x 400 CSS pixels with two device pixels each.
    study = server.add_study(tmp_path / "clips", STUDY)
    server.start()
    context = chromium.new_context(
        viewport={"width": 640, "height": 400}, device_scale_factor=2, locale="en-GB"
    )
    page = context.new_page()
    wide: dict[str, int] = {}
    measure = "document.documentElement.scrollWidth - innerWidth"
    visit = Visit(page, server.address, lambda name: wide.update({name: page.evaluate(measure)}))
    visit.open(study.link_token).begin().measure().instructions()
    page.wait_for_selector("text=not part of the study")
    context.close()
    assert {name: px for name, px in wide.items() if px > 0} == {}
    assert len(wide) >= 7


def test_steps_count_what_is_shown_and_practice_says_what_it_is(
    server: ServerProcess, tmp_path: Path, page: Page
) -> None:
    """Of a study that measures nothing the step of the screen is not counted."""
    declared = without(PLAIN, (PRACTICE_PAGE, ""))
    study = server.add_study(tmp_path / "clips", declared)
    server.start()
    steps: list[str] = []
    visit = Visit(page, server.address, lambda _: steps.extend(page.locator(".eyebrow").all_inner_texts()))
    visit.open(study.link_token).begin().instructions()
    assert [step for step in steps if "of" in step] == ["Step 1 of 3", "Step 2 of 3", "Step 3 of 3"]
    page.wait_for_selector(
        "text=We begin with 1 practice clip. Your practice answer is not used in the study."
    )
    assert axe_violations(page) == []


def test_by_touch_and_in_german(server: ServerProcess, tmp_path: Path, chromium: Browser) -> None:
    study = server.add_study(tmp_path / "clips", PLAIN)
    server.start()
    tablet = {"width": 1024, "height": 768}
    context = chromium.new_context(viewport=tablet, screen=tablet, has_touch=True, locale="de-DE")
    page = context.new_page()
    Visit(page, server.address).open(study.link_token)
    page.wait_for_selector("text=Sprache")
    page.tap(".primary")
    page.tap(".page > .tick")
    page.tap(".primary")
    page.fill("input.short", "34")
    page.tap("text=Normal ohne Brille")
    page.tap(".primary")
    page.wait_for_selector("text=Ihre Aufgabe")
    page.tap(".primary")
    page.wait_for_selector("text=zählen nicht")
    page.tap(".primary")
    page.wait_for_selector(".ready")
    page.tap(".clip")
    page.wait_for_selector(".scale")
    page.tap(".key >> nth=6")
    page.wait_for_selector(".feedback")
    page.tap(".below .primary")
    assert [row["response"] for row in server.rows_soon("SELECT response FROM ratings", 1)] == [7]
    assert page.evaluate("document.documentElement.lang") == "de"
    context.close()


def test_confirming_changing_and_commenting(server: ServerProcess, tmp_path: Path, page: Page) -> None:
    declared = without(
        PLAIN, ('kind = "clip_rating"', 'kind = "clip_rating"\nconfirm = true\ncomment = true\nviews = 2')
    )
    study = server.add_study(tmp_path / "clips", declared)
    server.start()
    visit = Visit(page, server.address).open(study.link_token).begin().instructions()
    page.click(".primary")
    page.wait_for_selector(".ready")
    page.keyboard.press("Enter")
    page.wait_for_selector("text=(2 of 2)")
    assert page.query_selector(".scale") is None
    page.keyboard.press(" ")
    page.wait_for_selector(".scale")
    page.keyboard.press("2")
    page.keyboard.press("ArrowRight")
    page.click(".key >> nth=5")
    page.fill("textarea", "the lid moved 3 times")
    page.click(".primary")
    page.wait_for_selector(".feedback")
    page.click(".below .primary")
    row = server.rows_soon("SELECT * FROM ratings", 1)[0]
    assert (row["response"], row["changes"], row["comment"]) == (6, 1, "the lid moved 3 times")
    assert row["frames_drawn"] + row["frames_missing"] == 16, "over both views"
    assert visit.problems == []


def test_right_to_left_turns_the_page_and_the_scale(
    server: ServerProcess, tmp_path: Path, page: Page
) -> None:
    study = server.add_study(tmp_path / "clips", ARABIC)
    server.start()
    Visit(page, server.address).open(study.link_token)
    assert page.evaluate("document.documentElement.dir") == "rtl"
    page.click(".primary")
    page.wait_for_selector(".page > .tick")
    box, text = page.locator(".tick input").bounding_box(), page.locator(".tick span").bounding_box()
    assert box is not None
    assert text is not None
    assert box["x"] > text["x"]
    assert axe_violations(page) == []


def test_a_failed_clip_is_shown_again_at_the_end_of_its_block(
    server: ServerProcess, tmp_path: Path, page: Page
) -> None:
    study = server.add_study(tmp_path / "clips", PLAIN, frames=30)
    server.start()
    visit = Visit(page, server.address).open(study.link_token).begin().instructions().practice()
    page.wait_for_selector(".ready")
    page.keyboard.press(" ")
    page.wait_for_timeout(200)
    page.evaluate("window.dispatchEvent(new Event('blur'))")
    page.wait_for_selector(".scale")
    page.keyboard.press("3")
    visit.trials()
    assert visit.problems == []
    rows = server.rows("SELECT * FROM ratings WHERE kind = 'main' ORDER BY time_elapsed")
    # On a busy machine a play that went well is uncertain, or lacks a frame.
    assert [(row["play"], row["verdict"] == "failed") for row in rows[:4]] == [
        (1, True),
        (1, False),
        (1, False),
        (2, False),
    ]
    assert rows[0]["trial_index"] == rows[3]["trial_index"]
    assert (rows[0]["response"], rows[3]["response"]) == (3, 4)
    assert len(rows) == 7


def test_simulated_participants_answer_by_themselves(
    server: ServerProcess, tmp_path: Path, context: BrowserContext
) -> None:
    study = server.add_study(tmp_path / "clips", STUDY)
    server.start()
    for mode in ("data-only", "visual"):
        page = context.new_page()
        visit = Visit(page, server.address).open(server.link(study, "preview"), f"?simulate={mode}")
        page.click(".primary")
        page.wait_for_selector(".code", timeout=90_000)
        assert visit.code()
        assert visit.problems == []
        page.close()
