"""A continuous rating in a real browser: held keys and a mouse move the slider while the clip is shown."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Page

from experiments.load import parse_experiment
from tests.browser.server_process import ServerProcess
from tests.browser.studies import PLAIN
from tests.browser.visit import Visit
from tests.helpers.tiny_clips import make_clip_folder

pytestmark = pytest.mark.browser
FRAMES, FPS, SIZE_PX = 90, 30, (480, 180)
KIND = """
[trial]
kind = "continuous_rating"
question = { en = "How alive do these eyes look?" }
low = { en = "not at all alive" }
high = { en = "very much alive" }
input = "INPUT"
sample_hz = 10
"""


def declared(how: str) -> str:
    """The plain study with one clip, no practice and this kind of trial."""
    text = PLAIN.replace("per_cell = 3", "per_cell = 1").replace("trials = 1", "trials = 0")
    before, _, after = text.partition("[trial]")
    return before + KIND.replace("INPUT", how) + "[[" + after.partition("[[")[2]


def trace(
    server: ServerProcess, folder: Path, page: Page, how: str, move: Callable[[Page], None]
) -> dict[str, Any]:
    """The stored answer of one trial in which `move` was done while the clip was shown."""
    text = declared(how)
    make_clip_folder(parse_experiment(text), folder, frames=FRAMES, size_px=SIZE_PX)
    study = server.add_built_study(folder, text)
    server.start()
    visit = Visit(page, server.address).open(study.link_token).begin().instructions()
    page.wait_for_selector(".ready")
    page.keyboard.press(" ")
    page.wait_for_selector("input[type=range]")
    move(page)
    rows = server.rows_soon("SELECT t.* FROM trial_ratings t", 1)
    assert visit.problems == []
    answer = rows[0]["payload"]
    return json.loads(answer) if isinstance(answer, str) else answer


def test_a_held_key_moves_the_slider_and_the_trace_follows(
    server: ServerProcess, tmp_path: Path, page: Page
) -> None:
    def hold(page: Page) -> None:
        page.keyboard.down("ArrowRight")
        page.wait_for_timeout(600)
        page.keyboard.up("ArrowRight")

    answer = trace(server, tmp_path / "clips", page, "keys", hold)
    values = answer["values"]
    assert len(values) == FRAMES // 3
    assert answer["step_frames"] == 3
    assert values == sorted(values)
    # Three seconds from end to end, so 0.6 s are a fifth of the way; timers of a busy machine vary.
    assert 5 <= values[-1] - values[0] <= 50


def test_a_mouse_moves_the_slider_and_the_trace_follows(
    server: ServerProcess, tmp_path: Path, page: Page
) -> None:
    def drag(page: Page) -> None:
        box = page.locator("input[type=range]").bounding_box()
        assert box is not None
        x, y = box["x"], box["y"] + box["height"] / 2
        page.mouse.move(x + 0.5 * box["width"], y)
        page.mouse.down()
        for share in (0.6, 0.75, 0.9):
            page.mouse.move(x + share * box["width"], y)
            page.wait_for_timeout(120)
        page.mouse.up()

    values = trace(server, tmp_path / "clips", page, "slider", drag)["values"]
    assert values[-1] == pytest.approx(90, abs=4)
    assert values[0] < values[-1]
