"""Reload, a second tab, another device, no connection, a server that dies: the run goes on."""

from pathlib import Path

import pytest
from playwright.sync_api import Browser, BrowserContext, Page

from tests.browser.server_process import ServerProcess
from tests.browser.studies import PLAIN, without
from tests.browser.visit import Visit, axe_violations

pytestmark = pytest.mark.browser
PAUSE_MS = 3_000
PAUSE = (
    "ms => new Promise(go => { const from = performance.now(); "
    "setTimeout(() => go(performance.now() - from), ms); })"
)
"""A person who reads; resolves with how long it took by the page's clock."""
RATED = "SELECT trial_index, play, response FROM ratings WHERE kind = 'main' ORDER BY time_elapsed"


def started(server: ServerProcess, folder: Path, page: Page, kind: str = "general") -> tuple[Visit, str]:
    """A visit in front of its first main trial."""
    study = server.add_study(folder, PLAIN)
    server.start()
    link = study.link_token if kind == "general" else server.link(study, "personal")
    visit = Visit(page, server.address).open(link).begin().instructions().practice()
    page.wait_for_selector(".ready")
    return visit, link


def test_a_reload_goes_on_at_the_next_unanswered_trial(
    server: ServerProcess, tmp_path: Path, page: Page
) -> None:
    visit, link = started(server, tmp_path / "clips", page)
    visit.trials(most=2)
    page.wait_for_selector(".ready")
    visit.open(link)
    page.wait_for_selector("text=Welcome back")
    assert "2 of 6" in page.inner_text(".prose")
    assert axe_violations(page) == []
    visit.instructions()
    assert visit.trials() == 4
    assert len(server.rows(RATED)) == 6
    code = visit.code()
    visit.open(link)
    page.wait_for_selector(".code")
    assert visit.code() == code


def test_time_before_a_reload_counts(server: ServerProcess, tmp_path: Path, page: Page) -> None:
    """Of the instructions, and of the ready page after an answer: both were lost with the page."""
    study = server.add_study(tmp_path / "clips", without(PLAIN, ("trials = 1", "trials = 0")))
    server.start()
    visit = Visit(page, server.address).open(study.link_token).begin()
    page.wait_for_selector("text=What you will do")
    read_ms = page.evaluate(PAUSE, PAUSE_MS)
    page.reload()
    visit.instructions().trials(most=1)
    page.wait_for_selector(".ready")
    rested_ms = page.evaluate(PAUSE, PAUSE_MS)
    visit.open(study.link_token)
    visit.instructions().trials()
    first, second, *_ = (
        row["time_elapsed"] for row in server.rows_soon("SELECT * FROM trial_ratings ORDER BY trial_index", 6)
    )
    assert first >= read_ms
    assert second - first >= rested_ms


def test_offline_answers_are_kept_and_sent_later(server: ServerProcess, tmp_path: Path, page: Page) -> None:
    visit, _ = started(server, tmp_path / "clips", page)
    page.context.set_offline(True)
    visit.trials(most=3)
    assert server.rows(RATED) == []
    page.context.set_offline(False)
    visit.trials()
    assert len(server.rows_soon(RATED, 6)) == 6
    types = {row["type"] for row in server.rows("SELECT type FROM run_events")}
    assert {"offline", "online"} <= types


def test_the_server_dies_while_the_page_is_reloaded(
    server: ServerProcess, tmp_path: Path, page: Page
) -> None:
    visit, link = started(server, tmp_path / "clips", page)
    visit.trials(most=1)
    page.wait_for_selector(".ready")
    server.kill()
    visit.rate("2")
    page.wait_for_selector(".ready")
    server.start()
    visit.open(link)
    page.wait_for_selector("text=2 of 6")
    visit.instructions()
    assert visit.trials() == 4
    assert [row["response"] for row in server.rows(RATED)] == [4, 2, 4, 4, 4, 4]


def test_a_second_tab_gets_a_message_and_may_take_over(
    server: ServerProcess, tmp_path: Path, context: BrowserContext, page: Page
) -> None:
    _, link = started(server, tmp_path / "clips", page)
    second = context.new_page()
    visit = Visit(second, server.address).open(link)
    second.wait_for_selector("text=open in another tab")
    assert axe_violations(second) == []
    second.get_by_role("button", name="Continue here").click()
    second.wait_for_selector(".prose")
    page.wait_for_selector("text=continues in another tab")
    assert axe_violations(page) == []
    second.click(".primary")
    assert visit.trials() == 6
    assert len(server.rows(RATED)) == 6


def test_another_device_goes_on_by_the_personal_link(
    server: ServerProcess, tmp_path: Path, chromium: Browser, page: Page
) -> None:
    visit, link = started(server, tmp_path / "clips", page, kind="personal")
    visit.trials(most=2)
    page.wait_for_selector(".ready")
    other = chromium.new_context(locale="en-GB")
    elsewhere = Visit(other.new_page(), server.address).open(link)
    elsewhere.page.wait_for_selector("text=2 of 6")
    elsewhere.instructions()
    assert elsewhere.trials() == 4
    visit.rate("1")
    page.wait_for_selector("text=continued in another place")
    other.close()
    assert [row["response"] for row in server.rows(RATED)] == [4] * 6
    assert [row["status"] for row in server.rows("SELECT status FROM study_runs")] == ["complete"]


def test_stopping_pauses_or_withdraws(server: ServerProcess, tmp_path: Path, page: Page) -> None:
    study = server.add_study(tmp_path / "clips", PLAIN)
    server.start()
    visit = Visit(page, server.address).open(study.link_token).begin()
    page.wait_for_selector("text=What you will do")
    page.click("text=Stop")
    page.wait_for_selector("dialog")
    assert axe_violations(page) == []
    page.click("text=Pause")
    page.wait_for_selector("text=See you later")
    visit.open(study.link_token)
    page.wait_for_selector("text=What you will do")
    page.click("text=Stop")
    page.click("text=Withdraw")
    page.wait_for_selector("text=You have withdrawn")
    assert [row["status"] for row in server.rows("SELECT status FROM study_runs")] == ["withdrawn"]
    visit.open(study.link_token)
    page.wait_for_selector("text=You have withdrawn")


def test_a_resume_code_goes_on_in_another_browser_and_an_id_alone_does_not(
    server: ServerProcess, tmp_path: Path, page: Page, chromium: Browser
) -> None:
    study = server.add_study(tmp_path / "clips", PLAIN)
    server.start()
    link = server.link(study, "general", recruiter={"kind": "sona"})
    visit = Visit(page, server.address).open(link, "?survey_code=40177").begin()
    note = page.wait_for_selector("text=Resume code:")
    code = note.inner_text().split("Resume code: ")[1].split(".")[0]
    visit.instructions().practice().trials(most=2)
    with chromium.new_context() as elsewhere:
        other = Visit(elsewhere.new_page(), server.address).open(link, "?survey_code=40177")
        other.page.click(".primary")
        other.page.wait_for_selector("text=others may know your sign-up number")
        assert axe_violations(other.page) == []
        field = other.page.get_by_label("Resume code")
        field.fill("0000-0000-0000")
        field.press("Enter")
        other.page.wait_for_selector("text=There is no visit with this code")
        field.fill(code.lower())
        field.press("Enter")
        other.page.wait_for_selector("text=Welcome back")
        other.open(link, "?survey_code=40177")  # this browser keeps the code
        other.page.wait_for_selector("text=Welcome back")
        assert other.instructions().trials() == 4
    assert len(server.rows(RATED)) == 6
    assert len(server.rows("SELECT id FROM study_runs")) == 1
