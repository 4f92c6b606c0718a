"""The pages of the blink engine, opened from a folder: they blink, and fetch nothing."""

from pathlib import Path

import pytest
from addon_build.playground import build_scripts, playground_page, vrm_page
from playwright.sync_api import BrowserContext, Page

from blink_engine import BlinkEngine
from stimuli_builder.clips.preview import write_strips

FACES = ".playground-side:first-child canvas:not(.playground-trace)"
DARK = """() => [...document.querySelectorAll('FACES')].map((canvas) => {
    const { width, height } = canvas;
    const all = canvas.getContext('2d').getImageData(0, 0, width, height).data;
    return all.reduce((sum, value) => sum + value, 0) / all.length;
  })""".replace("FACES", FACES)


SLOW_MS = 180_000
"""Without a graphics card, an avatar's frame takes seconds while other tests run."""


@pytest.fixture
def avatar(context: BrowserContext, pages: Path) -> Page:
    """The page of the avatar, once it blinks."""
    opened = context.new_page()
    opened.set_default_timeout(SLOW_MS)
    opened.goto((pages / "vrm.html").as_uri())
    opened.wait_for_selector("#said:not(:empty)")
    return opened


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("pages")
    build_scripts()
    write_strips(folder)
    (folder / "playground.html").write_text(playground_page(folder), encoding="utf-8")
    (folder / "vrm.html").write_text(vrm_page(), encoding="utf-8")
    return folder


def test_both_characters_blink_on_command(context: BrowserContext, pages: Path) -> None:
    opened = context.new_page()
    requests: list[str] = []
    errors: list[str] = []
    opened.on("request", lambda request: requests.append(request.url))
    opened.on("pageerror", lambda error: errors.append(str(error)))
    opened.goto((pages / "playground.html").as_uri())
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
    context: BrowserContext, pages: Path, tmp_path: Path
) -> None:
    opened = context.new_page()
    opened.goto((pages / "playground.html").as_uri())
    with opened.expect_download() as saving:
        opened.get_by_role("button", name="Save 60 s as CSV").click()
    saving.value.save_as(tmp_path / "curve.csv")
    lines = (tmp_path / "curve.csv").read_text().splitlines()
    assert lines[0] == "frame,time_s,closure_left,closure_right,lower_up_mm,lower_nasal_mm"
    assert len(lines) == 3601


def test_an_avatar_is_given_the_engines_lids(avatar: Page) -> None:
    assert avatar.inner_text("#said").startswith("Blinking as a listener")
    # As many moments as it takes to see ten within a blink: read together, as the page set them together.
    avatar.evaluate("""() => {
      const canvas = document.querySelector('canvas');
      window.seen = [];
      new MutationObserver(() => {
        const { time, lidLeft, lidRight } = canvas.dataset;
        window.seen.push([time, lidLeft, lidRight].map(Number));
      }).observe(canvas, { attributes: true, attributeFilter: ['data-lid-right'] });
    }""")
    avatar.wait_for_function("window.seen.filter(([, left]) => left > 0.02).length >= 10")
    engine = BlinkEngine(seed=1, state="listening")
    for time_s, left, right in avatar.evaluate("window.seen"):
        frame = engine.frame(time_s)
        assert (left, right) == pytest.approx((frame.left, frame.right), abs=1e-4)


def test_an_avatar_moves_between_blinks(avatar: Page) -> None:
    open_eyes = "Number(document.querySelector('canvas').dataset.lidLeft) === 0"
    pictures = []
    while len(pictures) < 3:
        avatar.wait_for_function(open_eyes)
        picture = avatar.locator("canvas").screenshot()
        # A blink may have begun meanwhile.
        if avatar.evaluate(open_eyes):
            pictures.append(picture)
    assert len(set(pictures)) == 3


def test_a_file_that_is_not_an_avatar_is_refused_and_the_one_that_is_there_blinks_on(
    avatar: Page, tmp_path: Path
) -> None:
    wrong = tmp_path / "notes.vrm"
    wrong.write_text("no model")
    avatar.get_by_label("Your avatar").set_input_files(wrong)
    avatar.wait_for_selector("text=This model cannot be used")
    before = avatar.evaluate("document.querySelector('canvas').dataset.time")
    avatar.wait_for_function(f"Number(document.querySelector('canvas').dataset.time) > {before}")
