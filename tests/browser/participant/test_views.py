"""The view ledger: whatever happens to page, server or device, no view is lost and none is given twice."""

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, BrowserContext, Page, expect

from tests.browser.served import LATEST_RUN, Served, go_back, reload_in_next_clip, serve, start_clip
from tests.browser.server_process import ServerProcess
from tests.browser.studies import PLAIN, without
from tests.browser.visit import Visit, axe_violations

pytestmark = pytest.mark.browser
SHORT, MIDDLE, LONG = 20, 60, 100
"""Frames of clips, 30 a second: longer ones where something happens while they play."""
PLAIN_TRIALS = without(
    PLAIN,
    ("trials = 1", "trials = 0"),
    ("[playback]", "[playback]\nfail_on_focus_lost = false"),
)
FULL_SCREEN = without(PLAIN_TRIALS, ("full_screen = false", "full_screen = true"))
TWO_TRIALS = without(PLAIN_TRIALS, ('split_by = "character"\n', ""), ("per_cell = 3", "per_cell = 1"))
UNEVEN = {f"{how}_{what}" for how in ("flagged", "failed") for what in ("longest_gap_ms", "missing_frames")}
"""Rules that a slow machine's pictures may break before the disturbance is asked about."""
STUDIES = {
    "short_clips": (PLAIN_TRIALS, SHORT),
    "long_clips": (PLAIN_TRIALS, LONG),
    "two_trials": (TWO_TRIALS, MIDDLE),
    "full_screen": (FULL_SCREEN, LONG),
}


@pytest.fixture(scope="module")
def studies(tmp_path_factory: pytest.TempPathFactory, built_page: Path) -> Iterator[Served]:
    with serve(tmp_path_factory.mktemp("views"), STUDIES) as served:
        yield served


def rated(studies: Served, count: int = 0) -> list[dict[str, Any]]:
    return studies.rows_of_latest("ratings", "time_elapsed, play", count)


def on_line(_page: Page, _server: ServerProcess) -> None:
    """Nothing is away."""


def off_line(page: Page, _server: ServerProcess) -> None:
    page.context.set_offline(True)


def killed(_page: Page, server: ServerProcess) -> None:
    server.kill()


def restored(page: Page, server: ServerProcess) -> None:
    page.context.set_offline(False)
    if server.process is None:
        server.start()


@pytest.mark.parametrize("away", [on_line, off_line, killed])
def test_a_reload_on_the_scale_returns_to_the_scale(
    studies: Served, page: Page, away: Callable[[Page, ServerProcess], None]
) -> None:
    server = studies.server
    visit = studies.visit("short_clips", page)
    page.evaluate("navigator.serviceWorker.ready.then(() => true)")
    away(page, server)
    start_clip(page)
    page.wait_for_selector(".scale")
    page.reload()
    go_back(page)
    page.wait_for_selector(".scale")
    assert "already seen" in page.inner_text(".above")
    assert page.query_selector(".ready") is None
    restored(page, server)
    page.keyboard.press("2")
    page.wait_for_selector(".ready, .break")
    [row] = rated(studies, 1)
    assert (row["response"], row["views"], row["view_outcomes"], row["rt"]) == (2, 1, "shown", None)
    assert json.loads(row["disturbances"])["scale_reloaded"] == 1
    assert row["verdict"] == "flagged"
    assert row["verdict_rule"] in ("scale_reloaded", "focus_lost")
    assert [view["outcome"] for view in studies.views()] == ["shown"]
    assert visit.problems == [] or away is not on_line


def test_a_reload_in_mid_clip_ends_the_view_and_the_trial_comes_again(studies: Served, page: Page) -> None:
    visit = studies.visit("two_trials", page)
    reload_in_next_clip(page)
    page.keyboard.press(" ")
    page.wait_for_selector("text=Clips done: 0 of 2")
    go_back(page)
    visit.trials()
    rows = rated(studies)
    first, other, again = rows
    assert (first["play"], first["response"], first["verdict_rule"]) == (1, None, "interrupted")
    assert (again["trial_index"], again["play"]) == (first["trial_index"], 2), "at the end of its block"
    assert (again["response"], again["views"], again["view_outcomes"]) == (4, 2, "shown")
    assert (other["response"], other["play"], other["views"]) == (4, 1, 1)
    of_first = [view for view in studies.views() if view["trial_index"] == first["trial_index"]]
    assert [(view["number"], view["outcome"]) for view in of_first] == [(1, "interrupted"), (2, "shown")]


def test_a_repeat_that_is_interrupted_too_ends_its_trial_and_the_run_goes_on(
    studies: Served, page: Page
) -> None:
    visit = studies.visit("two_trials", page)
    for _ in range(3):
        reload_in_next_clip(page)
        page.keyboard.press(" ")
        go_back(page)
        page.wait_for_selector(".ready")
    visit.trials()
    # The other trial's repeat is still to come, and with it whatever waits to be shown again.
    first, other, again, last = ((row["trial_index"], row["play"]) for row in rated(studies, 4))
    assert (again, last) == ((first[0], 2), (other[0], 2))
    assert [row["verdict_rule"] for row in rated(studies, 4)][:3] == ["interrupted"] * 3
    assert [row["response"] for row in rated(studies, 4)] == [None, None, None, 4]
    assert [view["outcome"] for view in studies.views()] == [*["interrupted"] * 3, "shown"]
    assert visit.problems == []


def test_another_device_answers_what_the_first_has_shown(
    studies: Served, chromium: Browser, page: Page
) -> None:
    server = studies.server
    link = server.link(studies.studies["short_clips"], "personal")
    studies.visit_by(link, page)
    start_clip(page)
    page.wait_for_selector(".scale")
    ended = f"SELECT 1 AS one FROM views WHERE study_run_id = {LATEST_RUN} AND outcome = 'shown'"
    assert len(server.rows_soon(ended, 1)) == 1
    other = chromium.new_context(locale="en-GB")
    elsewhere = other.new_page()
    Visit(elsewhere, server.address).open(link)
    go_back(elsewhere)
    elsewhere.wait_for_selector(".scale")
    assert axe_violations(elsewhere) == []
    elsewhere.keyboard.press("6")
    elsewhere.wait_for_selector(".ready, .break")
    [row] = rated(studies, 1)
    other.close()
    assert (row["response"], row["views"], row["view_outcomes"]) == (6, 1, "shown")


def test_a_second_tab_answers_what_the_first_has_shown(
    studies: Served, context: BrowserContext, page: Page
) -> None:
    studies.visit("short_clips", page)
    start_clip(page)
    page.wait_for_selector(".scale")
    second = context.new_page()
    Visit(second, studies.server.address).open(studies.studies["short_clips"].link_token)
    second.get_by_role("button", name="Continue here").click()
    go_back(second)
    second.wait_for_selector(".scale")
    second.keyboard.press("3")
    second.wait_for_selector(".ready, .break")
    [row] = rated(studies, 1)
    assert (row["response"], row["views"], row["view_outcomes"]) == (3, 1, "shown")


@pytest.fixture
def window(chromium: Browser) -> Iterator[Page]:
    """A page on a screen larger than its window: else the window counts as full screen already."""
    opened = chromium.new_context(
        viewport={"width": 1280, "height": 800}, screen={"width": 1920, "height": 1200}, locale="en-GB"
    )
    yield opened.new_page()
    opened.close()


CLIP_SIZE = "[document.querySelector('.clip')].map((clip) => [clip.offsetWidth, clip.offsetHeight])[0]"


def narrower(page: Page) -> None:
    page.set_viewport_size({"width": int(page.evaluate(CLIP_SIZE)[0] * 0.7), "height": 800})


def zoomed(page: Page) -> None:
    changed = {"width": 1280, "height": 800, "deviceScaleFactor": 2, "mobile": False}
    page.context.new_cdp_session(page).send("Emulation.setDeviceMetricsOverride", changed)


def other_tab(page: Page) -> None:
    # Playwright makes every page believe that it has the focus.
    page.context.new_cdp_session(page).send("Emulation.setFocusEmulationEnabled", {"enabled": False})
    page.context.new_page().bring_to_front()
    page.bring_to_front()


def as_before(page: Page) -> None:
    page.set_viewport_size({"width": 1280, "height": 800})


def disturbed_view(
    studies: Served, page: Page, disturb: Callable[[Page], object], number: int, *, before: bool = False
) -> set[str]:
    """What is stored to have disturbed the view of the run's next trial, in or before which this happens."""
    page.wait_for_selector(".ready")
    if before:
        disturb(page)
    start_clip(page)
    if not before:
        disturb(page)
    page.wait_for_selector(".scale")
    as_before(page)
    page.keyboard.press("4")
    row = rated(studies, number)[-1]
    seen: dict[str, Any] = json.loads(row["disturbances"])
    assert row["verdict"] in ("flagged", "failed")
    assert row["verdict_rule"] in {*seen, *UNEVEN}
    view = studies.views(number)[-1]
    assert set(seen) == set(json.loads(view["disturbances"]))
    return set(seen)


def test_what_disturbs_a_view_is_recorded_and_flags_it(studies: Served, window: Page) -> None:
    studies.visit("long_clips", window)
    assert "focus_lost" in disturbed_view(studies, window, other_tab, 1)
    assert {"window_too_small", "clip_cut_off"} <= disturbed_view(studies, window, narrower, 2)
    assert "zoomed" in disturbed_view(studies, window, zoomed, 3)


def test_a_zoom_before_the_start_key_disturbs_the_view_too(studies: Served, window: Page) -> None:
    studies.visit("long_clips", window)
    assert "zoomed" in disturbed_view(studies, window, zoomed, 1, before=True)


def test_a_clip_without_a_measured_size_follows_the_window_until_its_start(
    studies: Served, window: Page
) -> None:
    studies.visit("short_clips", window)
    clip = window.locator(".clip")
    width, height = window.evaluate(CLIP_SIZE)
    window.set_viewport_size({"width": width // 2, "height": 800})
    expect(clip).to_have_css("width", f"{width // 2}px")
    expect(clip).to_have_css("height", f"{height // 2}px")
    as_before(window)
    expect(clip).to_have_css("width", f"{width}px")


def in_window_of(page: Page, width: int, height: int) -> None:
    """The window alone: Playwright would change the screen's size with it."""
    screen = {"screenWidth": 1920, "screenHeight": 1200, "deviceScaleFactor": 1, "mobile": False}
    changed = {"width": width, "height": height, **screen}
    page.context.new_cdp_session(page).send("Emulation.setDeviceMetricsOverride", changed)
    page.wait_for_function(f"innerWidth === {width} && innerHeight === {height}")


def zoomed_by_fingers(page: Page, scale: float) -> None:
    page.context.new_cdp_session(page).send("Emulation.setPageScaleFactor", {"pageScaleFactor": scale})
    page.wait_for_function(f"Math.abs(visualViewport.scale - {scale}) < 0.01")


@pytest.mark.parametrize(
    ("width", "height", "seen"),
    [(200, 800, {"clip_scaled_down"}), (1280, 70, {"window_too_small", "clip_cut_off"})],
)
def test_a_clip_larger_than_the_window_is_not_good(
    studies: Served, window: Page, width: int, height: int, seen: set[str]
) -> None:
    studies.visit("short_clips", window)
    in_window_of(window, width, height)
    assert disturbed_view(studies, window, lambda _: None, 1, before=True) == seen


def test_a_clip_that_fingers_had_zoomed_before_its_trial_is_not_good(studies: Served, window: Page) -> None:
    studies.visit("short_clips", window)
    zoomed_by_fingers(window, 2.5)
    for number in (1, 2):
        # The second trial begins in a page that is zoomed already: nothing changes any more.
        seen = disturbed_view(studies, window, lambda _: None, number)
        assert seen == {"zoomed", "clip_cut_off"}


def leave_full_screen(page: Page) -> None:
    page.evaluate("document.exitFullscreen()")
    # Asked from outside: the page's policy lets no function be waited for that is not true at once.
    expect(page.locator(":fullscreen")).to_have_count(0)


@pytest.mark.parametrize("before", [False, True], ids=["in the clip", "before the start key"])
def test_full_screen_left_is_recorded_and_flags_the_view(studies: Served, window: Page, before: bool) -> None:
    visit = Visit(window, studies.server.address).open(studies.studies["full_screen"].link_token).begin()
    window.wait_for_selector("text=Go to full screen")
    window.click(".primary")
    visit.instructions()
    assert "full_screen_left" in disturbed_view(studies, window, leave_full_screen, 1, before=before)


def test_an_undisturbed_view_is_recorded_as_one(studies: Served, page: Page) -> None:
    visit = studies.visit("short_clips", page)
    visit.rate("4")
    [row] = rated(studies, 1)
    assert (row["views"], row["view_outcomes"]) == (1, "shown")
    assert set(json.loads(row["disturbances"])) <= {"refresh_dropped"}
