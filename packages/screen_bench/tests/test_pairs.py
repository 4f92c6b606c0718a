"""When two clips on one canvas count as a frame apart, on logs made by hand."""

import pytest
from screen_bench.compare import Change
from screen_bench.pairs import APART_MS, apart_by_pair, pair_declaration, pair_row

from experiments.load import parse_experiment

FPS, FRAMES = 30, 30
PERIOD = 1000 / FPS
TEAR_MS = 0.6


def shown(start_ms: float, late_ms: float = TEAR_MS) -> list[Change]:
    """A pair whose lower clip comes so much later than the upper one with each frame."""
    changes: list[Change] = [(start_ms - 50, -1, -1)]
    for frame in range(FRAMES):
        at_ms = start_ms + frame * PERIOD
        changes += [(at_ms, frame, frame - 1), (at_ms + late_ms, frame, frame)]
    return [*changes, (start_ms + FRAMES * PERIOD, -1, -1)]


def test_a_picture_that_is_being_written_is_no_frame_apart() -> None:
    assert apart_by_pair([*shown(100), *shown(2000)]) == pytest.approx([TEAR_MS, TEAR_MS])


def test_a_refresh_between_the_two_is_a_frame_apart() -> None:
    row = pair_row(
        "chromium", FPS, 2, {"changes": [*shown(100), *shown(2000, 16.7)], "held_up": []}, [("a", "a")] * 2
    )
    assert (row.seen, row.apart, row.differing_records, row.missing) == (2, 1, 0, 0)
    assert row.apart_ms == pytest.approx(16.7)
    assert row.apart_ms > APART_MS


def test_records_that_differ_and_hold_ups_are_counted() -> None:
    log = {"changes": shown(100), "held_up": [(0.0, 4.5), (7.0, 9.0)]}
    row = pair_row("chromium", FPS, 1, log, [("a", "b")])
    assert (row.differing_records, row.blind_ms) == (1, 4.5)


def test_the_study_of_pairs_is_one_that_loads() -> None:
    experiment = parse_experiment(pair_declaration("pairs", FPS, 7))
    assert experiment.exemplars.per_cell == 7
    assert experiment.trial.kind == "paired_comparison"
