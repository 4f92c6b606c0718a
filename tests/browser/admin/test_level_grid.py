"""Clips of your own study in the grid of its cells: dragged, put by keyboard, filled by file names."""

import io
import json
import re
import time
import tomllib
import zipfile
from typing import Any

import pytest
from playwright.sync_api import Locator, Page, expect

from tests.browser.admin.conftest import Dashboard
from tests.browser.admin.test_own_videos import shoot
from tests.browser.visit import axe_violations
from tests.helpers.tiny_clips import encoded_video

pytestmark = pytest.mark.browser
SAVE = "Save as a new version"
SAME_ORIGIN = {"sec-fetch-site": "same-origin"}


def made_study(dashboard: Dashboard, name: str) -> None:
    """A study of four own clips, two speeds by two clips, made through the API of the signed-in browser."""
    requests, api = dashboard.page.request, f"{dashboard.server.address}/api/admin"
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        for number, file in enumerate(("slow_1.mp4", "slow_2.mp4", "fast_1.mp4", "fast_2.mp4")):
            archive.writestr(file, encoded_video(8, 30) + bytes([0, 0, 0, 9]) + b"free" + bytes([number]))
    files: Any = {"name": "clips.zip", "mimeType": "application/zip", "buffer": packed.getvalue()}
    upload = requests.post(f"{api}/uploads", multipart={"files": files}, headers=SAME_ORIGIN).json()["id"]
    while requests.get(f"{api}/uploads/{upload}/progress").json()["waiting"]:
        time.sleep(0.1)  # the clips are looked into by another process
    body = {"name": name, "upload": upload, "levels": {"pattern": "{speed}_{exemplar}.mp4"}}
    made = requests.post(f"{api}/studies", data=body | {"own_clips": {"title": name}}, headers=SAME_ORIGIN)
    assert made.ok, made.text()


def factors_page(dashboard: Dashboard, name: str) -> Page:
    page = dashboard.open(f"/studies/{name}/build?section=factors")
    page.get_by_role("table", name="Cells").wait_for()
    return page


def spot(page: Page, name: str) -> Locator:
    """The place of the grid, or the clip outside, that a screen reader calls so."""
    return page.get_by_role("button", name=name, exact=True)


def saved(page: Page, dashboard: Dashboard, name: str, version: int) -> tuple[dict[str, Any], dict[str, str]]:
    """The stored declaration and the file of each place, once this version is saved."""
    page.get_by_role("button", name=SAVE).click()
    expect(page.get_by_text(f"Saved as version {version}.")).to_be_visible()
    api = f"{dashboard.server.address}/api/admin/studies/{name}"
    declared = tomllib.loads(page.request.get(api).json()["toml"])
    clips = page.request.get(f"{api}/clips").json()
    return declared, {f"{clip['cell']} {clip['exemplar']}": clip["file"] for clip in clips}


def test_clips_are_dragged_into_cells(dashboard: Dashboard) -> None:
    made_study(dashboard, "dragged")
    page = factors_page(dashboard, "dragged")
    expect(page.locator(".grid-of-cells canvas[data-drawn]")).to_have_count(4)  # first frames, drawn here
    spot(page, "slow, no. 1: slow_1.mp4").drag_to(spot(page, "fast, no. 2: fast_2.mp4"))
    expect(spot(page, "fast, no. 2: slow_1.mp4")).to_be_visible()
    expect(spot(page, "slow, no. 1: fast_2.mp4")).to_be_visible()
    expect(page.get_by_text("2 places in cells get other clips")).to_be_visible()
    page.get_by_role("button", name="Undo").click()
    expect(spot(page, "slow, no. 1: slow_1.mp4")).to_be_visible()
    expect(page.get_by_text("Saved as version 1.")).to_be_visible()
    page.get_by_role("button", name="Redo").click()
    page.reload()  # the moves are kept with the rest of the unsaved work
    expect(spot(page, "fast, no. 2: slow_1.mp4")).to_be_visible()
    # A level that gets another name keeps its clips, and the text next to the form says the new name.
    page.get_by_role("switch", name="Show TOML").click()
    page.get_by_role("textbox", name="Name", exact=True).nth(1).fill("calm")
    expect(spot(page, "calm, no. 1: fast_2.mp4")).to_be_visible()
    expect(page.get_by_label("Definition", exact=True)).to_have_value(re.compile('name = "calm"'))
    assert axe_violations(page) == []
    page.get_by_role("heading", name="Factors and clips").scroll_into_view_if_needed()
    shoot(dashboard, "level-grid")
    declared, files = saved(page, dashboard, "dragged", 2)
    assert [level["name"] for level in declared["factors"][0]["levels"]] == ["calm", "fast"]
    assert files == {
        "calm 1": "fast_2.mp4", "calm 2": "slow_2.mp4", "fast 1": "fast_1.mp4", "fast 2": "slow_1.mp4",
    }  # fmt: skip


def test_clips_are_put_into_cells_by_keyboard(dashboard: Dashboard) -> None:
    made_study(dashboard, "keyed")
    page = factors_page(dashboard, "keyed")
    spot(page, "slow, no. 1: slow_1.mp4").press("Enter")
    expect(spot(page, "slow, no. 1: slow_1.mp4")).to_have_attribute("aria-pressed", "true")
    spot(page, "slow, no. 1: slow_1.mp4").press("Escape")
    expect(page.get_by_role("group", name="Move a clip")).to_have_count(0)
    spot(page, "slow, no. 1: slow_1.mp4").press("Space")
    page.get_by_role("button", name="Take out of its cell").press("Enter")
    expect(page.get_by_text("1 place is empty")).to_be_visible()
    expect(page.get_by_text("Clips are missing: slow, no. 1.")).to_be_visible()
    expect(page.get_by_role("button", name=SAVE)).to_be_disabled()
    # Another clip fills the empty place; the one outside gets the place it left, from the list of places.
    spot(page, "fast, no. 1: fast_1.mp4").press("Enter")
    spot(page, "slow, no. 1: empty").press("Enter")
    spot(page, "In no cell: slow_1.mp4").press("Enter")
    page.get_by_role("combobox", name="Move slow_1.mp4 to").press("ArrowDown")
    option = page.get_by_role("option", name="fast, no. 1 (empty)")
    expect(option).to_be_visible()
    for _ in range(6):
        if option.get_attribute("data-combobox-selected") == "true":
            break
        page.keyboard.press("ArrowDown")
    page.keyboard.press("Enter")
    expect(spot(page, "fast, no. 1: slow_1.mp4")).to_be_visible()
    declared, files = saved(page, dashboard, "keyed", 2)
    assert json.dumps(declared["factors"]).count('"name"') == 3
    assert files == {
        "slow 1": "fast_1.mp4", "slow 2": "slow_2.mp4", "fast 1": "slow_1.mp4", "fast 2": "fast_2.mp4",
    }  # fmt: skip
    # The pattern of file names fills the grid again.
    page.get_by_text("Fill by file names").click()
    page.get_by_label("Pattern", exact=True).fill("{tempo}_{exemplar}.mp4")
    page.get_by_role("button", name="Fill the grid").click()
    expect(page.get_by_role("columnheader", name="fast")).to_be_visible()
    page.get_by_role("button", name="Undo").click()
    page.get_by_label("Pattern", exact=True).fill("{speed}_{exemplar}.mp4")
    page.get_by_role("button", name="Fill the grid").click()
    _, files = saved(page, dashboard, "keyed", 3)
    assert all(file.startswith(place.split()[0]) for place, file in files.items())


def test_clips_that_two_people_move_stay_where_each_put_them(dashboard: Dashboard) -> None:
    made_study(dashboard, "met")
    first = factors_page(dashboard, "met")
    other = first.context.new_page()
    other.goto(f"{dashboard.server.address}/admin/studies/met/build?section=factors")
    spot(first, "slow, no. 1: slow_1.mp4").drag_to(spot(first, "slow, no. 2: slow_2.mp4"))
    spot(other, "fast, no. 1: fast_1.mp4").drag_to(spot(other, "fast, no. 2: fast_2.mp4"))
    saved(other, dashboard, "met", 2)
    first.get_by_role("button", name=SAVE).click()
    expect(first.get_by_text("Clips where version 2 has them: fast_1.mp4; fast_2.mp4")).to_be_visible()
    _, places = saved(first, dashboard, "met", 3)
    merged = {
        "slow 1": "slow_2.mp4",
        "slow 2": "slow_1.mp4",
        "fast 1": "fast_2.mp4",
        "fast 2": "fast_1.mp4",
    }
    assert places == merged
    # Where both move one clip, the saved move stays until the other is chosen.
    other.reload()
    spot(first, "slow, no. 1: slow_2.mp4").drag_to(spot(first, "fast, no. 1: fast_2.mp4"))
    spot(other, "slow, no. 1: slow_2.mp4").drag_to(spot(other, "fast, no. 2: fast_1.mp4"))
    _, theirs = saved(other, dashboard, "met", 4)
    first.get_by_role("button", name=SAVE).click()
    expect(first.get_by_text("You both moved clips: slow_2.mp4")).to_be_visible()
    expect(first.get_by_text("Saved as version 4.")).to_be_visible()
    expect(spot(first, "fast, no. 2: slow_2.mp4")).to_be_visible()
    assert theirs["fast 2"] == "slow_2.mp4"
    assert axe_violations(first) == []
    first.reload()  # before anybody has chosen: both sides are still there
    expect(first.get_by_text("You both moved clips: slow_2.mp4")).to_be_visible()
    first.get_by_role("group", name="Clips that you both moved").get_by_text("Yours", exact=True).click()
    expect(spot(first, "fast, no. 1: slow_2.mp4")).to_be_visible()
    _, places = saved(first, dashboard, "met", 5)
    assert places == merged | {"slow 1": "fast_2.mp4", "fast 1": "slow_2.mp4"}
    other.close()
