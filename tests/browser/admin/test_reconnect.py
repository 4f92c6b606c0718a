"""The monitor comes back by itself: after a restart of the server, and after a refusal on the way."""

import pytest
from playwright.sync_api import Route, expect

from tests.browser.admin.conftest import Dashboard

pytestmark = pytest.mark.browser


def test_the_monitor_comes_back_after_a_restart_of_the_server(dashboard: Dashboard) -> None:
    page = dashboard.open("/studies/short/monitor")
    expect(page.locator("canvas").first).to_be_visible()
    dashboard.server.kill()
    expect(page.get_by_text("Connection lost")).to_be_visible()
    dashboard.server.start()
    expect(page.get_by_text("Connection lost")).to_be_hidden(timeout=30_000)
    expect(page.locator("canvas").first).to_be_visible()
    dashboard.complaints.clear()


def test_whoever_was_signed_out_elsewhere_is_asked_to_sign_in(dashboard: Dashboard) -> None:
    page = dashboard.open("/studies/short")
    cookies = page.context.cookies()
    page.context.clear_cookies()
    page.get_by_role("tab", name="Participants").click()
    expect(page.get_by_role("button", name="Sign in")).to_be_visible()
    page.context.add_cookies(cookies)  # type: ignore[arg-type]
    dashboard.complaints.clear()


def test_a_refusal_on_the_way_is_tried_again(dashboard: Dashboard) -> None:
    page, refused = dashboard.page, []

    def refuse_twice(route: Route) -> None:
        if len(refused) < 2:
            refused.append(route.request.url)
            route.fulfill(status=502, body="Bad gateway")
        else:
            route.continue_()

    page.route("**/monitor/stream", refuse_twice)
    dashboard.open("/studies/short/monitor")
    expect(page.locator("canvas").first).to_be_visible(timeout=30_000)
    assert len(refused) == 2
    page.unroute("**/monitor/stream")
    dashboard.complaints.clear()
