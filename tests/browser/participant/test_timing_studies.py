"""The studies of timing as they ship, but for shorter clips, from the first page to the last."""

from pathlib import Path

import pytest
from playwright.sync_api import Page

from experiments.load import locate, parse_experiment
from tests.browser.server_process import ServerProcess
from tests.browser.visit import Visit
from tests.helpers.tiny_clips import make_clip_folder

pytestmark = pytest.mark.browser
FRAMES = 6
TRIALS = {"timing": 4, "timing-continuous": 4, "timing-pairs": 6}
"""With one exemplar per cell, practice aside."""


@pytest.mark.parametrize("name", TRIALS)
def test_a_page_plays_the_study_to_its_end(
    server: ServerProcess, tmp_path: Path, page: Page, name: str
) -> None:
    text = locate(name).read_text(encoding="utf-8")
    for per_cell in ("per_cell = 3", "per_cell = 2"):
        text = text.replace(per_cell, "per_cell = 1")
    make_clip_folder(parse_experiment(text), tmp_path / "clips", frames=FRAMES)
    study = server.add_built_study(tmp_path / "clips", text)
    server.start()
    page.set_viewport_size({"width": 1920, "height": 900})
    visit = Visit(page, server.address).open(server.link(study, "preview"), "?simulate=visual")
    page.click(".primary")
    page.wait_for_selector(".code", timeout=60_000)
    assert visit.problems == []
    shown = TRIALS[name] + 1
    rows = server.rows_soon("SELECT method FROM trial_ratings", shown)
    # Clips were played, not only answered; one that lost frames comes once more.
    assert len(rows) >= shown
    assert {row["method"] for row in rows} == {"webcodecs"}
