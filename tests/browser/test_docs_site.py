"""The documentation site under the server's content security policy: no violation, no outside request."""

import pytest
from playwright.sync_api import Browser, expect

from tests.browser.conftest import REPOSITORY
from tests.browser.server_process import ServerProcess
from tests.browser.visit import axe_violations

pytestmark = pytest.mark.browser
SITE = REPOSITORY / "frontend" / "dist" / "docs"
PAGES = (
    "",
    "tutorials/own-clips.html",
    "how-to/index.html",
    "reference/generated/server.html",
    "reference/python.html",
    "explanation/models.html",
    "gallery.html",
    "search.html?q=retention",
)

TASKS = {
    "power analysis": "plan-the-sample",
    "counterbalance": "order-and-counterbalance",
    "demographics": "ask-questions",
    "between subjects": "choose-a-design",
    "screen size": "size-and-devices",
    "keyboard": "size-and-devices",
    "prolific": "recruit",
    "completion code": "recruit",
    "bots": "check-participants",
    "replay": "look-at-one-participant",
    "pause study": "change-a-running-study",
    "exclude participant": "exclude-participants",
    "consent form": "privacy-template",
    "withdraw": "erase-a-person",
    "offline": "lab-study",
    "preregistration": "share-a-study",
    "spss": "use-r-python-spss",
    "cronbach": "analyze-ratings",
    "p value check": "check-a-paper",
    "incomplete blinks": "measure-blinks",
    "many videos": "many-recordings",
    "webcam": "track-a-video",
    "maya": "animate-blinks",
    "password reset": "accounts",
    "upgrade": "update",
    "docker": "deploy",
    # No page has all of these words: those with most of them are listed.
    "correct a typo in a running study": "change-a-running-study",
    "nightly backup cron gzip": "back-up-and-restore",
}
"""Words that a newcomer searches for, and the guide that answers."""
SHOWN_FIRST = 5


@pytest.fixture
def docs_server(server: ServerProcess) -> ServerProcess:
    """A running server; its documentation is what `make setup-test` built."""
    if not (SITE / "index.html").is_file():
        pytest.skip("the documentation is not built: run `make docs`")
    server.start()
    return server


def test_pages_break_no_policy_and_ask_nobody_else(docs_server: ServerProcess, chromium: Browser) -> None:
    page = chromium.new_page()
    complaints: list[str] = []
    requests: list[str] = []
    page.on("console", lambda message: complaints.append(message.text) if message.type == "error" else None)
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.on("request", lambda request: requests.append(request.url))
    for name in PAGES:
        page.goto(f"{docs_server.address}/docs/{name}")
        page.wait_for_load_state("networkidle")
        expect(page.get_by_role("heading", level=1).first).to_be_visible()
    assert not complaints, "\n".join(complaints)
    assert {url for url in requests if not url.startswith((docs_server.address, "data:"))} == set()
    page.close()


def test_search_finds_a_page_and_dark_mode_stays(docs_server: ServerProcess, chromium: Browser) -> None:
    page = chromium.new_page()
    page.goto(f"{docs_server.address}/docs/search.html?q=retention")
    found = page.locator("#search-results li a")
    expect(found.first).to_be_visible()
    assert any("person" in (link.get_attribute("href") or "") for link in found.all())
    page.goto(f"{docs_server.address}/docs/")
    page.locator("button.theme-switch-button").first.click()
    page.locator('button.theme-change-button[data-mode="dark"]').first.click()
    page.goto(f"{docs_server.address}/docs/tutorials/blinks.html")
    assert page.evaluate("document.documentElement.dataset.theme") == "dark"
    assert axe_violations(page) == []
    page.close()


def test_search_lists_the_guide_for_a_task_among_the_first(
    docs_server: ServerProcess, chromium: Browser
) -> None:
    page = chromium.new_page()
    missed = {}
    for words, guide in TASKS.items():
        page.goto(f"{docs_server.address}/docs/search.html?q={words.replace(' ', '+')}")
        expect(page.locator("#search-results .search-summary")).to_contain_text("found")
        links = page.locator("ul.search > li > a").all()[:SHOWN_FIRST]
        names = [(link.get_attribute("href") or "").partition("?")[0] for link in links]
        if not any(f"how-to/{guide}.html" in name for name in names):
            missed[words] = names
    assert not missed
    page.close()


def test_pages_can_be_read_without_javascript(docs_server: ServerProcess, chromium: Browser) -> None:
    context = chromium.new_context(java_script_enabled=False)
    page = context.new_page()
    page.goto(f"{docs_server.address}/docs/")
    page.locator(".sd-card", has_text="I measure blinks").click()
    expect(page.get_by_role("heading", name="Blinks from a recording")).to_be_visible()
    expect(page.get_by_text("stimuli blinks track.csv").first).to_be_visible()
    context.close()


def test_unknown_page_is_refused_and_nothing_outside_is_read(
    docs_server: ServerProcess, chromium: Browser
) -> None:
    page = chromium.new_page()
    for name in ("nothing.html", "..%2f..%2f..%2fpyproject.toml"):
        answer = page.goto(f"{docs_server.address}/docs/{name}")
        assert answer is not None
        assert answer.status == 404
    page.close()
