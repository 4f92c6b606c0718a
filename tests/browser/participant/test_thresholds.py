"""Adaptive series in a real Chromium: by keyboard and mouse, on without connection, then waiting for it."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Page

from server.cli_common import migrated_services
from tests.browser.server_process import ServerProcess
from tests.browser.studies import PLAIN
from tests.browser.visit import Visit, axe_violations
from tests.helpers.thresholds import FACTORS, TWO_INTERVAL, YES_NO, thresholds

pytestmark = [pytest.mark.browser, pytest.mark.slow]


def declared(trial: str) -> str:
    between = PLAIN[PLAIN.index("[exemplars]") : PLAIN.index("[trial]")]
    between = between.replace('split_by = "character"\n', "").replace("trials = 1", "trials = 0")
    return PLAIN[: PLAIN.index("[[factors]]")] + FACTORS + between + trial + PLAIN[PLAIN.index("[[forms]]") :]


@pytest.fixture
def strict(tmp_path: Path, built_page: Path) -> Iterator[ServerProcess]:
    """A server that refuses answers whose clips were not there."""
    process = ServerProcess(tmp_path / "data", evidence="refuse")
    yield process
    process.stop()


def show(page: Page) -> None:
    page.wait_for_selector(".ready")
    page.keyboard.press(" ")
    page.wait_for_selector(".pair-answers")


def answer(page: Page, key: str) -> None:
    show(page)
    page.keyboard.press(key)
    page.wait_for_selector(".pair-answers", state="detached")


def rows_of(server: ServerProcess) -> list[dict[str, object]]:
    with migrated_services(server.settings) as services, services.database.read() as session:
        return [dict(row) for row in thresholds(session)]


def test_a_series_goes_on_without_connection_as_far_as_declared(
    strict: ServerProcess, tmp_path: Path, page: Page
) -> None:
    trial = YES_NO.replace("trials = 8", "trials = 4").replace("ahead = 2", "ahead = 1\npointer_delay_ms = 0")
    link = strict.add_study(tmp_path / "clips", declared(trial)).link_token
    strict.start()
    visit = Visit(page, strict.address).open(link).begin().instructions()
    answer(page, "1")
    show(page)
    assert axe_violations(page) == []
    page.click(".pair-answer[data-answer=no]")
    page.wait_for_selector(".pair-answers", state="detached")
    page.wait_for_selector(".ready")
    assert axe_violations(page) == []
    strict.rows_soon("SELECT 1 AS one FROM series_answers WHERE threshold IS NOT NULL", 2)
    page.wait_for_load_state("networkidle")
    page.context.set_offline(True)
    for key in ("ArrowLeft", "n", "y", "2"):
        answer(page, key)
    page.wait_for_selector("text=There is no connection")
    assert axe_violations(page) == []
    page.context.set_offline(False)
    answer(page, "1")
    answer(page, "2")
    visit.trials()
    rows = rows_of(strict)
    assert [row["response"] for row in rows] == ["yes", "no", "yes", "no", "yes", "no", "yes", "no"]
    assert {row["verdict"] for row in rows} <= {"good", "uncertain", "flagged"}
    assert [(row["position"], row["known"], row["ahead"]) for row in rows] == [
        *[(1, 0, 0)] * 2,
        *[(2, 1, 0)] * 2,
        *[(3, 1, 1)] * 2,
        *[(4, 3, 0)] * 2,
    ]
    assert all(row["threshold_sd"] for row in rows)


def test_two_clips_in_turn(strict: ServerProcess, tmp_path: Path, page: Page) -> None:
    trial = TWO_INTERVAL.replace("trials = 6", "trials = 2")
    link = strict.add_study(tmp_path / "clips", declared(trial)).link_token
    strict.start()
    visit = Visit(page, strict.address).open(link).begin().instructions()
    show(page)
    assert axe_violations(page) == []
    page.keyboard.press("1")
    page.wait_for_selector(".pair-answers", state="detached")
    for key in ("2", "ArrowRight", "1"):
        answer(page, key)
    visit.trials()
    assert visit.problems == []
    rows = rows_of(strict)
    assert [row["response"] for row in rows] == ["first", "second", "second", "first"]
    assert all(bool(row["correct"]) == (row["response"] == row["interval"]) for row in rows)
    assert {row["verdict"] for row in rows} <= {"good", "uncertain", "flagged"}
