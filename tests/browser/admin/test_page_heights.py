"""No page of the builder or of the settings is longer than two screens, whatever study it shows."""

from collections.abc import Callable
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from experiments.load import parse_experiment
from server.cli_common import migrated_services
from tests.browser.admin.conftest import Dashboard
from tests.browser.admin.test_level_grid import made_study
from tests.browser.conftest import REPOSITORY
from tests.helpers.studies import add_study

pytestmark = pytest.mark.browser
SCREEN = {"width": 1440, "height": 900}
MOST_PX = 2 * SCREEN["height"]
SHIPPED = sorted((REPOSITORY / "experiments").glob("*.toml"))
STANDING_FOR_ALL = {"exp3", "threshold-demo"}
"""Among the longest pages; the other studies are measured in the long tests."""


def lengths(page: Page, pages: str) -> dict[str, int]:
    """The height of each page that a list of pages links to, by name."""
    links = page.get_by_role("navigation", name=pages).get_by_role("link")
    measured = {}
    for number in range(links.count()):
        link = links.nth(number)
        link.click()
        expect(link).to_have_attribute("data-active", "true")
        page.wait_for_load_state("networkidle")
        measured[link.inner_text()] = int(page.evaluate("document.documentElement.scrollHeight"))
    return measured


@pytest.mark.parametrize(
    "file",
    [pytest.param(file, marks=() if file.stem in STANDING_FOR_ALL else pytest.mark.long) for file in SHIPPED],
    ids=lambda file: file.stem,
)
def test_pages_of_a_shipped_study_have_at_most_two_screens(
    dashboard: Dashboard, tmp_path: Path, file: Path
) -> None:
    text = file.read_text(encoding="utf-8")
    with migrated_services(dashboard.server.settings) as services:
        add_study(services, tmp_path, text, status="draft")
    measured = heights(dashboard, parse_experiment(text).name)
    assert len(measured) == 17
    assert {name: height for name, height in measured.items() if height > MOST_PX} == {}


def test_pages_of_a_study_of_own_clips_have_at_most_two_screens(dashboard: Dashboard) -> None:
    made_study(dashboard, "own")
    measured = heights(dashboard, "own")
    assert len(measured) == 17
    assert {name: height for name, height in measured.items() if height > MOST_PX} == {}


def heights(dashboard: Dashboard, name: str) -> dict[str, int]:
    """The height of each page of the builder and of the settings of a study, by name."""
    page = dashboard.page
    before = page.viewport_size
    page.set_viewport_size(SCREEN)  # type: ignore[arg-type]
    try:
        ready: Callable[[], None] = page.get_by_role("button", name="Save as a new version").wait_for
        dashboard.open(f"/studies/{name}/build")
        ready()
        measured = lengths(page, "Pages of the builder")
        dashboard.open(f"/studies/{name}/settings")
        measured |= lengths(page, "Settings")
    finally:
        if before is not None:
            page.set_viewport_size(before)
    return measured
