"""Several scales on one screen: points, a slider and an answer next to it, by keys, mouse and touch."""

import json
import re
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page

from server.rehearsals.http import JsonClient
from server.rehearsals.person import Person, Rater
from tests.browser.analysed import analysed
from tests.browser.server_process import ServerProcess
from tests.browser.studies import PLAIN, without
from tests.browser.visit import Visit, axe_violations

pytestmark = pytest.mark.browser
SCALES = """\
[trial]
pointer_delay_ms = 0

[[trial.scales]]
name = "natural"
maximum = 3
question = { en = "How natural was this blink?" }
labels = [{ en = "not at all" }, { en = "moderately" }, { en = "very" }]

[[trial.scales]]
name = "eerie"
type = "slider"
question = { en = "How eerie was it?" }
low = { en = "not at all" }
high = { en = "extremely" }
not_applicable = { en = "I cannot say" }

"""
STUDY = re.sub(
    r"(?s)\[trial\].*?(?=\[\[forms)", lambda _: SCALES, without(PLAIN, ("trials = 1", "trials = 0"))
)
IN_TURN = STUDY.replace("pointer_delay_ms = 0", 'pointer_delay_ms = 0\narrangement = "one_after_the_other"')


def at_the_scales(page: Page, press_start: bool = True) -> None:
    page.wait_for_selector(".ready")
    if press_start:
        page.keyboard.press(" ")
    else:
        page.tap(".below .primary")
    page.wait_for_selector(".scales")


def slider_at(page: Page, share: float) -> tuple[float, float]:
    box = page.locator(".slider").bounding_box()
    assert box is not None
    return box["x"] + share * box["width"], box["y"] + box["height"] / 2


def test_keys_and_mouse_answer_points_and_sliders(server: ServerProcess, tmp_path: Path, page: Page) -> None:
    study = server.add_study(tmp_path / "clips", STUDY)
    server.start()
    visit = Visit(page, server.address).open(study.link_token).begin().instructions()
    at_the_scales(page)
    assert page.locator(".slider.untouched").count() == 1, "a slider has no handle before the first touch"
    assert page.locator(".scales ~ .actions .primary").is_disabled()
    assert axe_violations(page) == []
    page.keyboard.press("3")
    page.keyboard.press("ArrowRight")  # the slider has the focus by now
    assert page.locator(".slider.untouched").count() == 0
    page.keyboard.press("Enter")
    at_the_scales(page)
    page.locator(".key").nth(1).click()
    page.mouse.click(*slider_at(page, 0.95))
    page.locator(".scales ~ .actions .primary").click()
    at_the_scales(page)
    page.locator(".key").first.click()
    page.locator(".beside").click()
    assert page.locator(".slider.untouched").count() == 1
    page.locator(".scales ~ .actions .primary").click()
    for _ in range(3):
        page.wait_for_selector(".ready, .break")
        if page.query_selector(".break"):
            page.click(".primary:enabled")
        at_the_scales(page)
        page.keyboard.press("2")
        page.keyboard.press("ArrowLeft")
        page.keyboard.press("Enter")
    visit.trials()
    rows = server.rows_soon("SELECT payload FROM trial_ratings ORDER BY time_elapsed", 6)
    first, second, third = (json.loads(row["payload"])["answers"] for row in rows[:3])
    assert (first["natural"]["response"], first["eerie"]["response"]) == (3, 51)
    assert second["natural"]["response"] == 2
    assert 90 <= second["eerie"]["response"] <= 100
    assert (third["eerie"]["response"], third["eerie"]["not_applicable"]) == (None, True)
    assert visit.problems == []
    # The analysis asks for a second person, who needs no browser.
    client = JsonClient(server.address)
    assert Person(client, Rater(1, 1, {})).take_part(study.link_token)
    client.close()
    said = analysed(server, study.name, tmp_path)
    assert "participant responses, data series 1" in said
    assert all(name in said for name in ("Natural", "Eerie", "Reliability of the scales"))


@pytest.mark.parametrize(("width", "height"), [(390, 844), (720, 450)], ids=["phone", "200% zoom"])
def test_touch_on_a_small_screen(
    server: ServerProcess, tmp_path: Path, chromium: Browser, width: int, height: int
) -> None:
    study = server.add_study(tmp_path / "clips", STUDY)
    server.start()
    context = chromium.new_context(
        viewport={"width": width, "height": height}, has_touch=True, locale="en-GB"
    )
    page = context.new_page()
    Visit(page, server.address).open(study.link_token).begin().instructions()
    at_the_scales(page, press_start=False)
    assert axe_violations(page) == []
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth"), "the page scrolls sideways"
    page.locator(".key").nth(1).tap()
    page.locator(".slider").scroll_into_view_if_needed()
    page.touchscreen.tap(*slider_at(page, 0.25))
    page.locator(".scales ~ .actions .primary").tap()
    page.wait_for_selector(".ready")
    (row,) = server.rows_soon("SELECT payload FROM trial_ratings", 1)
    answers = json.loads(row["payload"])["answers"]
    assert answers["natural"]["response"] == 2
    assert 15 <= answers["eerie"]["response"] <= 35
    context.close()


def test_scales_come_one_after_another_where_declared(
    server: ServerProcess, tmp_path: Path, page: Page
) -> None:
    study = server.add_study(tmp_path / "clips", IN_TURN)
    server.start()
    visit = Visit(page, server.address).open(study.link_token).begin().instructions()
    page.wait_for_selector(".ready")
    page.keyboard.press(" ")
    page.wait_for_selector(".key")
    assert (page.locator(".key").count(), page.locator(".slider").count()) == (3, 0)
    assert axe_violations(page) == []
    page.keyboard.press("2")
    page.wait_for_selector(".slider.untouched")
    assert page.locator(".key").count() == 0, "the scale before has gone"
    assert axe_violations(page) == []
    page.mouse.click(*slider_at(page, 0.5))
    page.locator(".trial .actions .primary").click()
    page.wait_for_selector(".ready")
    (row,) = server.rows_soon("SELECT payload FROM trial_ratings", 1)
    answers = json.loads(row["payload"])["answers"]
    assert answers["natural"]["response"] == 2
    assert 45 <= answers["eerie"]["response"] <= 55
    assert answers["natural"]["rt"] < answers["eerie"]["rt"], "each scale has its own time"
    assert visit.problems == []
