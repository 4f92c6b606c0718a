"""Screen, clock and keyboard: blind spot, full screen, zoom, a clock that is set, no mouse at all."""

import json
from itertools import pairwise
from pathlib import Path

import pandas as pd
import pytest
from playwright.sync_api import Browser, Page

from tests.browser.server_process import ServerProcess
from tests.browser.studies import PLAIN, STUDY, without
from tests.browser.visit import CARD_PX, Visit, axe_violations, fit_card

pytestmark = pytest.mark.browser
PICTURES_OF = {"width": 1280, "height": 800}
SEPARATION_PX = """() => {
  const dot = document.querySelector('.blind-dot').getBoundingClientRect();
  const square = document.querySelector('.blind-square').getBoundingClientRect();
  return square.x + square.width / 2 - (dot.x + dot.width / 2);
}"""
TAN_13_5_DEGREES = 0.2400787
CARD_PX_PER_MM = CARD_PX / 85.6


def to_the_blind_spot(visit: Visit) -> Page:
    page = visit.begin().page
    fit_card(page)
    page.click("text=Yes, within")
    page.wait_for_selector(".blind-field")
    return page


def test_the_blind_spot_gives_the_distance(server: ServerProcess, tmp_path: Path, page: Page) -> None:
    study = server.add_study(tmp_path / "clips", STUDY)
    server.start()
    to_the_blind_spot(Visit(page, server.address).open(study.link_token))
    seen: list[float] = []
    for number in range(1, 6):
        page.wait_for_selector(f"text={number} of 5")
        page.keyboard.press(" ")
        # The dot "vanishes" a little further out each time, as if the head moved back.
        while (separation := page.evaluate(SEPARATION_PX)) < 250 + 10 * number:
            page.wait_for_timeout(20)
        seen.append(separation)
        page.keyboard.press(" ")
    page.wait_for_selector(".prose")
    stored = server.rows_soon("SELECT viewing_distance_mm FROM calibrations", 1)[0]["viewing_distance_mm"]
    median_mm = sorted(seen)[2] / CARD_PX_PER_MM / TAN_13_5_DEGREES
    # Between reading the separation and the press the dot goes on, 0.1 px per millisecond.
    assert median_mm - 5 < stored < median_mm + 60


def test_a_round_that_misses_the_blind_spot_is_explained_and_repeated(
    server: ServerProcess, tmp_path: Path, page: Page
) -> None:
    page.set_viewport_size({"width": 500, "height": 800})  # a short way, so that the end is reached soon
    study = server.add_study(tmp_path / "clips", STUDY)
    server.start()
    to_the_blind_spot(Visit(page, server.address).open(study.link_token))
    page.keyboard.press(" ")
    page.wait_for_selector("text=That round does not count", timeout=20_000)
    assert "1 of 5" in page.inner_text(".eyebrow")
    assert axe_violations(page) == []
    page.keyboard.press(" ")
    page.click("text=The dot is gone")  # at once: nobody sits so near
    page.wait_for_selector("text=That round does not count")
    assert "1 of 5" in page.inner_text(".eyebrow")


def test_full_screen_is_entered_left_and_asked_for_again(
    server: ServerProcess, tmp_path: Path, chromium: Browser
) -> None:
    study = server.add_study(
        tmp_path / "clips", without(PLAIN, ("full_screen = false", "full_screen = true"))
    )
    server.start()
    context = chromium.new_context(
        viewport=PICTURES_OF, screen={"width": 1920, "height": 1080}, locale="en-GB"
    )
    page = context.new_page()
    visit = Visit(page, server.address).open(study.link_token).begin()
    page.wait_for_selector("text=Go to full screen")
    assert axe_violations(page) == []
    page.click("text=Go to full screen")
    visit.instructions()
    assert page.evaluate("document.fullscreenElement === document.documentElement")
    visit.practice()
    visit.rate()
    page.wait_for_selector(".ready")
    page.evaluate("document.exitFullscreen()")
    page.keyboard.press(" ")
    page.wait_for_selector(".scale")
    page.keyboard.press("4")
    page.wait_for_selector("text=Please return to full screen")
    assert axe_violations(page) == []
    page.keyboard.press("Enter")
    page.wait_for_selector(".ready")
    assert page.evaluate("document.fullscreenElement !== null")
    visit.trials()
    assert page.evaluate("document.fullscreenElement") is None
    context.close()
    assert "fullscreen_left" in str(server.rows("SELECT type FROM run_events"))


def test_a_denied_full_screen_is_told_and_does_not_stop(
    server: ServerProcess, tmp_path: Path, chromium: Browser
) -> None:
    study = server.add_study(
        tmp_path / "clips", without(PLAIN, ("full_screen = false", "full_screen = true"))
    )
    server.start()
    context = chromium.new_context(
        viewport=PICTURES_OF, screen={"width": 1920, "height": 1080}, locale="en-GB"
    )
    page = context.new_page()
    page.add_init_script(
        "Element.prototype.requestFullscreen = () => Promise.reject(new TypeError('denied'))"
    )
    visit = Visit(page, server.address).open(study.link_token).begin()
    page.click("text=Go to full screen")
    page.wait_for_selector("text=does not allow full screen")
    page.click(".primary")
    visit.instructions().practice()
    assert visit.trials() == 6
    context.close()
    assert '"denied": true' in str(server.rows("SELECT data FROM run_events WHERE type = 'fullscreen_left'"))


def test_a_clock_that_is_set_changes_no_duration_and_is_told(
    server: ServerProcess, tmp_path: Path, page: Page
) -> None:
    study = server.add_study(tmp_path / "clips", PLAIN)
    server.start()
    visit = Visit(page, server.address).open(study.link_token).begin().instructions().practice()
    visit.trials(most=1)
    for hours in (-3, 8):
        page.wait_for_selector(".ready")
        page.keyboard.press(" ")
        page.wait_for_selector(".scale")
        page.evaluate(
            "shift => { const before = Date.now.bind(Date); Date.now = () => before() + shift; }",
            hours * 3_600_000,
        )
        page.keyboard.press("4")
    visit.trials()
    rows = server.rows("SELECT * FROM trial_ratings ORDER BY trial_index")
    assert all(0 <= row["rt"] < 60_000 and 0 <= row["rt_from_first_frame"] < 60_000 for row in rows)
    elapsed = [row["time_elapsed"] for row in rows]
    assert all(0 < after - before < 60_000 for before, after in pairwise(elapsed))
    shifts = [
        (json.loads(row["data"]) if isinstance(row["data"], str) else row["data"])["shift_ms"]
        for row in server.rows("SELECT data FROM run_events WHERE type = 'clock_changed' ORDER BY id")
    ]
    assert shifts == [pytest.approx(-3 * 3_600_000, abs=500), pytest.approx(8 * 3_600_000, abs=500)]


@pytest.mark.parametrize("forward_s", [60, -60])
def test_a_clock_that_was_set_before_the_worker_was_made_changes_no_response_time(
    server: ServerProcess, tmp_path: Path, page: Page, forward_s: int
) -> None:
    """As where the computer slept on the start page: the clip's worker counts from another origin."""
    study = server.add_study(tmp_path / "clips", without(PLAIN, ("trials = 1", "trials = 0")))
    server.start()
    # The page's origin stays behind the clock, as Chromium keeps it; the worker is made by the real clock.
    page.add_init_script(
        "Object.defineProperty(performance, 'timeOrigin', "
        f"{{ value: performance.timeOrigin - {forward_s * 1000} }})"
    )
    Visit(page, server.address).open(study.link_token).begin().instructions().trials()
    rows = server.rows_soon("SELECT * FROM trial_ratings ORDER BY trial_index", 6)
    times = pd.DataFrame(rows)[["rt", "rt_from_first_frame", "key_to_first_frame_ms"]].astype(float)
    assert len(times) == 6
    assert times.gt(0).all(axis=None), times
    assert times.lt(30_000).all(axis=None), times
    # A clip of 8 frames at 30 per second: the last one is drawn 7 periods after the first.
    assert (times["rt_from_first_frame"] - times["rt"]).median() == pytest.approx(7000 / 30, abs=20)


CUT_OFF = """() => {
  const cut = [], shown = '.key, .clip, .ready, .question, .below .button, .ends span';
  const beyond = document.documentElement.scrollWidth - innerWidth;
  if (beyond > 0) cut.push(`${beyond} px wider than the window`);
  for (const one of document.querySelectorAll(shown)) {
    const { left, right, top, bottom } = one.getBoundingClientRect();
    const name = one.className || one.textContent;
    if (left < 0 || right > innerWidth + 0.5) cut.push(`${name} from ${left} to ${right}`);
    if (top < 0 || bottom > innerHeight + 0.5) cut.push(`${name} down to ${bottom}`);
    if (name !== 'clip' && one.scrollWidth > one.clientWidth + 1) cut.push(`text of ${name}`);
  }
  return cut;
}"""
"""What lies outside the width of a page, or under the fold of a trial."""


@pytest.mark.parametrize(
    ("width", "height"), [(640, 400), (960, 540)], ids=["1280x800 at 200%", "1920x1080 at 200%"]
)
def test_trial_screens_at_200_percent_show_everything(
    server: ServerProcess, tmp_path: Path, chromium: Browser, width: int, height: int
) -> None:
    study = server.add_study(tmp_path / "clips", STUDY)
    server.start()
    context = chromium.new_context(
        viewport={"width": width, "height": height}, device_scale_factor=2, locale="en-GB"
    )
    page = context.new_page()
    cut: dict[str, list[str]] = {}

    def look(name: str) -> None:
        if name in ("ready", "scale", "feedback", "break", "practice", "done"):
            cut[name] = page.evaluate(CUT_OFF)
            page.screenshot(path=tmp_path / f"{name}.png")

    visit = Visit(page, server.address, look).open(study.link_token).begin().measure().instructions()
    visit.practice()
    visit.trials()
    context.close()
    assert {"ready", "scale", "feedback", "break", "done"} <= set(cut)
    assert {name: list_ for name, list_ in cut.items() if list_} == {}


def tab_to(page: Page, selector: str) -> None:
    """Tab until the focus is on it; it must then be seen to be there."""
    for _ in range(40):
        if page.evaluate("selector => document.activeElement.matches(selector)", selector):
            assert page.evaluate("document.activeElement.matches(':focus-visible')")
            return
        page.keyboard.press("Tab")
    raise AssertionError(f"expected to reach {selector} within 40 presses of Tab")


def press(page: Page, selector: str, key: str = "Enter") -> None:
    tab_to(page, selector)
    page.keyboard.press(key)


def test_the_whole_visit_by_keyboard_alone(server: ServerProcess, tmp_path: Path, page: Page) -> None:
    study = server.add_study(
        tmp_path / "clips",
        without(STUDY, ("full_screen = false", "full_screen = false\nallow_touch = false")),
    )
    server.start()
    visit = Visit(page, server.address).open(study.link_token)
    press(page, ".primary")
    page.wait_for_selector(".page > .tick")
    press(page, "input[type=checkbox]", " ")
    press(page, ".primary")
    page.wait_for_selector("form")
    tab_to(page, "input.short")
    page.keyboard.type("34")
    press(page, "input[value=normal]", " ")
    press(page, ".likert input", "ArrowRight")
    press(page, ".primary", " ")
    for number in (1, 2):
        page.wait_for_selector(f".card-area[data-round='{number}']")
        tab_to(page, "input[type=range]")
        page.keyboard.press("Home")
        for _ in range(4):
            page.keyboard.press("PageUp")
        before = page.evaluate("document.querySelector('.card').offsetWidth")
        page.keyboard.press("ArrowRight")
        assert page.evaluate("document.querySelector('.card').offsetWidth") == before + 1
        press(page, ".primary")
    page.wait_for_selector(".ruler-line")
    press(page, ".primary")
    page.wait_for_selector(".blind-field")
    press(page, ".actions .plain")
    page.wait_for_selector("input.short")
    press(page, ".primary")
    page.wait_for_selector(".prose ol")
    page.keyboard.press("Enter")
    page.wait_for_selector("text=not part of the study")
    page.keyboard.press("Enter")
    page.wait_for_selector(".ready")
    page.keyboard.press("Enter")
    page.wait_for_selector(".scale")
    page.keyboard.press("ArrowRight")
    page.keyboard.press("ArrowRight")
    page.keyboard.press("Enter")
    page.wait_for_selector(".feedback")
    page.keyboard.press("Enter")
    page.wait_for_selector("text=Practice is complete")
    page.keyboard.press("Enter")
    while page.wait_for_selector(".ready, .attention, .break, form"):
        if page.query_selector("form"):
            break
        if page.query_selector(".break"):
            page.wait_for_selector(".primary:enabled")
            press(page, ".primary:enabled")
        elif page.query_selector(".attention"):
            page.keyboard.press(page.inner_text(".question strong"))
        else:
            page.keyboard.press(" ")
            page.wait_for_selector(".scale")
            page.keyboard.press("6")
        page.wait_for_timeout(300)
    press(page, "input[value=lid]", " ")
    press(page, ".primary")
    page.wait_for_selector(".code")
    press(page, ".code button")
    assert visit.problems == []
    answers = [row["response"] for row in server.rows("SELECT * FROM ratings WHERE kind <> 'attention'")]
    assert sorted(answers) == [2] + [6] * 6
    assert [row["status"] for row in server.rows("SELECT status FROM study_runs")] == ["complete"]
