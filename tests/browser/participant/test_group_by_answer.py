"""A group decided by an answer, in a real browser: the trials follow from the form, in the same visit."""

from pathlib import Path

from playwright.sync_api import BrowserContext

from tests.browser.server_process import ServerProcess
from tests.browser.studies import STUDY
from tests.browser.visit import Visit

# A visit that was left may not be taken up again: so the page must get its trials with the answer.
GROUPS = """\
[session]
resume = "block"

[groups]
by = "form:vision"
answers = { normal = "a", corrected = "b" }

[exemplars]
"""
GROUPED = (
    STUDY.replace('label = "Character"\n', 'label = "Character"\nbetween = true\n')
    .replace('split_by = "character"\n', "")
    .replace("[exemplars]\n", GROUPS)
)


def test_trials_follow_from_the_answer_without_a_second_visit(
    server: ServerProcess, tmp_path: Path, context: BrowserContext
) -> None:
    study = server.add_study(tmp_path / "clips", GROUPED)
    server.start()
    page = context.new_page()
    visit = Visit(page, server.address).open(server.link(study, "preview"), "?simulate=visual")
    page.click(".primary")
    page.wait_for_selector(".code", timeout=90_000)
    assert visit.code()
    assert visit.problems == []
