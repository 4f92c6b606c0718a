"""A clip that was chosen by mistake is left out before the study is made, put back, and left out again."""

from pathlib import Path

import pytest
from playwright.sync_api import expect

from tests.browser.admin.conftest import Dashboard
from tests.browser.admin.test_own_videos import shoot
from tests.browser.visit import axe_violations
from tests.helpers.videos import write_video

pytestmark = pytest.mark.browser
NAMES = ("Ärm_schnell_1.mp4", "Ärm_langsam_1.mp4", "Örm_schnell_1.mp4", "Örm_langsam_1.mp4", "Probe.mp4")


def test_a_clip_chosen_by_mistake_is_left_out_and_what_was_typed_stays(
    dashboard: Dashboard, tmp_path: Path
) -> None:
    videos = [write_video(tmp_path / name, "libx264", size_px=(320, 120)) for name in NAMES]
    page = dashboard.open("/studies/new")
    page.get_by_label("Short name").fill("left-out")
    page.get_by_role("tab", name="From your own clips").click()
    panel = page.get_by_role("tabpanel", name="From your own clips")
    files = panel.locator('input[type="file"]').first
    files.set_input_files(videos[1:])
    expect(panel.get_by_text("4 clips uploaded")).to_be_visible(timeout=60_000)
    title = panel.get_by_label("Title of the study")
    title.fill("Ohne Probe")

    panel.get_by_text("Review the files, or leave some out").click()
    panel.get_by_role("button", name="Leave out Probe.mp4").press("Enter")
    expect(panel.get_by_text("3 clips uploaded")).to_be_visible()
    expect(panel.get_by_role("status", name="Left out")).to_contain_text("Probe.mp4 is left out.")
    expect(panel.get_by_label("Pattern", exact=True)).to_have_value("{factor1}_{factor2}_1.mp4")
    expect(panel.get_by_role("region", name="Result for each file")).to_be_focused()
    assert axe_violations(page) == []
    shoot(dashboard, "left-out")

    panel.get_by_role("button", name="Put back Probe.mp4").click()
    expect(panel.get_by_text("4 clips uploaded")).to_be_visible()
    expect(panel.get_by_role("button", name="Put back Probe.mp4")).to_have_count(0)
    panel.get_by_role("button", name="Leave out Probe.mp4").click()
    page.reload()  # what is left out stays so
    page.get_by_label("Short name").fill("left-out")
    page.get_by_role("tab", name="From your own clips").click()
    expect(panel.get_by_role("button", name="Put back Probe.mp4")).to_be_visible()

    title.fill("Ohne Probe")
    files.set_input_files(videos[:1])  # one that was forgotten
    expect(panel.get_by_text("4 clips uploaded")).to_be_visible(timeout=60_000)
    expect(title).to_have_value("Ohne Probe")
    panel.get_by_label("What are Ärm, Örm?").fill("Figur")
    panel.get_by_role("button", name="Create", exact=True).click()
    page.get_by_text("left-out, version 1").wait_for()
    page.get_by_role("tab", name="Clips").click()
    expect(page.get_by_text("4 clips", exact=True)).to_be_visible()


def test_a_file_that_is_not_a_clip_keeps_no_other_from_coming(dashboard: Dashboard, tmp_path: Path) -> None:
    """A picture among clips stopped the upload for good: those behind it never came."""
    page = dashboard.open("/studies/new")
    page.get_by_label("Short name").fill("unfinished")
    page.get_by_role("tab", name="From your own clips").click()
    panel = page.get_by_role("tabpanel", name="From your own clips")
    videos = [write_video(tmp_path / name, "libx264", size_px=(320, 120)) for name in NAMES[:3]]
    (tmp_path / "poster.png").write_bytes(b"no film")
    panel.locator('input[type="file"]').first.set_input_files(
        [videos[0], tmp_path / "poster.png", *videos[1:]]
    )
    expect(panel.get_by_text("3 clips uploaded")).to_be_visible(timeout=60_000)
    refused = panel.get_by_role("alert").filter(has_text="1 of the files left out")
    expect(refused).to_contain_text("'poster.png' is neither a video")
    panel.get_by_label("Title of the study").fill("Unfinished")
    panel.get_by_role("button", name="Create", exact=True).click()
    expect(panel.get_by_text("expected clips in all 4 cells of the design, got 3 of them")).to_be_visible()
    assert axe_violations(page) == []
    panel.get_by_role("button", name="Start over").click()


def test_all_clips_can_be_left_out_and_come_back(dashboard: Dashboard, tmp_path: Path) -> None:
    page = dashboard.open("/studies/new")
    page.get_by_role("tab", name="From your own clips").click()
    panel = page.get_by_role("tabpanel", name="From your own clips")
    video = write_video(tmp_path / "a_1.mp4", "libx264", size_px=(320, 120))
    panel.locator('input[type="file"]').first.set_input_files(video)
    panel.get_by_text("Review the files, or leave some out").click(timeout=60_000)
    panel.get_by_role("button", name="Leave out a_1.mp4").click(timeout=60_000)
    expect(panel.get_by_text("0 clips uploaded")).to_be_visible()
    expect(panel.get_by_text("Still needed: clips that have been checked")).to_be_visible()
    panel.get_by_role("button", name="Put back a_1.mp4").click()
    expect(panel.get_by_text("1 clip uploaded")).to_be_visible()
    panel.get_by_role("button", name="Start over").click()
    expect(panel.get_by_role("button", name="Start over")).to_have_count(0)
