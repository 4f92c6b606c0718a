"""Adaptive series in a real Chromium: by keyboard and mouse, on without connection, then waiting for it."""

import json
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Page

from tests.browser.analysed import analysed
from tests.browser.served import Served, go_back, reload_in_next_clip, serve, show_to_answers, start_clip
from tests.browser.studies import PLAIN
from tests.browser.visit import axe_violations, wait_until_sent
from tests.helpers.thresholds import FACTORS, TWO_INTERVAL, YES_NO

pytestmark = pytest.mark.browser


def declared(trial: str) -> str:
    between = PLAIN[PLAIN.index("[exemplars]") : PLAIN.index("[trial]")]
    between = between.replace('split_by = "character"\n', "").replace("trials = 1", "trials = 0")
    return PLAIN[: PLAIN.index("[[factors]]")] + FACTORS + between + trial + PLAIN[PLAIN.index("[[forms]]") :]


OFFLINE = declared(
    YES_NO.replace("trials = 8", "trials = 4").replace("ahead = 2", "ahead = 1\npointer_delay_ms = 0")
)


IN_TURN = declared(TWO_INTERVAL.replace("trials = 6", "trials = 2"))
ONE_SERIES = "\n".join(line for line in IN_TURN.splitlines() if '"cartoon"' not in line)


@pytest.fixture(scope="module")
def studies(tmp_path_factory: pytest.TempPathFactory, built_page: Path) -> Iterator[Served]:
    """A server that refuses answers whose clips were not there."""
    made = {
        "yes_no": (OFFLINE, 8),
        "in_turn": (IN_TURN, 8),
        "long_in_turn": (ONE_SERIES, 30),
    }
    with serve(tmp_path_factory.mktemp("thresholds"), made, evidence="refuse") as served:
        yield served


def stored(studies: Served, count: int = 0) -> list[dict[str, object]]:
    return studies.rows_of_latest("thresholds", "trial_index, play", count)


def answer(page: Page, key: str) -> None:
    show_to_answers(page)
    page.keyboard.press(key)
    page.wait_for_selector(".pair-answers", state="detached")


def test_a_series_goes_on_without_connection_as_far_as_declared(studies: Served, page: Page) -> None:
    visit = studies.visit("yes_no", page)
    answer(page, "1")
    show_to_answers(page)
    assert axe_violations(page) == []
    page.click(".pair-answer[data-answer=no]")
    page.wait_for_selector(".pair-answers", state="detached")
    page.wait_for_selector(".ready")
    assert axe_violations(page) == []
    studies.server.rows_soon("SELECT 1 AS one FROM series_answers WHERE threshold IS NOT NULL", 2)
    wait_until_sent(page)
    page.context.set_offline(True)
    for key in ("ArrowLeft", "n", "y", "2"):
        answer(page, key)
    page.wait_for_selector("text=You are offline")
    assert axe_violations(page) == []
    page.context.set_offline(False)
    answer(page, "1")
    answer(page, "2")
    visit.trials()
    rows = stored(studies)
    assert [row["response"] for row in rows] == ["yes", "no", "yes", "no", "yes", "no", "yes", "no"]
    assert {row["verdict"] for row in rows} <= {"good", "uncertain", "flagged"}
    assert [(row["position"], row["known"], row["ahead"]) for row in rows] == [
        *[(1, 0, 0)] * 2,
        *[(2, 1, 0)] * 2,
        *[(3, 1, 1)] * 2,
        *[(4, 3, 0)] * 2,
    ]
    assert all(row["threshold_sd"] for row in rows)


def test_two_clips_in_turn(studies: Served, page: Page, tmp_path: Path) -> None:
    visit = studies.visit("in_turn", page)
    show_to_answers(page)
    assert axe_violations(page) == []
    page.keyboard.press("1")
    page.wait_for_selector(".pair-answers", state="detached")
    for key in ("2", "ArrowRight", "1"):
        answer(page, key)
    visit.trials()
    assert visit.problems == []
    rows = stored(studies)
    assert [row["response"] for row in rows] == ["first", "second", "second", "first"]
    assert all(bool(row["correct"]) == (row["response"] == row["interval"]) for row in rows)
    assert {row["verdict"] for row in rows} <= {"good", "uncertain", "flagged"}
    assert "\n1 participant, from palpebra.sqlite\n" in analysed(studies.server, "in_turn", tmp_path)


@pytest.mark.parametrize(("study", "chosen"), [("yes_no", "yes"), ("in_turn", "first")])
def test_a_reload_on_the_question_returns_to_it(studies: Served, page: Page, study: str, chosen: str) -> None:
    studies.visit(study, page)
    show_to_answers(page)
    page.reload()
    go_back(page)
    page.wait_for_selector(".pair-answers")
    assert "already seen" in page.inner_text(".above")
    page.keyboard.press("1")
    page.wait_for_selector(".ready")
    [row] = stored(studies, 1)
    assert (row["response"], row["views"], row["view_outcomes"], row["rt"]) == (chosen, 1, "shown", None)
    assert json.loads(str(row["disturbances"]))["scale_reloaded"] == 1
    assert row["verdict"] == "flagged"
    assert [view["outcome"] for view in studies.views()] == ["shown"]


def test_a_reload_in_mid_clip_ends_the_view_and_the_trial_comes_again(studies: Served, page: Page) -> None:
    visit = studies.visit("long_in_turn", page)
    reload_in_next_clip(page)
    page.keyboard.press(" ")
    go_back(page)
    for _ in range(2):
        answer(page, "2")
    visit.trials()
    rows = stored(studies)
    [broken] = [row for row in rows if row["response"] is None]
    [again] = [row for row in rows if row["trial_index"] == broken["trial_index"] and row["play"] == 2]
    assert (broken["play"], broken["verdict_rule"]) == (1, "interrupted")
    assert (again["response"], again["views"], again["view_outcomes"]) == ("second", 2, "shown")
    assert len(rows) == 3
    assert sorted(view["outcome"] for view in studies.views()) == ["interrupted", *["shown"] * 2]


def test_stop_stands_beside_the_question_and_not_beside_clips(studies: Served, page: Page) -> None:
    studies.visit("long_in_turn", page)
    assert page.is_visible("text=Stop")
    start_clip(page)
    assert not page.is_visible("text=Stop")
    page.wait_for_selector(".pair-answers")
    page.click("text=Stop")
    page.keyboard.press("1")
    page.click("text=Pause")
    page.wait_for_selector("text=See you later")
    assert stored(studies) == []
