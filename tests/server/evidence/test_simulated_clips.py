"""Trials of several clips, acted in a manner: every clip is fetched, and all last their time."""

from dataclasses import replace
from datetime import timedelta
from pathlib import Path

import pytest

from server.context import Services
from server.models import View
from server.rehearsals.manners import act, manner_called
from server.rehearsals.person import Rater
from tests.conftest import REPOSITORY
from tests.helpers.studies import SHORT, add_study
from tests.helpers.thresholds import TWO_INTERVAL, text_with
from tests.server.trials.test_comparisons import PAIRS

DCR = (REPOSITORY / "experiments" / "dcr-demo.toml").read_text(encoding="utf-8")
SIDE_BY_SIDE = 'presentation = { arrangement = "side_by_side", if_too_narrow = "stack" }'
IN_TURN = """presentation = { arrangement = "one_after_the_other", gap_ms = 300 }
reference = { cell = "a/slow", label = { en = "R", de = "R" }, gap_ms = 200 }"""
VIEWS = SHORT.replace('kind = "clip_rating"', 'kind = "clip_rating"\nviews = 2')
CLIP_S = 30 / 30

SHOWN_S = {
    "reference": (DCR, 2 * CLIP_S + 2.0, 1),
    "views": (VIEWS, 2 * CLIP_S, 2),
    "side by side": (PAIRS, CLIP_S, 1),
    "in turn": (PAIRS.replace(SIDE_BY_SIDE, IN_TURN), 3 * CLIP_S + 0.5, 1),
    "two intervals": (text_with(SHORT, TWO_INTERVAL), 2 * CLIP_S + 0.1, 1),
}
"""A declaration, how long its clips last before an answer, and in how many views."""


@pytest.mark.parametrize("name", SHOWN_S)
def test_answers_to_trials_of_several_clips_are_taken(services: Services, tmp_path: Path, name: str) -> None:
    text, shown_s, per_answer = SHOWN_S[name]
    study = add_study(services, tmp_path / "clips", text, frames=30)
    manner = replace(manner_called("honest"), offline=0, reloads=0, clock_jumps=0)
    [run] = act(services.settings, study.link(synthetic=True), [Rater(1, 1, {})], manner, 1)
    assert run["refused"] == {}
    assert run["answers"] >= 6
    with services.database.read() as session:
        views = session.query(View).filter_by(outcome="shown").all()
    lengths = [one.ended_at_client - one.started_at_client for one in views if one.ended_at_client]
    assert lengths
    assert min(lengths) > timedelta(seconds=shown_s)
    assert min(lengths) < timedelta(seconds=shown_s + 6)
    assert [one.clip_ms for one in views] == pytest.approx([1000 * shown_s / per_answer] * len(views))
