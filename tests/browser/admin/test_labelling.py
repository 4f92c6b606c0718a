"""The labelling page and the blink review page: files opened in the page, work saved, read by `stimuli`."""

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from playwright.sync_api import Page, expect

from stimuli_builder.actor.recording import Actor, ActorOptions, truth_points, write_video
from stimuli_builder.blinks.labelling import preset
from stimuli_builder.blinks.run import BlinksJob, run_blinks
from stimuli_builder.tracking.labels import load_labels
from tests.browser.admin.conftest import Dashboard
from tests.browser.admin.test_walk import shoot
from tests.browser.visit import axe_violations
from tests.helpers.tiny_clips import BARCODE_BITS, BARCODE_CELL_PX, encoded_video

pytestmark = pytest.mark.browser
FRAMES, SIZE = 12, (256, 96)
READ_BARCODE = """(canvas) => {
  const context = canvas.getContext("2d");
  const scale = Math.min(canvas.width / 256, canvas.height / 96);
  const [left, top] = [(canvas.width - 256 * scale) / 2, (canvas.height - 96 * scale) / 2];
  const at = (place) => [left + (place + 0.5) * CELL * scale, top + 88 * scale, 1, 1];
  const bit = (place) => context.getImageData(...at(place)).data[0];
  return Array.from({ length: BITS + 2 }, (_, place) => (bit(place) > 127 ? 1 : 0));
}""".replace("CELL", str(BARCODE_CELL_PX)).replace("BITS", str(BARCODE_BITS))


def open_file(page: Page, label: str, path: Path) -> None:
    page.locator(f'input[aria-label="{label}"]').set_input_files(path)


def saved(page: Page, button: str, path: Path) -> Path:
    with page.expect_download() as download:
        page.get_by_role("button", name=button).click()
    download.value.save_as(path)
    return path


def place_of(page: Page, point: int) -> tuple[float, float]:
    label = page.locator(f'circle.point[data-point="{point}"]').get_attribute("aria-label") or ""
    x, y = re.findall(r"[xy] (-?[\d.]+)", label)
    return float(x), float(y)


def shown_frame(page: Page) -> int:
    bits = page.locator(".stage canvas").evaluate(READ_BARCODE)
    assert bits[:2] == [1, 0]
    return sum(bit << place for place, bit in enumerate(bits[2:]))


def test_points_are_labelled_undone_and_saved_as_stimuli_reads_them(
    dashboard: Dashboard, tmp_path: Path
) -> None:
    video = tmp_path / "eyes.mp4"
    video.write_bytes(encoded_video(FRAMES, 30))
    dashboard.complaints.clear()
    page = dashboard.open("/labelling")
    open_file(page, "Open video", video)
    third = page.locator('circle.point[data-point="2"]')
    third.focus(timeout=60_000)
    assert axe_violations(page) == []
    assert shown_frame(page) == 0

    x, y = place_of(page, 2)
    page.keyboard.press("ArrowUp")
    page.keyboard.press("Shift+ArrowLeft")
    assert place_of(page, 2) == pytest.approx((x - 10, y - 1), abs=0.11)
    page.keyboard.press("Control+z")
    assert place_of(page, 2) == pytest.approx((x, y - 1), abs=0.11)
    page.keyboard.press("Control+Shift+z")
    page.keyboard.press("Control+z")

    page.locator('circle.point[data-point="7"]').focus()
    page.keyboard.press("Shift+ArrowUp")
    page.keyboard.press("Shift+ArrowUp")
    page.keyboard.press("a")
    expect(page.get_by_text("lower-lid point 8 lies above the upper lid")).to_be_visible()
    page.keyboard.press("Control+z")
    page.keyboard.press("Control+z")

    # In the view of the whole frame, where points overlap, a press on a center takes that point.
    page.get_by_role("button", name="Whole frame").click()
    for number in range(18):
        point = page.locator(f'circle.point[data-point="{number}"]')
        box = point.bounding_box()
        assert box is not None
        page.mouse.click(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
        expect(point).to_have_attribute("aria-pressed", "true")

    before = place_of(page, 0)
    box = page.locator('circle.point[data-point="0"]').bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.mouse.down()
    page.mouse.move(box["x"] + 3, box["y"] + 30, steps=4)
    page.mouse.up()
    dragged = place_of(page, 0)
    assert dragged[1] > before[1] + 1

    for accepted in range(5):
        expect(page.get_by_text(f"{accepted} of {FRAMES} frames accepted")).to_be_visible()
        page.keyboard.press("a")
        expect(page.get_by_text(f"Frame {accepted + 1} of {FRAMES}")).to_be_visible()
        page.locator(".stage").wait_for()
    expect(page.get_by_text("Proposed from the labeled frames")).to_be_visible()
    assert shown_frame(page) == 5
    shoot(dashboard, "labelling")

    labels = load_labels(saved(page, "Save labels", tmp_path / "l.json"), SIZE, FRAMES)
    assert sorted(labels.frames) == [0, 1, 2, 3, 4]
    assert labels.frames[0][2] == pytest.approx((x, y - 1), abs=0.11)
    assert labels.frames[0][0] == pytest.approx(dragged, abs=0.11)

    open_file(page, "Open labels", tmp_path / "l.json")
    expect(page.get_by_text(f"5 of {FRAMES} frames accepted")).to_be_visible()
    assert dashboard.complaints == []


def test_the_first_points_lie_on_eyes_that_blink(dashboard: Dashboard, tmp_path: Path) -> None:
    """A face never labelled before: the shape lies on its eyes, closed in their blinks, which are chosen."""
    actor = Actor(ActorOptions(seconds=6.5, fps=30, seed=1))
    write_video(actor, tmp_path / "actor.mp4", lambda: None)
    truth, closed = list(truth_points(actor.course)), actor.course.closure.mean(axis=1)
    dashboard.complaints.clear()
    page = dashboard.open("/labelling")
    open_file(page, "Open video", tmp_path / "actor.mp4")
    page.locator('circle.point[data-point="2"]').focus(timeout=60_000)
    expect(page.get_by_text("Two eyes found by 3 blinks")).to_be_visible()
    expect(page.get_by_text("Placed on the detected eyes")).to_be_visible()

    buttons = page.get_by_role("group", name="Frames to label").get_by_role("button")
    chosen = [int(re.findall(r"\d+", label)[0]) for label in buttons.all_inner_texts()]
    blinks = sorted(set(actor.course.blink[closed > 0.5]))
    assert len(blinks) == 3
    closures = {blink: closed * (actor.course.blink == blink) for blink in blinks}
    shut = [max(chosen, key=lambda frame, all_of=closure: all_of[frame]) for closure in closures.values()]
    assert [bool(closures[blink][frame] > 0.5) for blink, frame in zip(blinks, shut, strict=True)] == [
        True
    ] * 3

    for frame in (chosen[0], shut[-1]):
        page.get_by_role("button", name=f"Frame {frame}", exact=True).click()
        expect(page.get_by_text(f"Frame {frame} of 195")).to_be_visible()
        page.locator(".stage").wait_for()
        points = np.array([place_of(page, point) for point in range(18)])
        for eye in (slice(0, 9), slice(9, 18)):
            corners, true = points[eye][[0, 5]], truth[frame][eye][[0, 5]]
            width = np.hypot(*(true[1] - true[0]))
            assert np.hypot(*(corners.mean(axis=0) - true.mean(axis=0))) < 0.2 * width
            assert np.hypot(*(corners[1] - corners[0])) == pytest.approx(width, rel=0.2)
            gap = points[eye][7, 1] - points[eye][2, 1]
            assert (gap < 0.2 * width) == (frame == shut[-1])
        shoot(dashboard, f"labelling-eyes-{frame}")
    assert axe_violations(page) == []
    assert dashboard.complaints == []


def write_series(path: Path) -> None:
    frames = np.arange(3000)
    closure = np.zeros(frames.size)
    for minimum in (600, 1200, 1800, 2400):
        place = frames - minimum
        falling = (1 + np.cos(np.pi * np.clip(place / 27, -1, 0))) / 2
        rising = (1 + np.cos(np.pi * np.clip(place / 63, 0, 1))) / 2
        closure += np.where(place <= 0, falling, rising)
    table = pd.DataFrame({"frame": frames, "gap_l": np.round(34 * (1 - closure) + 0.001, 4)})
    table.to_csv(path, index=False)


def test_blinks_are_reviewed_and_the_review_is_read_by_stimuli(dashboard: Dashboard, tmp_path: Path) -> None:
    series, out = tmp_path / "series.csv", tmp_path / "blinks.csv"
    write_series(series)
    job = BlinksJob(series, out, ("gap_l",), 300.0, tmp_path / "p.csv", preset("relative"))
    run_blinks(job)
    labelled = pd.read_csv(out)

    dashboard.complaints.clear()
    page = dashboard.open("/blink-review")
    open_file(page, "Open series or track", series)
    expect(page.get_by_text("series.csv is open. Next, open its blinks")).to_be_visible()
    open_file(page, "Open blinks", out)
    expect(page.get_by_text("Next, open")).to_have_count(0)
    page.get_by_role("button", name="Choose blink 2").click()
    page.keyboard.press("r")
    page.get_by_label("Reason for rejection").fill("talking")
    page.keyboard.press("Enter")
    expect(page.get_by_text("rejected: talking")).to_be_visible()

    page.keyboard.press("p")
    page.get_by_role("slider", name="End of blink 1").focus()
    page.keyboard.press("Shift+ArrowRight")
    page.keyboard.press("ArrowRight")
    page.keyboard.press("Control+z")
    end = int(labelled["end_frame"][0]) + 10
    expect(page.get_by_text(f"{end} (moved)")).to_be_visible()
    shoot(dashboard, "blink-review")
    assert axe_violations(page) == []

    review = saved(page, "Save review", tmp_path / "review.csv")
    run_blinks(BlinksJob(**(vars(job) | {"review": review})))
    table = pd.read_csv(out, keep_default_na=False)
    assert table["accepted"].tolist() == [True, False, True, True]
    assert table["reason"][1] == "talking"
    assert (table["end_frame"] - labelled["end_frame"]).tolist() == [10, 0, 0, 0]
    assert dashboard.complaints == []


@pytest.mark.parametrize(("path", "words"), [("/labelling", "Open video"), ("/blink-review", "Open blinks")])
def test_the_pages_in_dark_and_on_a_phone(dashboard: Dashboard, path: str, words: str) -> None:
    page = dashboard.page
    page.emulate_media(color_scheme="dark")
    page.set_viewport_size({"width": 390, "height": 844})
    try:
        dashboard.open(path).get_by_role("button", name=words).wait_for()
        assert page.evaluate("document.documentElement.scrollWidth") <= 390
        assert axe_violations(page) == []
    finally:
        page.emulate_media(color_scheme="light")
        page.set_viewport_size({"width": 1280, "height": 800})
