"""Where a pointer rests must not choose the answer."""

from pathlib import Path

import pytest
from playwright.sync_api import Browser, ElementHandle, FloatRect, Page

from tests.browser.server_process import ServerProcess
from tests.browser.studies import PLAIN, without
from tests.browser.visit import Visit

pytestmark = pytest.mark.browser
DELAY_MS = 8_000
STUDY = without(
    PLAIN,
    ('kind = "clip_rating"', f'kind = "clip_rating"\npointer_delay_ms = {DELAY_MS}'),
    ("trials = 1", "trials = 0"),
)
SIZES = [(390, 844), (1440, 900), (1920, 1080)]


def box(element: ElementHandle | None) -> FloatRect:
    found = element.bounding_box() if element else None
    assert found is not None
    return found


def overlap(one: FloatRect, other: FloatRect) -> bool:
    across = one["x"] < other["x"] + other["width"] and other["x"] < one["x"] + one["width"]
    down = one["y"] < other["y"] + other["height"] and other["y"] < one["y"] + one["height"]
    return across and down


def test_nothing_of_the_scale_lies_where_a_clip_was_started(
    server: ServerProcess, tmp_path: Path, chromium: Browser
) -> None:
    study = server.add_study(tmp_path / "clips", STUDY)
    server.start()
    for width, height in SIZES:
        context = chromium.new_context(viewport={"width": width, "height": height}, locale="en-GB")
        page = context.new_page()
        Visit(page, server.address).open(study.link_token).begin().instructions()
        page.wait_for_selector(".ready")
        pressed = [box(page.query_selector(".below .primary")), box(page.query_selector(".clip"))]
        page.keyboard.press(" ")
        page.wait_for_selector(".scale")
        keys = [box(key) for key in page.query_selector_all(".key")]
        assert len(keys) == 7
        assert not any(overlap(key, place) for key in keys for place in pressed), (width, height)
        context.close()


def test_a_mouse_that_has_not_moved_chooses_nothing(
    server: ServerProcess, tmp_path: Path, page: Page
) -> None:
    study = server.add_study(tmp_path / "clips", STUDY, frames=30)
    server.start()
    Visit(page, server.address).open(study.link_token).begin().instructions()
    page.wait_for_selector(".ready")
    x, y = scale_key(page)
    page.wait_for_selector(".ready")
    page.keyboard.press(" ")
    page.mouse.move(x, y)  # while the clip plays
    page.wait_for_selector(".scale")
    page.mouse.down()
    page.mouse.up()
    page.wait_for_timeout(400)
    assert page.query_selector(".scale"), "a press of the resting mouse was taken for an answer"
    page.mouse.move(x + 6, y)
    page.mouse.down()
    page.mouse.up()
    page.wait_for_selector(".ready, .break")
    rows = server.rows_soon("SELECT response FROM ratings ORDER BY time_elapsed", 2)
    assert [row["response"] for row in rows] == [7, 4]


def scale_key(page: Page) -> tuple[float, float]:
    """The middle of key 4, from a first trial that is answered by keyboard."""
    page.keyboard.press(" ")
    page.wait_for_selector(".scale")
    found = box(page.query_selector('.key[data-value="4"]'))
    page.keyboard.press("7")
    page.wait_for_selector(".scale", state="detached")
    return found["x"] + found["width"] / 2, found["y"] + found["height"] / 2
