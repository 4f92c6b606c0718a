"""A pair in a real Chromium: both clips by one clock, answered by keyboard, stored with both logs."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Page

from server.cli_common import migrated_services
from server.models import View, ViewClip
from server.participation.views import unpack_log
from tests.browser.analysed import analysed
from tests.browser.served import Served, go_back, reload_in_next_clip, serve, show_to_answers, start_clip
from tests.browser.studies import PLAIN
from tests.browser.visit import Visit, axe_violations

pytestmark = pytest.mark.browser

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


IN_TURN = PAIRS.replace(
    'arrangement = "side_by_side", if_too_narrow = "stack"',
    'arrangement = "one_after_the_other", gap_ms = 100',
)
STACKED = PAIRS.replace('arrangement = "side_by_side", if_too_narrow = "stack"', 'arrangement = "stacked"')


@pytest.fixture(scope="module")
def studies(tmp_path_factory: pytest.TempPathFactory, built_page: Path) -> Iterator[Served]:
    """A server that refuses answers whose clips were not there."""
    made = {"pairs": (PAIRS, 8), "long_pairs": (PAIRS, 60), "in_turn": (IN_TURN, 8), "stacked": (STACKED, 8)}
    with serve(tmp_path_factory.mktemp("pairs"), made, evidence="refuse") as served:
        yield served


def stored(studies: Served, count: int = 0) -> list[dict[str, object]]:
    return studies.rows_of_latest("comparisons", "time_elapsed, play", count)


def answer(page: Page, key: str) -> None:
    page.keyboard.press(key)
    page.wait_for_selector(".pair-answers", state="detached")


def test_pairs_by_keyboard(studies: Served, page: Page, tmp_path: Path) -> None:
    visit = studies.visit("pairs", page)
    for key in ("ArrowRight", "3"):
        show_to_answers(page)
        assert axe_violations(page) == []
        answer(page, key)
    visit.trials()
    assert visit.problems == []
    rows = stored(studies)
    ids = [view["id"] for view in studies.views()]
    with migrated_services(studies.server.settings) as services, services.database.read() as session:
        views = session.query(View).where(View.id.in_(ids)).order_by(View.trial_index).all()
        logs = {view.trial_index: [] for view in views}
        for view in views:
            assert view.completed
            clips = session.query(ViewClip).filter_by(view=view.id).order_by(ViewClip.role)
            logs[view.trial_index] = [(clip.role, unpack_log(clip.frame_log)) for clip in clips]
    assert [row["winner"] for row in rows] == ["right", "tie"]
    digests = studies.server.rows("SELECT digest_right FROM answer_evidence WHERE clip_ms > 0")
    assert [row["digest_right"] for row in digests][:2] == [1, 1]
    assert [row["arrangement"] for row in rows] == ["side_by_side"] * 2
    assert {row["verdict"] for row in rows} <= {"good", "uncertain", "flagged"}
    for (left, one), (right, other) in logs.values():
        assert (left, right) == ("left", "right")
        assert one == other
        assert len(one) > 0
    said = analysed(studies.server, "pairs", tmp_path)
    assert "participant responses, data series 1" in said
    assert "Choices in each pair" in said


def logs_of(studies: Served) -> list[dict[str, list[tuple[int, float]]]]:
    """The frame log of each clip of each view of the run begun last, by role."""
    ids = [view["id"] for view in studies.views()]
    with migrated_services(studies.server.settings) as services, services.database.read() as session:
        clips = session.query(ViewClip).where(ViewClip.view.in_(ids)).order_by(ViewClip.view).all()
        return [
            {clip.role: unpack_log(clip.frame_log) for clip in clips if clip.view == one}
            for one in sorted(ids)
        ]


def rows_after(studies: Served, page: Page, visit: Visit, keys: tuple[str, ...]) -> list[dict[str, Any]]:
    """Answer a pair by each key, every screen accessible, and give what the server stored."""
    for key in keys:
        show_to_answers(page)
        assert axe_violations(page) == []
        answer(page, key)
    visit.trials()
    assert visit.problems == []
    return stored(studies)


def test_pairs_above_one_another(studies: Served, page: Page) -> None:
    visit = studies.visit("stacked", page)
    page.wait_for_selector(".ready")
    box = page.locator(".trial canvas").bounding_box()
    assert box is not None
    rows = rows_after(studies, page, visit, ("1", "2"))
    assert [row["winner"] for row in rows] == ["left", "right"], "the upper clip is the left one"
    assert [row["arrangement"] for row in rows] == ["stacked"] * 2
    width, height = page.viewport_size["width"], page.viewport_size["height"]
    assert (box["width"] <= width, box["height"] <= height) == (True, True)
    for logs in logs_of(studies):
        assert list(logs) == ["left", "right"]
        assert logs["left"] == logs["right"], "one clock draws both"


def test_pairs_in_turn_with_the_declared_gap(studies: Served, page: Page) -> None:
    visit = studies.visit("in_turn", page)
    rows = rows_after(studies, page, visit, ("1", "3"))
    assert [row["winner"] for row in rows] == ["left", "tie"], "the first clip is the left one"
    assert [row["arrangement"] for row in rows] == ["one_after_the_other"] * 2
    for logs in logs_of(studies):
        assert sorted(logs) == ["first", "second"]
        end, begin = logs["first"][-1][1], logs["second"][0][1]
        assert begin - end >= 100, "the gap is not shorter than declared"


@pytest.mark.parametrize(
    ("study", "key", "winner"), [("pairs", "ArrowLeft", "left"), ("in_turn", "2", "right")]
)
def test_a_reload_on_the_question_returns_to_it(
    studies: Served, page: Page, study: str, key: str, winner: str
) -> None:
    studies.visit(study, page)
    show_to_answers(page)
    page.reload()
    go_back(page)
    page.wait_for_selector(".pair-answers")
    assert "already seen" in page.inner_text(".above")
    answer(page, key)
    page.wait_for_selector(".ready")
    [row] = stored(studies, 1)
    assert (row["winner"], row["views"], row["view_outcomes"], row["rt"]) == (winner, 1, "shown", None)
    assert json.loads(str(row["disturbances"]))["scale_reloaded"] == 1
    assert row["verdict"] == "flagged"
    assert [view["outcome"] for view in studies.views()] == ["shown"]


def test_a_reload_in_the_midst_of_a_pair_ends_its_view_and_it_comes_again(
    studies: Served, page: Page
) -> None:
    visit = studies.visit("long_pairs", page)
    reload_in_next_clip(page)
    page.keyboard.press(" ")
    go_back(page)
    for _ in range(2):
        show_to_answers(page)
        answer(page, "ArrowRight")
    visit.trials()
    first, other, again = stored(studies)
    assert (first["play"], first["winner"], first["verdict_rule"]) == (1, None, "interrupted")
    assert (again["trial_index"], again["play"]) == (first["trial_index"], 2), "at the end of its block"
    assert (again["winner"], again["views"], other["views"]) == ("right", 2, 1)
    outcomes = {(view["trial_index"], view["number"]): view["outcome"] for view in studies.views()}
    assert outcomes == {
        (first["trial_index"], 1): "interrupted",
        (other["trial_index"], 1): "shown",
        (first["trial_index"], 2): "shown",
    }


def test_stop_stands_beside_the_question_and_not_beside_clips(studies: Served, page: Page) -> None:
    studies.visit("long_pairs", page)
    assert page.is_visible("text=Stop")
    start_clip(page)
    assert not page.is_visible("text=Stop")
    page.wait_for_selector(".pair-answers")
    page.click("text=Stop")
    page.keyboard.press("1")
    page.click("text=Pause")
    page.wait_for_selector("text=See you later")
    assert stored(studies) == []
