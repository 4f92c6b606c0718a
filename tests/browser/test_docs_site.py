"""The documentation site under the server's content security policy: no violation, no outside request."""

import re

import pytest
from playwright.sync_api import Browser, Page, expect

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
    "how do I install it without a clone": "install",
}
"""Words that a newcomer searches for, and the guide that answers."""
SHOWN_FIRST = 5

QUESTIONS = {
    "sound": "explanation/limits.html#what-it-cannot-do",
    "cost": "explanation/limits.html#cost-license-and-support",
    "maximum size of a clip": "explanation/limits.html#how-long-how-large-how-many",
    "uninstall": "how-to/install.html#uninstall",
    "forgot password": "how-to/accounts.html#forgot-your-password",
    "port in use": "how-to/troubleshooting.html#setup-and-start",
    "nightly backups": "how-to/back-up-and-restore.html#back-up",
    "typo in a question": "how-to/change-a-running-study.html",
    "what does a quota count": "how-to/recruit.html#send-one-link-to-everyone",
    "size in mm without eyes": "how-to/size-and-devices.html#size-of-your-own-clips-in-mm",
    "completion codes by outcome": "how-to/recruit.html#prolific-sona-and-mechanical-turk",
    "blinks at given times": "how-to/animate-blinks.html",
    "same clip twice": "how-to/order-and-counterbalance.html#how-often-each-clip-is-shown",
    "take part twice": "how-to/recruit.html#one-visit-per-person-prevent-taking-part-twice",
    "infrared": "how-to/track-a-video.html#what-makes-a-good-recording",
    "SPSS differs": "how-to/analyze-ratings.html#why-do-my-numbers-differ-from-spss-jasp-or-r",
    "Word tables": "how-to/analyze-ratings.html#report-for-a-paper-word-latex-figures",
    "SVG": "how-to/analyze-ratings.html#report-for-a-paper-word-latex-figures",
    "jsPsych": "how-to/analyze-ratings.html#data-from-jspsych-psychopy-gorilla-and-others",
    "post hoc": "how-to/analyze-ratings.html#any-table-by-command",
    "Friedman": "how-to/analyze-ratings.html#any-table-by-command",
    "kappa": "explanation/analysis.html#reliability-and-agreement",
    "why excluded": "how-to/exclude-participants.html#why-was-a-participant-excluded",
    "IP address": "how-to/privacy-template.html",
    "duplicate study": "how-to/change-a-running-study.html",
    "rename": "how-to/change-a-running-study.html",
    "response times": "how-to/export-data.html",
    "blink rate": "how-to/measure-blinks.html#what-you-get",
    "wink": "how-to/measure-blinks.html#what-you-get",
    "hundreds of recordings": "how-to/many-recordings.html",
    "tab closed": "how-to/troubleshooting.html#participants",
    "variable frame rate": "how-to/build-a-study.html#your-own-videos",
    "cite": "how-to/share-a-study.html#cite-palpebra",
    "Mac": "how-to/install.html#windows-and-macos",
}
"""Words and the heading that must be first or second in the list: a question of the page How do I ...?"""


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


def links_found(page: Page, server: ServerProcess, words: str) -> list[str]:
    """The addresses that a search lists, without what highlights words."""
    page.goto(f"{server.address}/docs/search.html?q={words.replace(' ', '+')}")
    expect(page.locator("#search-results .search-summary")).to_contain_text("found")
    links = page.locator("ul.search > li > a").all()[:SHOWN_FIRST]
    return [re.sub(r"\?[^#]*", "", link.get_attribute("href") or "") for link in links]


def test_search_lists_the_guide_for_a_task_among_the_first(
    docs_server: ServerProcess, chromium: Browser
) -> None:
    page = chromium.new_page()
    found = {words: links_found(page, docs_server, words) for words in TASKS}
    missed = {
        words: names
        for words, names in found.items()
        if not any(f"how-to/{TASKS[words]}.html" in name for name in names)
    }
    assert not missed
    page.close()


def test_search_lists_the_heading_that_answers_a_question_at_the_top(
    docs_server: ServerProcess, chromium: Browser
) -> None:
    page = chromium.new_page()
    found = {words: links_found(page, docs_server, words) for words in QUESTIONS}
    missed = {words: found[words] for words in QUESTIONS if QUESTIONS[words] not in found[words][:2]}
    assert not missed
    page.goto(f"{docs_server.address}/docs/search.html?q=zzyzx")
    page.get_by_role("link", name="How do I ...? lists all questions.").click()
    expect(page.locator("h1")).to_contain_text("How do I")
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
        expect(page.get_by_role("link", name="How do I")).to_be_visible()
    page.close()
