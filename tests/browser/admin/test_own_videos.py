"""Own videos of several formats in the real page: uploaded, converted, reported, made a study, shown."""

import hashlib
import os
from pathlib import Path

import pytest
from playwright.sync_api import Route, expect

from tests.browser.admin.conftest import Dashboard
from tests.browser.visit import axe_violations
from tests.helpers.videos import write_sound, write_video

pytestmark = pytest.mark.browser
CODECS = {"slow_1.webm": "libvpx-vp9", "slow_2.mp4": "libx264", "fast_1.avi": "mpeg4", "fast_2.mkv": "ffv1"}


@pytest.fixture(scope="module")
def videos(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folder = tmp_path_factory.mktemp("videos")
    return [write_video(folder / name, codec, size_px=(320, 120)) for name, codec in CODECS.items()]


def shoot(dashboard: Dashboard, name: str) -> None:
    folder = os.environ.get("SCREENSHOTS")
    if not folder:
        return
    page = dashboard.page
    for width in (1440, 390):
        for scheme in ("light", "dark"):
            page.set_viewport_size({"width": width, "height": 900})
            page.emulate_media(color_scheme="dark" if scheme == "dark" else "light")
            page.wait_for_timeout(200)
            page.screenshot(path=Path(folder) / f"{name}-{width}-{scheme}.png")
    page.emulate_media(color_scheme="light")
    page.set_viewport_size({"width": 1280, "height": 800})


def test_videos_of_any_format_become_a_study(
    dashboard: Dashboard, videos: list[Path], tmp_path: Path
) -> None:
    page = dashboard.open("/studies/new")
    page.get_by_label("Short name").fill("mixed")
    page.get_by_role("tab", name="From your own clips").click()
    panel = page.get_by_role("tabpanel", name="From your own clips")
    files = panel.locator('input[type="file"]').first
    files.set_input_files([*videos, write_sound(tmp_path / "fast_3.mp4")])
    expect(panel.get_by_text("3 converted, 1 unusable")).to_be_visible(timeout=60_000)
    table = panel.get_by_role("region", name="Result for each file")
    expect(table.get_by_text("it holds audio and no picture; expected a video")).to_be_visible()
    assert axe_violations(page) == []
    shoot(dashboard, "upload-refused")

    corrected = tmp_path / "fast_4.mp4"
    corrected.write_bytes(next(path for path in videos if path.suffix == ".mp4").read_bytes())
    table.get_by_label("Replace fast_3.mp4 by").set_input_files(corrected)
    expect(panel.get_by_text("5 clips uploaded: 2 unchanged, 3 converted")).to_be_visible(timeout=60_000)
    expect(table.get_by_text("fast_3.mp4")).to_have_count(0)

    panel.get_by_role("button", name="Start over").click()
    files.set_input_files(videos)
    expect(panel.get_by_text("4 clips uploaded: 1 unchanged, 3 converted")).to_be_visible(timeout=60_000)
    panel.get_by_text("Review the files, or leave some out").click()
    expect(table.get_by_text("encoded as H.264, was vp9")).to_be_visible()
    page.reload()  # what was sent is still there
    page.get_by_label("Short name").fill("mixed")
    page.get_by_role("tab", name="From your own clips").click()
    expect(panel.get_by_text("4 clips uploaded")).to_be_visible(timeout=60_000)
    panel.get_by_label("Pattern", exact=True).fill("{speed}_{exemplar}.mp4")
    panel.get_by_label("Title of the study").fill("Mixed formats")
    shoot(dashboard, "upload-converted")
    panel.get_by_role("button", name="Create").click()

    page.get_by_text("mixed, version 1").wait_for()
    page.get_by_role("tab", name="Clips").click()
    expect(page.get_by_role("link", name="slow_1.webm")).to_be_visible()
    expect(page.get_by_role("link", name="Frame map")).to_have_count(3)
    with page.expect_download() as download:
        page.get_by_role("link", name="slow_1.webm").click()
    assert download.value.suggested_filename == "slow_1.webm"
    assert download.value.path().read_bytes() == videos[0].read_bytes()
    assert (
        page.evaluate("Promise.all([...document.querySelectorAll('video')].map((video) => video.error))")
        == [None] * 4
    )
    assert axe_violations(page) == []
    shoot(dashboard, "clips-converted")


def test_a_clip_that_the_participant_page_does_not_play_is_named_with_its_reason(
    dashboard: Dashboard, tmp_path: Path
) -> None:
    """As where a browser plays less than the server's rule says: one clip reaches it as QuickTime."""
    page = dashboard.page
    clips = [
        write_video(tmp_path / f"{speed}_1.mp4", size_px=(320, 120)) for speed in ("slow", "fast", "odd")
    ]
    clips[2].write_bytes(write_video(tmp_path / "b.mp4", size_px=(320, 120), frames=7).read_bytes())
    broken = hashlib.sha256(clips[2].read_bytes()).hexdigest()

    def as_quicktime(route: Route) -> None:
        content = clips[2].read_bytes()
        route.fulfill(body=content[:8] + b"qt  " + content[12:], content_type="application/octet-stream")

    page.route(f"**/api/admin/uploads/*/clips/{broken}", as_quicktime)
    dashboard.open("/studies/new")
    page.get_by_label("Short name").fill("played")
    page.get_by_role("tab", name="From your own clips").click()
    panel = page.get_by_role("tabpanel", name="From your own clips")
    panel.locator('input[type="file"]').first.set_input_files(clips)
    expect(panel.get_by_text("2 unchanged, 1 unusable")).to_be_visible(timeout=60_000)
    table = panel.get_by_role("region", name="Result for each file")
    expect(table.get_by_text("the participant's page does not play it in this browser")).to_have_count(1)
    expect(table.get_by_text("unsupported or unrecognizable format")).to_be_visible()
    panel.get_by_label("Pattern", exact=True).fill("{speed}_{exemplar}.mp4")
    panel.get_by_label("Title of the study").fill("Played")
    expect(panel.get_by_text("another file for each clip that does not play")).to_be_visible()
    expect(panel.get_by_role("button", name="Create")).to_be_disabled()
    assert axe_violations(page) == []
    table.get_by_label("Leave out odd_1.mp4").click()
    expect(panel.get_by_text("2 clips uploaded.")).to_be_visible(timeout=60_000)
    expect(panel.get_by_role("button", name="Create")).to_be_enabled(timeout=60_000)
