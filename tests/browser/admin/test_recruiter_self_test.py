"""The self-test of a recruiter: into the study by a test id and back with the right code."""

from typing import Any

import pytest
from playwright.sync_api import Locator, expect

from tests.browser.admin.conftest import Dashboard
from tests.browser.admin.test_own_videos import shoot
from tests.browser.visit import axe_violations

pytestmark = pytest.mark.browser
SAME_ORIGIN = {"sec-fetch-site": "same-origin"}
PASSED = "Passed: "


def walked(dashboard: Dashboard, recruiter: dict[str, Any]) -> Locator:
    """The steps of a self-test of the study with this recruiter, once it has ended."""
    page, api = dashboard.page, f"{dashboard.server.address}/api/admin/studies/short"
    summary = page.request.get(api).json()["summary"]
    body = {"revision": summary["revision"], "paused": False, "quota": None, "recruiter": recruiter}
    answer = page.request.put(f"{api}/settings", data=body, headers=SAME_ORIGIN)
    assert answer.ok, answer.text()
    dashboard.open("/studies/short/settings?part=recruitment")
    with page.expect_popup():
        page.get_by_role("button", name="Test the redirect").click()
    steps = page.get_by_role("list", name="Self-test")
    expect(page.get_by_role("button", name="Test the redirect")).to_be_enabled(timeout=120_000)
    return steps.get_by_role("listitem")


@pytest.mark.parametrize(
    ("recruiter", "code", "back"),
    [
        ({"kind": "prolific", "code_complete": "C0DE42"}, "C0DE42", "submissions/complete?cc=C0DE42"),
        (
            {
                "kind": "sona",
                "redirect_url": "https://lab.sona-systems.com/done?credit={survey_code}&run={run}",
            },
            "No code is configured; this run got a random one",
            "https://lab.sona-systems.com/done?credit=selftest&run=",
        ),
        ({"kind": "mturk"}, "No code is configured", "No redirect URL is configured"),
    ],
    ids=["prolific", "sona", "mturk"],
)
def test_each_step_of_the_way_back_passes(
    dashboard: Dashboard, recruiter: dict[str, Any], code: str, back: str
) -> None:
    steps = walked(dashboard, recruiter)
    expect(steps).to_contain_text([PASSED] * 5)
    expect(steps.nth(2)).to_contain_text(code)
    expect(steps.nth(3)).to_contain_text(back)
    expect(steps.nth(4)).to_contain_text("Its run is stored as a preview")
    if recruiter["kind"] == "prolific":
        assert axe_violations(dashboard.page) == []
        shoot(dashboard, "self-test")


def test_a_link_with_another_code_fails_the_step_of_the_code(dashboard: Dashboard) -> None:
    api = f"{dashboard.server.address}/api/admin/studies/short/links"
    for link in dashboard.page.request.get(api).json()["links"]:
        if link["label"] == "Self-test":
            dashboard.page.request.delete(f"{api}/{link['id']}", headers=SAME_ORIGIN)
    other = {"kind": "prolific", "code_complete": "WR0NG"}
    body = {"kind": "preview", "label": "Self-test", "recruiter": other}
    made = dashboard.page.request.post(api, data=body, headers=SAME_ORIGIN)
    assert made.ok, made.text()
    steps = walked(dashboard, {"kind": "prolific", "code_complete": "C0DE42"})
    expect(steps.nth(1)).to_contain_text(PASSED)
    expect(steps.nth(2)).to_contain_text("Failed: The completion code")
    expect(steps.nth(2)).to_contain_text("expected C0DE42, got WR0NG")
