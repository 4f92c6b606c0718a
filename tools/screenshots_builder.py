"""The pictures of docs/how-to/build-a-study.md, taken while following it: `make screenshots` writes them.

Twelve clips are drawn, brought by a browser to a server of its own, and made a study; each page is
photographed on the way, at 1440 px and light, in few colours.
"""

from __future__ import annotations

import io
import shutil
import sys
import tempfile
from pathlib import Path

import av
import cv2
import numpy as np
from PIL import Image
from playwright.sync_api import Page, sync_playwright

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))
IMAGES = ROOT / "docs" / "images"
SECTIONS = ("study", "factors", "trial", "order", "forms", "texts", "screen", "rules", "analysis", "dataset")
ROBOTS = {"rosie": (196, 112, 72), "tin": (120, 124, 132)}
SPEEDS = {"slow": 24, "middle": 14, "fast": 7}
COLOURS = 64
FRAMES, FPS, WIDTH, HEIGHT = 48, 30, 320, 180


def clips(folder: Path) -> list[Path]:
    """Two robots that blink at three speeds, two clips each."""
    paths = []
    for robot, colour in ROBOTS.items():
        for speed, frames in SPEEDS.items():
            for number in (1, 2):
                paths.append(folder / f"{robot}_{speed}_{number}.mp4")
                write(paths[-1], colour, frames, 10 + 4 * number)
    return paths


def write(path: Path, colour: tuple[int, int, int], closing: int, start: int) -> None:
    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=FPS)
        stream.width, stream.height, stream.pix_fmt = WIDTH, HEIGHT, "yuv420p"
        for number in range(FRAMES):
            shut = max(0.0, 1 - abs(number - start - closing / 2) / (closing / 2))
            frame = av.VideoFrame.from_ndarray(face(colour, shut), format="rgb24")
            container.mux(stream.encode(frame))
        container.mux(stream.encode())


def face(colour: tuple[int, int, int], shut: float) -> np.ndarray:
    """A robot's face with its lids `shut` that far (0 open, 1 closed)."""
    picture = np.full((HEIGHT, WIDTH, 3), 128, np.uint8)
    cv2.rectangle(picture, (70, 20), (250, 160), colour, -1)
    for x in (120, 200):
        cv2.ellipse(picture, (x, 80), (26, 20), 0, 0, 360, (245, 245, 240), -1)
        cv2.circle(picture, (x, 80), 9, (30, 30, 40), -1)
        cv2.rectangle(picture, (x - 30, 58), (x + 30, 58 + round(44 * shut)), colour, -1)
    cv2.rectangle(picture, (130, 125), (190, 132), (60, 60, 66), -1)
    return picture


def keep(page: Page, name: str) -> None:
    """Photograph the page as it is, in a palette: text and flat areas lose nothing."""
    page.wait_for_load_state("networkidle")
    picture = Image.open(io.BytesIO(page.screenshot(animations="disabled")))
    palette = picture.convert("RGB").quantize(COLOURS, dither=Image.Dither.NONE)
    palette.save(IMAGES / f"builder-{name}.png", optimize=True)


def new_study(page: Page, address: str, files: list[Path]) -> None:
    page.goto(f"{address}/admin/studies/new")
    page.get_by_label("Short name").fill("robots")
    page.get_by_role("tab", name="From your own clips").click()
    page.locator('input[type="file"]:not([accept=".zip"])').first.set_input_files(files)
    page.get_by_text("12 clips received").wait_for()
    page.get_by_label("Pattern", exact=True).fill("{robot}_{speed}_{exemplar}.mp4")
    page.get_by_label("What participants do").first.click()
    page.get_by_role("option", name="Several sliders").click()
    page.get_by_label("Title of the study").fill("Blinking robots")
    page.get_by_label("Question", exact=True).fill("How alive does this robot look?")
    keep(page, "new")
    page.get_by_role("button", name="Create").click()
    page.get_by_text("robots, version 1").wait_for()


def build(page: Page, address: str) -> None:
    """A practice, a slider and a questionnaire; then a picture of each page."""
    page.get_by_role("tab", name="Build").click()
    page.get_by_role("link", name="Practice and order").click()
    page.get_by_label("Trials", exact=True).fill("3")
    page.get_by_role("link", name="Questionnaires").click()
    page.get_by_role("button", name="Add from the question bank").click()
    page.get_by_role("menuitem", name="Demographics").click()
    save = page.get_by_role("button", name="Save as a new version")
    save.click()
    page.get_by_text("robots, version 2").wait_for()
    for section in SECTIONS:
        page.goto(f"{address}/admin/studies/robots/build?section={section}")
        save.wait_for()
        keep(page, section)


def go_live(page: Page, address: str) -> None:
    page.goto(f"{address}/admin/studies/robots/clips")
    page.get_by_text("12 clips").first.wait_for()
    keep(page, "clips")
    page.goto(f"{address}/admin/studies/robots/rehearsal")
    page.get_by_role("button", name="Rehearse").click()
    page.get_by_text("Assumed:").wait_for(timeout=300_000)
    page.evaluate("window.scrollTo(0, 0)")
    keep(page, "rehearsal")
    page.get_by_role("button", name="Set live").click()
    page.get_by_role("dialog").get_by_role("button", name="Set live").click()
    page.get_by_role("dialog").locator("code").first.wait_for()
    keep(page, "live")


def main() -> None:
    from tests.browser.conftest import CHROMIUM_FLAGS
    from tests.browser.server_process import ServerProcess
    from tools.screenshots_admin import sign_in

    with tempfile.TemporaryDirectory() as temporary, sync_playwright() as playwright:
        folder = Path(temporary)
        process = ServerProcess(folder / "data").start()
        try:
            browser = playwright.chromium.launch(
                executable_path=shutil.which("chromium"), args=CHROMIUM_FLAGS
            )
            page = browser.new_page(viewport={"width": 1440, "height": 900}, locale="en-GB")
            sign_in(page, process.address, process.settings)
            new_study(page, process.address, clips(folder))
            build(page, process.address)
            go_live(page, process.address)
            browser.close()
        finally:
            process.stop()
    print(f"pictures in {IMAGES.relative_to(ROOT)}")


if __name__ == "__main__":
    main()
