"""The playground page, opened from a folder: both characters blink when told to, and nothing is fetched."""

import subprocess
from pathlib import Path

import pytest
from playwright.sync_api import BrowserContext

from stimuli_builder.clips.strips import write_strips
from tools.build_playground import ROOT, page

FACES = ".playground-side:first-child canvas:not(.playground-trace)"
DARK = """() => [...document.querySelectorAll('FACES')].map((canvas) => {
    const { width, height } = canvas;
    const all = canvas.getContext('2d').getImageData(0, 0, width, height).data;
    return all.reduce((sum, value) => sum + value, 0) / all.length;
  })""".replace("FACES", FACES)


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> str:
    folder = tmp_path_factory.mktemp("playground")
    built = ["npm", "run", "--silent", "build:playground"]
    subprocess.run(built, cwd=ROOT / "frontend", check=True, stdout=subprocess.DEVNULL)
    write_strips(folder)
    page_file = folder / "playground.html"
    page_file.write_text(page(ROOT / "frontend" / "dist" / "playground", folder), encoding="utf-8")
    return page_file.as_uri()


def test_both_characters_blink_when_told_to(context: BrowserContext, address: str) -> None:
    opened = context.new_page()
    requests: list[str] = []
    errors: list[str] = []
    opened.on("request", lambda request: requests.append(request.url))
    opened.on("pageerror", lambda error: errors.append(str(error)))
    opened.goto(address)
    opened.wait_for_function(f"({DARK})().every((mean) => mean > 0)")
    opened.evaluate(
        """(measure) => {
      window.means = [];
      const read = () => { window.means.push(eval(`(${measure})()`)); requestAnimationFrame(read); };
      read();
    }""",
        DARK,
    )
    opened.get_by_role("button", name="Blink", exact=True).click()
    changed = "window.means[0].every((_, face) => new Set(window.means.map((m) => m[face])).size > 2)"
    opened.wait_for_function(changed)
    assert not errors
    assert [url for url in requests if not url.startswith(("file:", "data:", "blob:"))] == []


def test_a_saved_curve_is_a_file_that_others_read(
    context: BrowserContext, address: str, tmp_path: Path
) -> None:
    opened = context.new_page()
    opened.goto(address)
    with opened.expect_download() as saving:
        opened.get_by_role("button", name="Save 60 s as CSV").click()
    saving.value.save_as(tmp_path / "curve.csv")
    lines = (tmp_path / "curve.csv").read_text().splitlines()
    assert lines[0] == "frame,time_s,closure_left,closure_right,lower_up_mm,lower_nasal_mm"
    assert len(lines) == 3601
