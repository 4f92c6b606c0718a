"""preview.html, opened from the file system in a real browser."""

import json
import re
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page, expect

from experiments.load import load_experiment
from experiments.manifest import Manifest
from stimuli_builder.characters.declaration import write_example_character
from stimuli_builder.clips.build import Machines, build
from stimuli_builder.clips.design_clips import Options
from stimuli_builder.clips.preview import write_preview

STUDY = """
name = "sheet"
title = "Two eyes and a lower lid"
[[factors]]
name = "look"
label = "Look"
[[factors.levels]]
name = "apart"
label = "Eyes apart </script><b>"
render = { character = "cartoon", profile = "real", eyes = "separate" }
[[factors.levels]]
name = "lower"
label = "Lower lid"
render = { character = "tiny", profile = "lid.csv", lower_lid = "both" }
[exemplars]
per_cell = 2
[render]
width_px = 320
height_px = 120
[trial]
kind = "clip_rating"
[trial.scale]
question = { en = "How natural?" }
low = { en = "low" }
high = { en = "high" }
[texts.en]
consent = "c"
instructions = "i"
debrief = "d"
"""
CLOSURE = [0.0, 0.2, 0.6, 0.9, 1.0, 0.9, 0.7, 0.5, 0.3, 0.2, 0.1, 0.0]


@pytest.fixture(scope="module")
def sheet(tmp_path_factory: pytest.TempPathFactory) -> tuple[Manifest, Path]:
    """Four clips and their preview, in a folder whose name has a space."""
    folder = tmp_path_factory.mktemp("preview study")
    write_example_character(folder / "tiny")
    rows = [f"{w},{0.9 * w},{0.8 * w}" for w in CLOSURE]
    (folder / "lid.csv").write_text("closure,lower_up_mm,lower_nasal_mm\n" + "\n".join(rows) + "\n")
    (folder / "sheet.toml").write_text(STUDY)
    report = build(
        load_experiment(str(folder / "sheet.toml")),
        folder / "clips",
        Options(base_folder=folder),
        Machines(1),
    )
    return report.manifest, write_preview(report.manifest, folder / "clips")[1]


@pytest.fixture
def opened(chromium: Browser, sheet: tuple[Manifest, Path]) -> Iterator[tuple[Page, list[str], list[str]]]:
    """The page, what it asked for, and what it complained about."""
    context = chromium.new_context(viewport={"width": 1280, "height": 800})
    page = context.new_page()
    asked: list[str] = []
    wrong: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.on("console", lambda message: wrong.append(message.text) if message.type == "error" else None)
    page.goto(sheet[1].as_uri())
    yield page, asked, wrong
    context.close()


def test_every_clip_is_next_to_its_curves(
    opened: tuple[Page, list[str], list[str]], sheet: tuple[Manifest, Path]
) -> None:
    page, _, wrong = opened
    expect(page.locator("figure")).to_have_count(4)
    expect(page.locator("polyline.other")).to_have_count(2)
    expect(page.locator("polyline.nasal")).to_have_count(2)
    drawn = page.locator("polyline.curve").first.get_attribute("points") or ""
    heights = [float(point.split(",")[1]) for point in drawn.split()]
    clip = sheet[0].clips[0]
    assert 44 - 38 * max(clip.closure) == pytest.approx(min(heights), abs=0.5)
    assert heights[0] == pytest.approx(44 - 38 * clip.closure[0], abs=0.1)
    assert wrong == []


def test_a_click_plays_the_clip_and_moves_the_mark_over_its_curve(
    opened: tuple[Page, list[str], list[str]],
) -> None:
    page, asked, wrong = opened
    page.select_option("#speed", "0.5")
    page.locator("video").first.click()
    page.wait_for_function("() => document.querySelector('video').currentTime > 0.2")
    assert page.evaluate("() => document.querySelector('video').playbackRate") == 0.5
    page.wait_for_function("() => Number(document.querySelector('.head').getAttribute('x1')) > 5")
    page.wait_for_function("() => document.querySelector('video').ended")
    expect(page.locator(".head").first).to_have_attribute("x1", re.compile(r"^(9[5-9]|100)"))
    assert [url for url in asked if not url.startswith("file://")] == []
    assert wrong == []


def test_a_key_plays_too_and_choices_narrow_the_page(opened: tuple[Page, list[str], list[str]]) -> None:
    page, _, _ = opened
    page.select_option("select[name=look]", "lower")
    expect(page.locator("#count")).to_have_text("2 clips")
    page.locator("video").first.focus()
    page.keyboard.press("Enter")
    page.wait_for_function("() => document.querySelector('video').currentTime > 0.1")


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_text_is_readable_by_day_and_by_night(
    chromium: Browser, sheet: tuple[Manifest, Path], scheme: str
) -> None:
    page = chromium.new_page(color_scheme=scheme)  # type: ignore[arg-type]
    page.goto(sheet[1].as_uri())
    for place in ("h1", "header p", "figcaption", "select"):
        ink, paper = page.evaluate(
            """(place) => { let at = document.querySelector(place); const ink = getComputedStyle(at).color;
            while (getComputedStyle(at).backgroundColor === "rgba(0, 0, 0, 0)") at = at.parentElement;
            return [ink, getComputedStyle(at).backgroundColor]; }""",
            place,
        )
        lighter, darker = sorted((luminance(ink), luminance(paper)), reverse=True)
        assert (lighter + 0.05) / (darker + 0.05) >= 4.5, place
        assert (luminance(paper) < 0.1) == (scheme == "dark"), place
    page.close()


def luminance(colour: str) -> float:
    """WCAG relative luminance of an `rgb(...)` colour."""
    parts = [int(value) / 255 for value in re.findall(r"\d+", colour)[:3]]
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in parts]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def test_a_copied_folder_still_works(chromium: Browser, sheet: tuple[Manifest, Path], tmp_path: Path) -> None:
    copy = Path(shutil.copytree(sheet[1].parent, tmp_path / "sent to a colleague"))
    page = chromium.new_page()
    page.goto((copy / "preview.html").as_uri())
    page.wait_for_function("() => document.querySelector('video').readyState >= 1")
    data = json.loads(page.locator("#clips").text_content() or "")
    assert [clip["file"] for clip in data] == [clip.file for clip in sheet[0].clips]
    page.close()
