"""The key that starts a clip counts from its press, however long it is held, and clicks nothing later."""

import json
from pathlib import Path

import pytest
from playwright.sync_api import Page, Request

from tests.browser.server_process import ServerProcess
from tests.browser.studies import PLAIN, without
from tests.browser.visit import Visit

pytestmark = pytest.mark.browser
HELD_MS = 100
STUDY = without(PLAIN, ("trials = 1", "trials = 0"))
KEYS_OF_PAGE = """
window.keys = [];
for (const type of ["keydown", "keyup"])
  window.addEventListener(type, ({ key, timeStamp }) => keys.push([type, key, timeStamp]), true);
"""


def ready(server: ServerProcess, folder: Path, page: Page) -> None:
    study = server.add_study(folder / "clips", STUDY, frames=20)
    server.start()
    page.add_init_script(KEYS_OF_PAGE)
    Visit(page, server.address).open(study.link_token).begin().instructions()
    page.wait_for_selector(".ready")
    assert page.evaluate("document.activeElement.matches('.below .primary')")


def at(page: Page, kind: str, key: str) -> float:
    return page.evaluate(
        "([kind, key]) => keys.findLast((one) => one[0] == kind && one[1] == key)[2]", [kind, key]
    )


@pytest.mark.parametrize("key", [" ", "Enter"])
def test_a_clip_starts_when_its_key_goes_down(
    server: ServerProcess, tmp_path: Path, page: Page, key: str
) -> None:
    ready(server, tmp_path, page)
    page.keyboard.down(key)
    page.wait_for_timeout(HELD_MS)
    page.keyboard.up(key)
    page.wait_for_selector(".scale")
    with page.expect_request(is_rating) as sent:
        page.keyboard.press("4")
    body = json.loads(sent.value.post_data or "")
    # Stamps of one clock: what the record counts back from the answer is when its start key was pressed.
    started = (
        at(page, "keydown", "4") - body["rt_from_first_frame"] - body["playback"]["key_to_first_frame_ms"]
    )
    pressed, released = at(page, "keydown", key), at(page, "keyup", key)
    assert started == pytest.approx(pressed, abs=1)
    assert released - pressed >= HELD_MS - 1


def is_rating(request: Request) -> bool:
    return request.method != "GET" and "rt_from_first_frame" in (request.post_data or "")


@pytest.mark.parametrize("key", [" ", "Enter"])
def test_a_key_that_is_held_until_the_scale_clicks_nothing(
    server: ServerProcess, tmp_path: Path, page: Page, key: str
) -> None:
    ready(server, tmp_path, page)
    page.keyboard.down(key)
    page.wait_for_selector(".scale")
    page.focus('.key[data-value="7"]')
    page.keyboard.down(key)  # a repeat
    page.keyboard.up(key)
    page.wait_for_timeout(300)
    assert page.query_selector(".scale"), "the start key gave an answer"
    page.keyboard.press(key)
    page.wait_for_selector(".scale", state="detached")
    (row,) = server.rows_soon("SELECT response FROM ratings", 1)
    assert row["response"] == 7
