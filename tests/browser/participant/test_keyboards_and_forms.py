"""Every keyboard answers, a half-filled form survives a reload, and what is needed lies in sight."""

import json
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page, Route

from tests.browser.served import Served, serve
from tests.browser.studies import PLAIN, STUDY, without
from tests.browser.visit import Visit

pytestmark = pytest.mark.browser
UNPRACTISED = without(PLAIN, ("trials = 1", "trials = 0"))
# Key, code: as the browser reports them on that keyboard.
KEYS = {
    "AZERTY": ("(", "Digit5"),
    "full-width": ("５", "Digit5"),
    "Persian": ("۵", "Digit5"),
    "Devanagari": ("५", "Digit5"),
    "input method": ("Process", "Digit5"),
    "input method, numpad": ("Process", "Numpad5"),
}
PRESS = """([key, code]) => document.activeElement.dispatchEvent(
    new KeyboardEvent('keydown', { key, code, bubbles: true, cancelable: true }))"""


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory, built_page: Path) -> Iterator[Served]:
    studies = {"plain": (UNPRACTISED, 8), "measured": (STUDY, 8)}
    with serve(tmp_path_factory.mktemp("keyboards"), studies) as opened:
        yield opened


def test_digits_of_every_keyboard_answer(served: Served, page: Page) -> None:
    served.visit("plain", page)
    for key, code in KEYS.values():
        page.wait_for_selector(".ready")
        page.keyboard.press(" ")
        scale = page.wait_for_selector(".scale")
        page.evaluate(PRESS, [key, code])
        assert scale
        scale.wait_for_element_state("hidden")
        page.wait_for_selector(".ready, .attention, .break")
        if page.query_selector(".attention, .break"):
            break
    rows = served.rows_of_latest("ratings", "time_elapsed", 3)
    assert {row["response"] for row in rows if row["kind"] == "main"} == {5}


@pytest.mark.parametrize("key", KEYS.values(), ids=KEYS)
def test_each_keyboard_alone(served: Served, page: Page, key: tuple[str, str]) -> None:
    served.visit("plain", page)
    page.keyboard.press(" ")
    scale = page.wait_for_selector(".scale")
    page.evaluate(PRESS, list(key))
    assert scale
    scale.wait_for_element_state("hidden")


@pytest.mark.parametrize("age", ["٣٤", "۳۴", "３４", "३४", " 34 "])
def test_an_age_in_digits_of_any_script(served: Served, page: Page, age: str) -> None:
    Visit(page, served.server.address).open(served.studies["plain"].link_token).begin(age).instructions()
    latest = "SELECT answers FROM form_answers ORDER BY id DESC LIMIT 1"
    [row] = served.server.rows(latest)
    assert json.loads(row["answers"])["age"] == 34


def test_a_half_filled_form_is_there_after_a_reload(served: Served, page: Page) -> None:
    visit = Visit(page, served.server.address).open(served.studies["plain"].link_token)
    page.click(".primary")
    page.check("input[type=checkbox]")
    page.click(".primary")
    page.fill("input.short", "41")
    page.check("input[value=corrected]")
    page.check(".likert input[value='3']")
    page.reload()
    page.wait_for_selector("form")
    assert page.input_value("input.short") == "41"
    assert page.is_checked("input[value=corrected]")
    assert page.is_checked(".likert input[value='3']")
    page.click(".primary")
    visit.instructions()
    kept = page.evaluate("Object.keys(sessionStorage).filter((key) => key.startsWith('palpebra form'))")
    assert kept == []


def bottom(page: Page, selector: str) -> float:
    return float(page.evaluate("(s) => document.querySelector(s).getBoundingClientRect().bottom", selector))


@pytest.mark.parametrize("size", [(720, 450), (640, 400), (960, 500)])
@pytest.mark.parametrize("clip", [(960, 360), (640, 480)])
def test_scale_labels_are_in_sight_at_200_percent(
    served: Served, chromium: Browser, size: tuple[int, int], clip: tuple[int, int]
) -> None:
    """A page at 200% zoom has half as many CSS pixels."""
    width, height = size
    context = chromium.new_context(viewport={"width": width, "height": height}, device_scale_factor=2)
    page = context.new_page()

    def enlarge(route: Route) -> None:
        answer = route.fetch()
        run = answer.json()
        for trial in run["trials"]:
            trial["width_px"], trial["height_px"] = clip
        route.fulfill(response=answer, json=run)

    page.route("**/api/run", enlarge)
    try:
        served.visit("plain", page)
        page.keyboard.press(" ")
        page.wait_for_selector(".scale")
        assert page.evaluate("scrollY") == 0
        assert max(bottom(page, ".ends"), bottom(page, ".scale")) <= height
        page.keyboard.press("4")
        page.wait_for_selector(".ready")
        assert page.evaluate("scrollY") == 0
    finally:
        context.close()


@pytest.mark.parametrize("chance", [0.0, 0.999], ids=["small card", "large card"])
@pytest.mark.parametrize("language", ["en", "de"])
@pytest.mark.parametrize("height", [900, 760])
def test_the_buttons_of_the_card_are_in_sight(
    served: Served, chromium: Browser, chance: float, language: str, height: int
) -> None:
    """Also in the window that a browser leaves of such a screen; the card's first size is drawn by chance."""
    context = chromium.new_context(viewport={"width": 1440, "height": height}, locale=language)
    page = context.new_page()
    page.add_init_script(f"Math.random = () => {chance}")
    try:
        page.goto(f"{served.server.address}/run/{served.studies['measured'].link_token}")
        page.click(".primary")
        page.check("input[type=checkbox]")
        page.click(".primary")
        page.wait_for_selector("form")
        page.fill("input.short", "34")
        page.check("input[value=normal]")
        page.click(".primary")
        page.wait_for_selector(".card")
        assert page.evaluate("scrollY") == 0
        assert bottom(page, ".page .actions .primary") <= height
    finally:
        context.close()
