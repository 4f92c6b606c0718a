"""A study is rehearsed by one button, and what it shows can be read by everybody, wide and narrow."""

import pytest
from playwright.sync_api import expect

from tests.browser.admin.conftest import Dashboard
from tests.browser.admin.test_walk import shoot
from tests.browser.visit import axe_violations

pytestmark = pytest.mark.browser
LONG_MS = 300_000
SIZES = ((1440, 900), (390, 844))


def look(dashboard: Dashboard, name: str) -> None:
    """Axe, width and picture of the page as it is, in light and dark, wide and narrow."""
    page = dashboard.page
    try:
        for scheme in ("light", "dark"):
            # Without transitions: axe must not meet a color on its way from one scheme to the other.
            page.emulate_media(color_scheme=scheme, reduced_motion="reduce")
            for width, height in SIZES:
                page.set_viewport_size({"width": width, "height": height})
                page.wait_for_timeout(200)
                shoot(dashboard, f"{name}-{scheme}-{width}")
                assert axe_violations(page) == []
                wide = page.evaluate("document.documentElement.scrollWidth")
                assert wide <= width, f"the page is {wide} px wide on a screen of {width}"
    finally:
        page.emulate_media(color_scheme="light", reduced_motion="null")
        page.set_viewport_size({"width": 1280, "height": 800})


@pytest.mark.parametrize("typed", ["-3", "61", "2.5"])
def test_a_number_out_of_range_is_refused_and_stays_as_typed(dashboard: Dashboard, typed: str) -> None:
    """-3 people became one."""
    page = dashboard.open("/studies/short/rehearsal")
    people = page.get_by_label("Simulated people")
    people.fill(typed)
    people.blur()
    expect(people).to_have_value(typed)
    expected = f"Expected a whole number from 1 to 60, got {typed}. Change it to continue."
    expect(page.get_by_text(expected)).to_be_visible()
    expect(page.get_by_role("button", name="Rehearse")).to_be_disabled()

    page = dashboard.open("/studies/short/links")
    page.get_by_text("One person each").click()
    many = page.get_by_label("How many")
    many.fill("0")
    many.blur()
    expect(page.get_by_text("Expected a whole number from 1 to 5000, got 0.")).to_be_visible()
    expect(page.get_by_role("button", name="Create links")).to_be_disabled()

    page = dashboard.open("/studies/short/settings")
    quota = page.get_by_label("Close after this many complete runs")
    quota.fill("-1")
    quota.blur()
    expect(page.get_by_text("Expected a whole number of 1 or more, got -1.")).to_be_visible()


def test_a_study_is_rehearsed_by_one_button(dashboard: Dashboard) -> None:
    dashboard.complaints.clear()
    page = dashboard.open("/studies/short/rehearsal")
    page.get_by_label("Simulated people").fill("2")
    page.get_by_role("button", name="Rehearse").click()
    expect(page.get_by_role("heading", name="Columns")).to_be_visible(timeout=LONG_MS)
    expect(page.get_by_text("2 of 2 came to the end")).to_be_visible()
    expect(page.get_by_text("analysis plan anova --within character:2,speed:2")).to_be_visible()
    expect(page.get_by_role("link", name="report.html")).to_be_visible()
    page.get_by_text("Person 2").click()
    assert dashboard.complaints == []
    look(dashboard, "rehearsal")
    assert dashboard.server.rows("SELECT id FROM study_runs WHERE origin = 'simulated'") == []
