"""The view ledger: whatever happens to page, server or device, no view is lost and none is given twice."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, BrowserContext, Page

from tests.browser.server_process import ServerProcess
from tests.browser.studies import PLAIN
from tests.browser.visit import Visit, axe_violations

pytestmark = pytest.mark.browser
FRAMES = 60
LONG = 150
"""Frames of clips in the midst of which something happens: five seconds, for slow machines."""
RATED = (
    "SELECT trial_index, play, response, views, view_outcomes, disturbances, verdict, verdict_rule, rt "
    "FROM ratings WHERE kind = 'main' ORDER BY time_elapsed, play"
)
VIEWS = (
    "SELECT v.trial_index, v.number, v.play, v.outcome FROM views v JOIN assigned_trials a "
    "ON a.study_run_id = v.study_run_id AND a.trial_index = v.trial_index WHERE a.kind = 'main' ORDER BY v.id"
)


def in_front_of_a_trial(
    server: ServerProcess, folder: Path, page: Page, kind: str = "general", frames: int = FRAMES
) -> tuple[Visit, str]:
    """A visit in front of its first main trial, with clips of so many frames."""
    study = server.add_study(folder, PLAIN, frames=frames)
    server.start()
    link = study.link_token if kind == "general" else server.link(study, "personal")
    visit = Visit(page, server.address).open(link).begin().instructions().practice()
    page.wait_for_selector(".ready")
    return visit, link


def start_clip(page: Page) -> None:
    page.wait_for_selector(".ready")
    page.keyboard.press(" ")
    page.wait_for_selector(".trial.playing")


def go_back(page: Page) -> None:
    """From the page that says welcome back to the trials."""
    page.wait_for_selector(".prose h1, .prose h2")
    page.click(".primary")


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
    server: ServerProcess, tmp_path: Path, page: Page, away: Callable[[Page, ServerProcess], None]
) -> None:
    visit, _ = in_front_of_a_trial(server, tmp_path / "clips", page)
    page.evaluate("navigator.serviceWorker.ready.then(() => true)")
    away(page, server)
    start_clip(page)
    page.wait_for_selector(".scale")
    page.wait_for_timeout(300)
    page.reload()
    go_back(page)
    page.wait_for_selector(".scale")
    assert "already seen" in page.inner_text(".above")
    assert page.query_selector(".ready") is None
    restored(page, server)
    page.keyboard.press("2")
    page.wait_for_selector(".ready, .break")
    [row] = server.rows_soon(RATED, 1)
    assert (row["response"], row["views"], row["view_outcomes"], row["rt"]) == (2, 1, "shown", None)
    assert json.loads(row["disturbances"])["scale_reloaded"] == 1
    assert (row["verdict"], row["verdict_rule"]) in (("flagged", "scale_reloaded"), ("failed", "focus_lost"))
    assert [view["outcome"] for view in server.rows(VIEWS)] == ["shown"]
    assert visit.problems == [] or away is not on_line


def test_a_reload_in_mid_clip_ends_the_view_and_the_trial_comes_again(
    server: ServerProcess, tmp_path: Path, page: Page
) -> None:
    visit, _ = in_front_of_a_trial(server, tmp_path / "clips", page, frames=LONG)
    start_clip(page)
    page.wait_for_timeout(400)
    page.reload()
    go_back(page)
    visit.trials()
    rows = server.rows(RATED)
    first = rows[0]
    assert (first["play"], first["response"], first["verdict_rule"]) == (1, None, "interrupted")
    again = next(row for row in rows if row["trial_index"] == first["trial_index"] and row["play"] == 2)
    assert (again["response"], again["views"], again["view_outcomes"]) == (4, 2, "shown")
    assert sorted(row["trial_index"] for row in rows if row["response"]) == sorted(
        {row["trial_index"] for row in rows}
    )
    of_first = [row for row in server.rows(VIEWS) if row["trial_index"] == first["trial_index"]]
    assert [(view["number"], view["outcome"]) for view in of_first] == [(1, "interrupted"), (2, "shown")]


def test_another_device_answers_what_the_first_has_shown(
    server: ServerProcess, tmp_path: Path, chromium: Browser, page: Page
) -> None:
    _, link = in_front_of_a_trial(server, tmp_path / "clips", page, kind="personal")
    start_clip(page)
    page.wait_for_selector(".scale")
    assert len(server.rows_soon(f"{VIEWS.replace('WHERE', 'WHERE v.outcome IS NOT NULL AND')}", 1)) == 1
    other = chromium.new_context(locale="en-GB")
    elsewhere = other.new_page()
    Visit(elsewhere, server.address).open(link)
    go_back(elsewhere)
    elsewhere.wait_for_selector(".scale")
    assert axe_violations(elsewhere) == []
    elsewhere.keyboard.press("6")
    elsewhere.wait_for_selector(".ready, .break")
    [row] = server.rows_soon(RATED, 1)
    other.close()
    assert (row["response"], row["views"], row["view_outcomes"]) == (6, 1, "shown")


def test_a_second_tab_answers_what_the_first_has_shown(
    server: ServerProcess, tmp_path: Path, context: BrowserContext, page: Page
) -> None:
    _, link = in_front_of_a_trial(server, tmp_path / "clips", page)
    start_clip(page)
    page.wait_for_selector(".scale")
    second = context.new_page()
    Visit(second, server.address).open(link)
    second.click("text=Go on here")
    go_back(second)
    second.wait_for_selector(".scale")
    second.keyboard.press("3")
    second.wait_for_selector(".ready, .break")
    [row] = server.rows_soon(RATED, 1)
    assert (row["response"], row["views"], row["view_outcomes"]) == (3, 1, "shown")


def smaller(page: Page) -> None:
    box = page.locator(".clip").bounding_box()
    assert box is not None
    page.set_viewport_size({"width": int(box["width"] * 0.7), "height": int(box["height"] * 0.7)})


def zoomed(page: Page) -> None:
    changed = {"width": 1280, "height": 800, "deviceScaleFactor": 2, "mobile": False}
    page.context.new_cdp_session(page).send("Emulation.setDeviceMetricsOverride", changed)


def full_screen_left(page: Page) -> None:
    page.evaluate("document.exitFullscreen()")


def other_tab(page: Page) -> None:
    # Playwright makes every page believe that it has the focus.
    page.context.new_cdp_session(page).send("Emulation.setFocusEmulationEnabled", {"enabled": False})
    page.context.new_page().bring_to_front()
    page.bring_to_front()


DISTURBED: list[tuple[Callable[[Page], None], set[str], str]] = [
    (smaller, {"window_too_small", "clip_cut_off"}, ""),
    (zoomed, {"zoomed"}, ""),
    (full_screen_left, {"full_screen_left"}, "full_screen = true"),
    (other_tab, {"focus_lost"}, ""),
]


@pytest.mark.parametrize(("disturb", "names", "display"), DISTURBED)
def test_what_disturbs_a_view_is_recorded_and_flags_it(
    server: ServerProcess,
    tmp_path: Path,
    chromium: Browser,
    disturb: Callable[[Page], None],
    names: set[str],
    display: str,
) -> None:
    rules = "[playback]\nfail_on_focus_lost = false\n\n[display]"
    declared = PLAIN.replace("[display]", rules)
    if display:
        declared = declared.replace("full_screen = false", display)
    study = server.add_study(tmp_path / "clips", declared, frames=LONG)
    server.start()
    # A screen larger than the window: else the window counts as full screen already.
    context = chromium.new_context(
        viewport={"width": 1280, "height": 800}, screen={"width": 1920, "height": 1200}, locale="en-GB"
    )
    page = context.new_page()
    visit = Visit(page, server.address).open(study.link_token).begin()
    if display:
        page.wait_for_selector("text=Go to full screen")
        page.click(".primary")
    visit.instructions().practice()
    start_clip(page)
    page.wait_for_timeout(300)
    disturb(page)
    page.wait_for_selector(".scale")
    page.keyboard.press("4")
    [row] = server.rows_soon(RATED, 1)
    seen: dict[str, Any] = json.loads(row["disturbances"])
    assert names <= set(seen)
    assert row["verdict"] in ("flagged", "failed")
    assert row["verdict_rule"] in {*seen, "failed_longest_gap_ms", "failed_missing_frames"}
    [view] = server.rows_soon("SELECT disturbances FROM views ORDER BY id DESC LIMIT 1", 1)
    assert names <= set(json.loads(view["disturbances"]))
    context.close()


def test_an_undisturbed_view_is_recorded_as_one(server: ServerProcess, tmp_path: Path, page: Page) -> None:
    visit, _ = in_front_of_a_trial(server, tmp_path / "clips", page)
    visit.rate("4")
    [row] = server.rows_soon(RATED, 1)
    assert (row["views"], row["view_outcomes"]) == (1, "shown")
    assert set(json.loads(row["disturbances"])) <= {"refresh_dropped"}
