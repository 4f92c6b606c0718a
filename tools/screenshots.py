"""Pictures for README and docs, made by the program itself: `make screenshots` writes them to docs/images.

A real server, the real Experiment 3 (its clips must be built: `make run` does), a real Chromium; the result
table is of synthetic ratings and says so.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from io import BytesIO
from pathlib import Path

from PIL import Image
from playwright.sync_api import Page, sync_playwright

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from tools.screenshots_clips import QUALITY  # noqa: E402

IMAGES = ROOT / "docs" / "images"
BIN = ROOT / ".venv" / "bin"


def call(*command: str | Path) -> None:
    subprocess.run([BIN / str(command[0]), *map(str, command[1:])], cwd=ROOT, check=True)


def analysis_pictures(folder: Path) -> None:
    """Table III from synthetic ratings."""
    ratings, report = folder / "exp3.csv", folder / "report"
    call("analysis", "synthesise", "exp3", "--seed", "1", "--out", ratings)
    call("analysis", "run", "exp3", "--csv", ratings, "--out", report)
    page = next(report.glob("*.html"))
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"])
        shown = browser.new_page(viewport={"width": 900, "height": 760})
        shown.goto(page.as_uri())
        keep(shown, "table")
        browser.close()


def participant_pictures(folder: Path, clips: Path) -> None:
    """The trial's two screens, with the real clips, as a person sees them."""
    from tests.browser.conftest import CHROMIUM_FLAGS
    from tests.browser.server_process import ServerProcess

    process = ServerProcess(folder / "data")
    declaration = (ROOT / "experiments" / "exp3.toml").read_text(encoding="utf-8")
    study = process.add_built_study(clips, declaration.replace('calibrate = "required"', 'calibrate = "off"'))
    process.start()
    try:
        with sync_playwright() as playwright:
            browser = playwright.chromium.launch(
                executable_path=shutil.which("chromium"), args=CHROMIUM_FLAGS
            )
            page = browser.new_page(viewport={"width": 1180, "height": 760}, locale="en-GB")
            visit(page, f"{process.address}/run/{study.link_token}")
            browser.close()
    finally:
        process.stop()


def keep(page: Page, name: str) -> None:
    """Write what a page shows as WebP: lossless, or lossy where a face in it makes that the smaller file."""
    picture = Image.open(BytesIO(page.screenshot())).convert("RGB")
    files = [BytesIO(), BytesIO()]
    picture.save(files[0], "WEBP", lossless=True, quality=100, method=6)
    picture.save(files[1], "WEBP", quality=QUALITY, method=6)
    (IMAGES / f"{name}.webp").write_bytes(min((file.getvalue() for file in files), key=len))


def visit(page: Page, address: str) -> None:
    """From the link to the first rating."""
    page.goto(address)
    page.wait_for_selector("text=About")
    page.click(".primary")
    page.check("input[type=checkbox]")
    page.click(".primary")
    page.wait_for_selector("form")
    page.fill("input.short", "34")
    page.check("input[value=normal]")
    page.click(".primary")
    page.wait_for_selector(".prose h1, .prose h2")
    page.click(".primary")
    page.wait_for_selector("text=not part of the study")
    page.click(".primary")
    page.wait_for_selector(".ready")
    page.keyboard.press(" ")
    page.wait_for_timeout(500)
    keep(page, "participant")
    page.wait_for_selector(".scale")
    keep(page, "scale")


def main() -> None:
    clips = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "data" / "stimuli" / "exp3"
    if not (clips / "manifest.json").is_file():
        sys.exit(
            f"error: expected the built clips of exp3 in {clips}; run `make run` or `stimuli build exp3`"
        )
    IMAGES.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        analysis_pictures(Path(folder))
        participant_pictures(Path(folder), clips)
    print(f"pictures in {IMAGES.relative_to(ROOT)}")


if __name__ == "__main__":
    main()
