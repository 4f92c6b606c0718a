"""What a real page sends with its answers satisfies a server that refuses what cannot have been."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Page

from tests.browser.server_process import ServerProcess
from tests.browser.studies import STUDY
from tests.browser.visit import Visit

pytestmark = pytest.mark.browser


@pytest.fixture
def strict(tmp_path: Path, built_page: Path) -> Iterator[ServerProcess]:
    """A server that refuses answers and views without evidence."""
    process = ServerProcess(tmp_path / "data", evidence="refuse")
    yield process
    process.stop()


def test_every_answer_of_the_page_brings_its_evidence(
    strict: ServerProcess, tmp_path: Path, page: Page
) -> None:
    study = strict.add_study(tmp_path / "clips", STUDY)
    strict.start()
    visit = Visit(page, strict.address).open(study.link_token)
    visit.begin().measure().instructions().practice()
    assert visit.trials() == 6
    assert visit.problems == []
    answers = strict.rows("SELECT * FROM trial_ratings")
    evidence = strict.rows("SELECT * FROM answer_evidence")
    assert len(evidence) == len(answers) > 6
    with_clips = [row for row in evidence if row["clip_ms"] > 0]
    assert [row["digest_right"] for row in with_clips] == [1] * len(with_clips)
    assert all('"presses"' in row["interaction"] for row in evidence)
    runs = strict.rows("SELECT evidence, view_tickets FROM study_runs")
    assert runs == [{"evidence": "asked", "view_tickets": 1}]
    views = strict.rows("SELECT completed, outcome, issued_at, clip_ms FROM views")
    assert len(views) == len(with_clips)
    assert all(view["issued_at"] and view["completed"] and view["clip_ms"] > 0 for view in views)
    assert strict.rows("SELECT type FROM run_events WHERE type LIKE '%refused'") == []
