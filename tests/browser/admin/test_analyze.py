"""A table dropped on the page Analyze: guessed roles, a result, and what a person corrects."""

import os
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import expect
from scipy import stats

from tests.browser.admin.conftest import Dashboard
from tests.browser.visit import axe_violations

pytestmark = pytest.mark.browser


def _table(path: Path) -> np.ndarray:
    rng = np.random.default_rng(8)
    scores = np.round(4 + rng.normal(size=(14, 2)) + [0, 0.7], 2)
    lines = [
        f"p{n},{face},{scores[n, k]},{n}" for n in range(14) for k, face in enumerate(("calm", "lively"))
    ]
    path.write_text("\n".join(["person,face,warmth,seat", *lines, ""]), encoding="utf-8")
    return scores


HAS_ROOM = """(select) => {
    const style = getComputedStyle(select);
    const drawing = document.createElement("canvas").getContext("2d");
    drawing.font = style.font;
    const longest = Math.max(...[...select.options].map(({ text }) => drawing.measureText(text).width));
    return select.clientWidth - parseFloat(style.paddingLeft) - parseFloat(style.paddingRight) >= longest;
}"""


def test_a_table_becomes_a_result(dashboard: Dashboard, tmp_path: Path) -> None:
    scores = _table(tmp_path / "warmth.csv")
    page = dashboard.open("/analyze")
    page.locator('input[type="file"]').set_input_files(tmp_path / "warmth.csv")
    # `warmth` does not name a rating: the page asks for one
    expect(page.get_by_text("Choose a column for: Rating.")).to_be_visible()
    page.get_by_label("Role of warmth").select_option(label="Rating")
    for width in (390, 1280):
        page.set_viewport_size({"width": width, "height": 800})
        assert page.get_by_label("Role of warmth").evaluate(HAS_ROOM)  # no role is cut off
    expect(page.get_by_label("Role of face")).to_have_value("within")
    page.get_by_label("Role of seat").select_option(label="None")
    page.get_by_role("button", name="Analyze", exact=True).click()
    result = page.get_by_role("heading", name="Result", exact=True)
    expect(result).to_be_visible(timeout=60_000)
    t = stats.ttest_rel(scores[:, 0], scores[:, 1])
    expect(page.get_by_text(f"F(1, 13) = {t.statistic**2:.2f}").first).to_be_visible()
    # the figure is drawn, not only linked
    drawn = page.locator("main img").first
    assert drawn.evaluate("image => image.complete && image.naturalWidth > 200")
    command = page.get_by_label("Command").inner_text()
    assert command == "analysis anova warmth.csv --participant=person --rating=warmth --within=face"
    with page.expect_download() as saved:
        page.get_by_role("link", name="CSV").first.click()
    header = Path(saved.value.path()).read_text(encoding="utf-8").splitlines()[0]
    assert header.startswith('"')
    assert axe_violations(page) == []
    if folder := os.environ.get("PICTURES"):
        page.screenshot(path=f"{folder}/analyze.png", full_page=True)
    page.get_by_label("Analysis").select_option("ranks")
    page.get_by_role("button", name="Analyze", exact=True).click()
    expect(page.get_by_text("ratings", exact=False).filter(has_text="χ²").first).to_be_visible(timeout=60_000)


def test_a_refusal_names_the_roles_of_the_page(dashboard: Dashboard, tmp_path: Path) -> None:
    _table(tmp_path / "warmth.csv")
    page = dashboard.open("/analyze")
    page.locator('input[type="file"]').set_input_files(tmp_path / "warmth.csv")
    page.get_by_label("Role of warmth").select_option(label="Rating")
    page.get_by_label("Role of seat").select_option(label="Factor within participants")
    page.get_by_role("button", name="Analyze", exact=True).click()
    alert = page.get_by_role("alert")
    expect(alert).to_contain_text("use “Factor between participants”")
    expect(alert).not_to_contain_text("--")
    expect(alert).not_to_contain_text("Something went wrong")
    dashboard.complaints.clear()  # Chromium reports the refusal as a failed request


def test_a_file_that_is_no_table_is_one_line(dashboard: Dashboard, tmp_path: Path) -> None:
    page = dashboard.open("/analyze")
    (tmp_path / "empty.csv").write_text("a,b\n", encoding="utf-8")
    page.locator('input[type="file"]').set_input_files(tmp_path / "empty.csv")
    expect(page.get_by_role("alert")).to_contain_text("empty.csv has a header but no rows")
    dashboard.complaints.clear()  # Chromium reports the refusal as a failed request
