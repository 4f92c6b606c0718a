"""A pair in a real Chromium: both clips by one clock, answered by keyboard, stored with both logs."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Page

from server.cli_common import migrated_services
from server.models import View, ViewClip
from server.views.frame_log import unpacked
from tests.browser.server_process import ServerProcess
from tests.browser.studies import PLAIN
from tests.browser.visit import Visit, axe_violations
from tests.helpers.comparisons import comparisons

pytestmark = [pytest.mark.browser, pytest.mark.slow]

PAIRS = (
    PLAIN[: PLAIN.index("[trial]")]
    .replace('split_by = "character"\n', "")
    .replace("per_cell = 3", "per_cell = 2")
    .replace("trials = 1", "trials = 0")
    + """
[trial]
kind = "paired_comparison"
question = { en = "Which blink looked more natural?", de = "Welcher Lidschlag wirkte natürlicher?" }
pairs = { among = "all", exemplars = "matched" }
presentation = { arrangement = "side_by_side", if_too_narrow = "stack" }
ties = { label = { en = "No difference", de = "Kein Unterschied" } }
"""
    + PLAIN[PLAIN.index("[[forms]]") :]
)


@pytest.fixture
def strict(tmp_path: Path, built_page: Path) -> Iterator[ServerProcess]:
    """A server that refuses answers whose clips were not there."""
    process = ServerProcess(tmp_path / "data", evidence="refuse")
    yield process
    process.stop()


def test_pairs_by_keyboard(strict: ServerProcess, tmp_path: Path, page: Page) -> None:
    link = strict.add_study(tmp_path / "clips", PAIRS).link_token
    strict.start()
    visit = Visit(page, strict.address).open(link).begin().instructions()
    for key in ("ArrowRight", "3"):
        page.wait_for_selector(".ready")
        page.keyboard.press(" ")
        page.wait_for_selector(".pair-answers")
        assert axe_violations(page) == []
        page.keyboard.press(key)
        page.wait_for_selector(".pair-answers", state="detached")
    visit.trials()
    assert visit.problems == []
    with migrated_services(strict.settings) as services, services.database.read() as session:
        rows = comparisons(session)
        views = session.query(View).order_by(View.trial_index).all()
        logs = {view.trial_index: [] for view in views}
        for view in views:
            assert view.completed
            clips = session.query(ViewClip).filter_by(view=view.id).order_by(ViewClip.role)
            logs[view.trial_index] = [(clip.role, unpacked(clip.frame_log)) for clip in clips]
    assert [row["winner"] for row in rows] == ["right", "tie"]
    digests = strict.rows("SELECT digest_right FROM answer_evidence WHERE clip_ms > 0")
    assert [row["digest_right"] for row in digests] == [1, 1]
    assert [row["arrangement"] for row in rows] == ["side_by_side"] * 2
    assert {row["verdict"] for row in rows} <= {"good", "uncertain", "flagged"}
    for (left, one), (right, other) in logs.values():
        assert (left, right) == ("left", "right")
        assert one == other
        assert len(one) > 0
