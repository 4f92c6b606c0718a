"""Every page of the admin site, opened in a real browser: it shows what it should, axe finds nothing, no
complaint reaches the console (a blocked style or script would), in light and dark, wide and narrow."""

import csv
import io
import os
import re
from pathlib import Path
from xml.etree import ElementTree

import pyotp
import pytest
from playwright.sync_api import Route, expect

from tests.browser.admin.conftest import Dashboard
from tests.browser.visit import axe_violations
from tests.helpers.admins import PASSWORD

pytestmark = pytest.mark.browser
PAGES = {
    "studies": ("/", "A short study"),
    "new": ("/studies/new", "New study"),
    "design": ("/studies/short", "trials per participant"),
    "build": ("/studies/short/build", "Save as a new version"),
    "build-factors": ("/studies/short/build?section=factors", "Add factor"),
    "build-trial": ("/studies/short/build?section=trial", "As participants see it"),
    "build-order": ("/studies/short/build?section=order", "Split by"),
    "build-forms": ("/studies/short/build?section=forms", "Add from the question bank"),
    "build-texts": ("/studies/short/build?section=texts", "Consent (Markdown)"),
    "build-screen": ("/studies/short/build?section=screen", "Inter ocular (mm)"),
    "build-rules": ("/studies/short/build?section=rules", "Add exclusion"),
    "build-keeping": ("/studies/short/build?section=dataset", "Identifiers"),
    "build-analysis": ("/studies/short/build?section=analysis", "Statistic"),
    "clips": ("/studies/short/clips", "8 clips"),
    "links": ("/studies/short/links", "New links"),
    "monitor": ("/studies/short/monitor", "Progress"),
    "results": ("/studies/short/results", "Analysis reports"),
    "data": ("/studies/short/data", "Psych-DS dataset"),
    "participants": ("/studies/short/participants", "8 of 8"),
    "settings": ("/studies/short/settings", "Paused: no new participants"),
    "settings-recruitment": ("/studies/short/settings?part=recruitment", "Recruited through"),
    "settings-languages": ("/studies/short/settings?part=languages", "Buttons, hints and errors"),
    "settings-retention": ("/studies/short/settings?part=retention", "No period is declared"),
    "settings-sharing": ("/studies/short/settings?part=sharing", "Grant"),
    "settings-versions": ("/studies/short/settings?part=versions", "Made"),
    "settings-danger": ("/studies/short/settings?part=danger", "Short name of the copy"),
    "people": ("/people", "Invite someone"),
    "workspaces": ("/workspaces", "Add member"),
    "backups": ("/backups", "The server does not know where its backups are"),
    "audit": ("/audit", "account created: account ada"),
    "account": ("/account", "API tokens"),
    "blinks": ("/blinks", "Component 1"),
    "labelling": ("/labelling", "Mark points around the eyes"),
    "review": ("/blink-review", "The blinks that"),
}

WATCH_FOR_A_NOTICE = """() => {
    const box = (selector) => document.querySelector(selector).getBoundingClientRect().toJSON();
    const filler = document.createElement("div");
    filler.style.height = "2000px";
    document.querySelector(".mantine-Modal-body").append(filler);
    window.seen = new Promise((done) => new MutationObserver(() => {
        if (document.querySelector(".mantine-Notification-root"))
            done([".mantine-Notification-root", ".mantine-Modal-content", ".tabs-line"].map(box));
    }).observe(document.body, { subtree: true, childList: true }));
}"""
"""The places of notice, dialog and tabs in the moment that a notice comes: it goes by itself."""

CUT_OFF = """[...document.querySelectorAll(".mantine-SegmentedControl-root")]
    .filter((choices) => choices.scrollWidth > choices.clientWidth).map((choices) => choices.innerText)"""
"""Rows of choices whose last ones are not to be seen."""


def shoot(dashboard: Dashboard, name: str) -> None:
    folder = os.environ.get("SCREENSHOTS")
    if folder:
        dashboard.page.screenshot(path=Path(folder) / f"admin-{name}.png")


@pytest.mark.parametrize("name", PAGES)
def test_a_page_shows_what_it_should_and_is_accessible(dashboard: Dashboard, name: str) -> None:
    path, words = PAGES[name]
    dashboard.complaints.clear()
    page = dashboard.open(path)
    page.get_by_text(words).first.wait_for()
    page.wait_for_timeout(300)
    shoot(dashboard, name)
    assert axe_violations(dashboard.page) == []
    assert dashboard.complaints == []


@pytest.mark.parametrize("name", PAGES)
def test_dark_and_narrow(dashboard: Dashboard, name: str) -> None:
    page = dashboard.page
    page.emulate_media(color_scheme="dark")
    page.set_viewport_size({"width": 390, "height": 844})
    try:
        path, words = PAGES[name]
        dashboard.open(path).get_by_text(words).first.wait_for()
        page.wait_for_timeout(300)
        shoot(dashboard, f"{name}-dark-narrow")
        width = page.evaluate("document.documentElement.scrollWidth")
        assert width <= 390, f"the page is {width} px wide on a screen of 390"
        assert page.evaluate(CUT_OFF) == []
        assert axe_violations(dashboard.page) == []
    finally:
        page.emulate_media(color_scheme="light")
        page.set_viewport_size({"width": 1280, "height": 800})


def test_the_monitor_is_live(dashboard: Dashboard) -> None:
    page = dashboard.open("/studies/short/monitor")
    expect(page.get_by_text("finished").first).to_be_visible()
    assert page.locator("canvas").count() == 4


def test_a_figure_is_saved_as_picture_and_numbers(dashboard: Dashboard) -> None:
    """The picture is whole by itself: it has legend and caption, and no colour of the page."""
    page = dashboard.open("/studies/short/results")
    saved = {}
    for kind in ("SVG", "CSV"):
        with page.expect_download() as download:
            page.get_by_role("button", name=re.compile(f"Save as {kind}: Marginal means of .* x .*")).click()
        saved[kind] = Path(download.value.path()).read_text(encoding="utf-8")
    picture = ElementTree.fromstring(saved["SVG"])
    texts = {"".join(text.itertext()) for text in picture.iter("{http://www.w3.org/2000/svg}text")}
    header, *rows = list(csv.reader(io.StringIO(saved["CSV"])))
    assert header[2:] == ["mean", "se_within", "ci95_low", "ci95_high", "participants"]
    assert {cell for row in rows for cell in row[:2]} <= texts
    assert "Bars: 95% within-participant CI (Cousineau-Morey)." in " ".join(
        "".join(text.itertext()) for text in picture.iter("{http://www.w3.org/2000/svg}text")
    )
    assert float(picture.attrib["height"]) > 250
    assert "var(--mantine" not in saved["SVG"]
    with page.expect_download() as download:
        page.get_by_role("button", name=re.compile("Save as PNG: Marginal means of .* x .*")).click()
    png = Path(download.value.path()).read_bytes()
    width, height = int.from_bytes(png[16:20]), int.from_bytes(png[20:24])
    assert png[:8] == b"\x89PNG\r\n\x1a\n"
    assert (width, height) == (3 * 640, round(3 * float(picture.attrib["height"])))


def test_the_timeline_of_a_run_shows_each_trial(dashboard: Dashboard) -> None:
    page = dashboard.open("/studies/short/participants")
    page.get_by_role("table").get_by_role("link").first.click()
    page.get_by_text("Each frame drawn").wait_for()
    run = page.url.rsplit("/", 1)[1]
    expect(page.get_by_role("main").get_by_text(run)).to_have_count(1)
    shoot(dashboard, "timeline")
    assert axe_violations(page) == []


def test_a_page_asked_for_before_signing_in_opens_afterwards(dashboard: Dashboard) -> None:
    browser = dashboard.page.context.browser
    assert browser is not None
    context = browser.new_context(locale="en-GB")
    page = context.new_page()
    page.goto(f"{dashboard.server.address}/admin/studies/short/links")
    page.get_by_label("Name").fill("ada")
    page.locator("input[autocomplete=current-password]").fill(PASSWORD)
    assert axe_violations(page) == []
    page.get_by_role("button", name="Sign in").click()
    expect(page.get_by_role("heading", name="New links")).to_be_visible()
    context.close()


def test_files_and_capsule_are_of_the_series_chosen(dashboard: Dashboard) -> None:
    """The server's answer, with a second series in it."""
    page, asked = dashboard.page, []

    def with_another_series(route: Route) -> None:
        known = route.fetch().json()
        second = known["series"][0] | {"number": 2, "name": "series 2 (version 2)"}
        route.fulfill(json=known | {"series": [*known["series"], second]})

    def no_capsule(route: Route) -> None:
        if route.request.method == "GET":
            route.continue_()
        else:
            asked.append(route.request.post_data_json)
            route.fulfill(status=409, json={"error": {"code": "conflict", "message": "Not now."}})

    page.route("**/api/admin/studies/short", with_another_series)
    page.route("**/capsules", no_capsule)
    try:
        dashboard.open("/studies/short/data").get_by_label("Data series").first.click()
        page.get_by_role("option", name="series 2 (version 2)").click()
        file = page.get_by_role("link", name="Download ratings.csv")
        expect(file).to_have_attribute("href", re.compile(r"ratings\.csv\?series=2$"))
        expect(page.get_by_text("server capsule short --series 2 --out")).to_be_visible()
        page.get_by_role("button", name="Create capsule").click()
        page.get_by_text("Not now.").wait_for()
        assert [order["series"] for order in asked] == [2]
    finally:
        page.unroute("**/api/admin/studies/short")
        page.unroute("**/capsules")


def test_a_notice_covers_neither_tabs_nor_a_dialog_on_a_phone(dashboard: Dashboard) -> None:
    """The longest dialog there can be, and a refusal that comes while it is open."""
    page = dashboard.page
    page.set_viewport_size({"width": 390, "height": 844})
    held: list[Route] = []
    page.route(
        "**/capsules",
        lambda route: held.append(route) if route.request.method == "POST" else route.continue_(),
    )
    try:
        dashboard.open("/studies/short/data").get_by_role("button", name="Create capsule").click()
        page.get_by_role("button", name="Close study").click()
        page.get_by_role("dialog").get_by_role("button", name="Cancel").wait_for()
        page.evaluate(WATCH_FOR_A_NOTICE)
        held[0].fulfill(
            status=409, json={"error": {"code": "conflict", "message": "A capsule is being made. " * 20}}
        )
        notice, dialog, tabs = page.evaluate("window.seen")
        assert tabs["bottom"] <= notice["top"]
        assert dialog["bottom"] <= notice["top"]
        assert dialog["height"] > 400
    finally:
        page.unroute("**/capsules")
        page.set_viewport_size({"width": 1280, "height": 800})


@pytest.mark.parametrize("token", ["", "nonsense"])
def test_an_invitation_that_is_none_says_what_to_do(dashboard: Dashboard, token: str) -> None:
    browser = dashboard.page.context.browser
    assert browser is not None
    context = browser.new_context(locale="en-GB")
    page = context.new_page()
    page.goto(f"{dashboard.server.address}/admin/invitation#{token}")
    expect(page.get_by_role("alert")).to_contain_text("Ask an owner of this server for a new one")
    assert axe_violations(page) == []
    context.close()


def test_the_second_factor_is_set_up_and_turned_off(dashboard: Dashboard) -> None:
    page = dashboard.open("/account")
    page.get_by_role("button", name="Set up").click()
    secret = page.locator("pre").first.inner_text().strip()
    assert axe_violations(page) == []
    shoot(dashboard, "second-factor")
    page.get_by_label("Code from the app").locator("input").first.click()
    page.keyboard.type(pyotp.TOTP(secret).now())
    expect(page.get_by_text("Keep these recovery codes")).to_be_visible()
    page.get_by_label("Password to turn it off").fill(PASSWORD)
    page.get_by_role("button", name="Turn off").click()
    expect(page.get_by_role("button", name="Set up")).to_be_visible()


def test_a_participant_is_excluded_and_taken_back(dashboard: Dashboard) -> None:
    page = dashboard.open("/studies/short/participants")
    page.get_by_role("table").get_by_role("link").first.click()
    page.get_by_role("button", name="Exclude").click()
    page.get_by_label("Reason").fill("asked us to")
    page.get_by_role("dialog").get_by_role("button", name="Exclude").click()
    expect(page.get_by_text("Excluded: asked us to")).to_be_visible()
    page.get_by_role("button", name="Undo the exclusion").click()
    expect(page.get_by_text("Excluded: asked us to")).to_be_hidden()


def test_a_misspelt_key_is_shown_at_its_line(dashboard: Dashboard) -> None:
    page = dashboard.open("/studies/new")
    page.get_by_role("tab", name="From a definition (TOML)").click()
    page.get_by_label("Definition", exact=True).fill('name = "x"\ntitel = "y"\n')
    expect(page.get_by_text(re.compile("did you mean 'title'"))).to_be_visible()
    page.get_by_role("button", name="Line 2").click()
    assert page.evaluate("window.getSelection().toString()") == 'titel = "y"'


def test_the_keyboard_reaches_the_content(dashboard: Dashboard) -> None:
    page = dashboard.open("/")
    page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.textContent") == "Skip to the content"


def test_signing_out_and_in(dashboard: Dashboard) -> None:
    page = dashboard.open("/")
    page.get_by_role("button", name="ada").click()
    page.get_by_role("menuitem", name="Sign out").click()
    page.get_by_label("Name").fill("ada")
    page.locator("input[autocomplete=current-password]").fill("wrong")
    page.get_by_role("button", name="Sign in").click()
    expect(page.get_by_text("Name or password is wrong.")).to_be_visible()
    page.locator("input[autocomplete=current-password]").fill("correct horse battery")
    page.get_by_role("button", name="Sign in").click()
    expect(page.get_by_role("heading", name="Studies")).to_be_visible()


def test_ids_are_copied_whole_and_the_monitor_counts_main_trials(dashboard: Dashboard) -> None:
    page = dashboard.open("/studies/short/monitor")
    page.context.grant_permissions(["clipboard-read", "clipboard-write"])
    # 12 trials: two of practice and two attention questions do not count.
    expect(page.get_by_role("cell", name="8 of 8")).to_have_count(3)
    expect(page.get_by_role("cell", name=re.compile("of 12"))).to_have_count(0)
    expect(page.get_by_text("attention questions and checks are not counted")).to_be_visible()

    page.locator("table.runs a").first.click()
    page.get_by_role("button", name=re.compile("Copy run id")).click()
    expect(page.get_by_role("button", name=re.compile("Copied run id"))).to_be_visible()
    run = page.url.rpartition("/")[2]
    assert page.evaluate("navigator.clipboard.readText()") == run
    expect(page.get_by_title(run)).to_be_visible()

    page.goto(f"{dashboard.server.address}/admin/studies/short/settings?part=versions")
    page.get_by_role("button", name=re.compile("Copy SHA-256")).first.click()
    expect(page.get_by_role("button", name=re.compile("Copied SHA-256"))).to_be_visible()
    assert re.fullmatch("[0-9a-f]{64}", page.evaluate("navigator.clipboard.readText()"))
    assert axe_violations(page) == []
