"""Who does not fit the study reads so and gets the way back; who left a form open is led to it."""

from pathlib import Path

from playwright.sync_api import Browser, Page

from tests.browser.server_process import ServerProcess
from tests.browser.studies import PLAIN, STUDY, without
from tests.browser.visit import Visit, axe_violations, fit_card

TOO_OLD = """
[[screening]]
rule = "form_answer"
form = "demographics"
field = "age"
above = 65

"""
CHECKS = '[[screening]]\nrule = "attention_checks_failed"\n\n'
DEVICE = '[[screening]]\nrule = "device"\n\n'
STATUS = "SELECT status FROM study_runs ORDER BY id"
REASON = "SELECT data FROM run_events WHERE type = 'screened_out'"
PROLIFIC = {"kind": "prolific", "code_complete": "GOOD", "code_screened_out": "OUT"}


def screened(declaration: str, rules: str) -> str:
    return without(declaration, ("[texts.en]", rules + "[texts.en]"))


def test_an_answer_screens_out_with_a_code_and_the_way_back(
    server: ServerProcess, tmp_path: Path, page: Page
) -> None:
    words = 'screened_out = "# Not this time\\n\\nWe look for people up to **65**."\ndebrief = "# Thank'
    declared = without(screened(PLAIN, TOO_OLD), ('debrief = "# Thank', words))
    study = server.add_study(tmp_path / "clips", declared)
    server.start()
    link = server.link(study, "general", recruiter=PROLIFIC)
    visit = Visit(page, server.address).open(link, "?PROLIFIC_PID=5f1a9c0e7b2d3c4e5f6a7b8c").begin(age="70")
    page.wait_for_selector("text=Not this time")
    assert axe_violations(page) == []
    assert visit.code() == "OUT"
    back = page.get_attribute("a.primary", "href")
    assert back == "https://app.prolific.com/submissions/complete?cc=OUT"
    assert [row["status"] for row in server.rows(STATUS)] == ["screened_out"]
    assert '"field": "age"' in str(server.rows(REASON))
    visit.open(link, "?PROLIFIC_PID=5f1a9c0e7b2d3c4e5f6a7b8c")  # coming back begins nothing
    page.wait_for_selector("text=Not this time")
    assert visit.code() == "OUT"
    assert len(server.rows(STATUS)) == 1
    assert visit.problems == []


def test_failed_attention_checks_end_the_visit(server: ServerProcess, tmp_path: Path, page: Page) -> None:
    declared = without(screened(PLAIN, CHECKS), ("per_block = 0", "per_block = 1"))
    study = server.add_study(tmp_path / "clips", declared)
    server.start()
    visit = Visit(page, server.address).open(study.link_token).begin().instructions().practice()
    while page.wait_for_selector(".ready, .attention") and not page.query_selector(".attention"):
        visit.rate("4")
    asked = int(page.inner_text(".question strong"))
    page.keyboard.press(str(asked % 7 + 1))
    page.wait_for_selector("text=you do not meet the requirements")
    assert axe_violations(page) == []
    assert page.query_selector(".code") is None  # no code is declared, so nobody is paid by mistake
    assert [row["status"] for row in server.rows(STATUS)] == ["screened_out"]


def test_a_small_screen_is_screened_out_where_declared(
    server: ServerProcess, tmp_path: Path, chromium: Browser
) -> None:
    wide = without(screened(PLAIN, DEVICE), ("minimum_width_px = 320", "minimum_width_px = 800"))
    study = server.add_study(tmp_path / "clips", wide)
    server.start()
    phone = {"width": 390, "height": 700}
    context = chromium.new_context(
        viewport=phone, screen=phone, has_touch=True, is_mobile=True, locale="en-GB"
    )
    page = context.new_page()
    link = server.link(study, "general", recruiter=PROLIFIC)
    visit = Visit(page, server.address).open(link)
    page.wait_for_selector(".code")
    assert "800 by 300" in page.inner_text("main")
    assert axe_violations(page) == []
    assert visit.code() == "OUT"
    visit.open(link)  # coming back shows the same, and begins nothing
    page.wait_for_selector(".code")
    assert "800 by 300" in page.inner_text("main")
    assert visit.code() == "OUT"
    context.close()
    assert [row["status"] for row in server.rows(STATUS)] == ["screened_out"]
    assert "gate_screen" in str(server.rows(REASON))


def test_a_clip_that_cannot_fit_screens_out_on_request(
    server: ServerProcess, tmp_path: Path, page: Page
) -> None:
    wide = without(
        screened(STUDY, DEVICE), ("full_screen = false", "full_screen = false\ninter_ocular_mm = 300.0")
    )
    study = server.add_study(tmp_path / "clips", wide)
    server.start()
    Visit(page, server.address).open(study.link_token).begin()
    fit_card(page)
    page.click("text=Yes, within")
    page.wait_for_selector("text=The clip does not fit")
    assert axe_violations(page) == []
    page.click("text=I have no larger screen")
    page.wait_for_selector("text=you do not meet the requirements")
    assert [row["status"] for row in server.rows(STATUS)] == ["screened_out"]
    assert "clip_too_large" in str(server.rows(REASON))


def test_the_end_leads_back_to_a_form_that_is_missing(
    server: ServerProcess, tmp_path: Path, page: Page
) -> None:
    study = server.add_study(tmp_path / "clips", PLAIN)
    server.start()
    visit = Visit(page, server.address).open(study.link_token).begin().instructions().practice()
    visit.trials(most=6)
    page.wait_for_selector("form")
    server.change("DELETE FROM form_answers")
    page.click(".primary")
    page.wait_for_selector("text=Your age in years")
    assert [row["status"] for row in server.rows(STATUS)] == ["active"]
    visit.form()
    page.wait_for_selector(".code")
    assert [row["status"] for row in server.rows(STATUS)] == ["complete"]
