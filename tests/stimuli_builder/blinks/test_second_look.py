"""What the second look knows of a dip: its surroundings, in the other eye and in the recording."""

import numpy as np
import pytest

from bench.lid_event_training import CLASSES, Motion, course, generate, labelled_features
from stimuli_builder.blinks.events.candidates import FEATURES
from stimuli_builder.blinks.events.network import CONTEXT, contexts, looked_at
from stimuli_builder.blinks.profile import Array
from stimuli_builder.blinks.series import BlinkSeries

FPS, SECONDS = 120.0, 12.0
ONSETS_S = (2.0, 3.5, 8.0)


def series(onsets: tuple[float, ...] = ONSETS_S, gap: slice | None = None) -> BlinkSeries:
    """An eye that blinks, with a little noise, and not seen in a gap."""
    times, rng = np.arange(round(SECONDS * FPS)) / FPS, np.random.default_rng(3)
    shut = np.zeros(times.size)
    for onset in onsets:
        shut += course(Motion("blink", onset, 0.1, 0.03, 0.25, 1.0), times, rng)
    distance = 30 * (1 - shut) + rng.normal(0, 0.2, times.size)
    if gap is not None:
        distance[gap] = np.nan
    return BlinkSeries(distance=distance, fps=FPS, column="d", is_px=True)


def told(eyes: list[BlinkSeries]) -> tuple[Array, Array]:
    """Times of the first eye's deep dips and what the second look knows of them."""
    pieces = looked_at(eyes)
    rows = contexts(pieces)
    times = np.concatenate([piece.peaks_s for piece in pieces[0]])
    deep = np.concatenate([piece.depths for piece in pieces[0]]) > 0.5
    return times[deep], np.concatenate(rows[0])[deep]


def value(row: Array, name: str) -> float:
    return float(row[CONTEXT.index(name)])


def test_the_dips_about_are_reported_with_how_far_away_they_are() -> None:
    times, rows = told([series()])
    assert times == pytest.approx([2.12, 3.62, 8.12], abs=0.05)
    assert value(rows[1], "dip -1: log seconds away") == pytest.approx(np.log(1.5), abs=0.02)
    assert value(rows[1], "dip +1: log seconds away") == pytest.approx(np.log(4.5), abs=0.02)
    assert value(rows[1], "dip +1: log probability of blink") == value(rows[2], "log probability of blink")
    assert value(rows[0], "dip -1: log probability of nothing") == 0.0  # there is none
    assert value(rows[0], "dip -1: log seconds away") == np.log(10.0)


def test_the_other_eyes_dip_is_the_one_at_the_same_time() -> None:
    _, rows = told([series(), series((2.05, 8.0))])
    assert [value(row, "other eye has a dip") for row in rows] == [1, 0, 1]
    assert value(rows[0], "tenths of a second to it") == pytest.approx(0.5, abs=0.2)
    assert value(rows[1], "other eye's log probability of nothing") == 0.0


def test_an_eye_alone_answers_for_both() -> None:
    _, rows = told([series()])
    for kind in CLASSES:
        probability = f"log probability of {kind}"
        assert value(rows[1], f"other eye's {probability}") == value(rows[1], probability)


def test_an_eye_that_is_not_seen_does_what_the_other_does() -> None:
    _, alone = told([series()])
    _, rows = told([series(), series(gap=slice(300, 600))])  # from 2.5 to 5 s
    names = [name for name in CONTEXT if name.startswith("both eyes, deepest")]
    assert [value(rows[1], name) for name in names] == [value(alone[1], name) for name in names]
    assert [value(rows[0], name) for name in names] != [value(alone[0], name) for name in names]
    assert [value(row, "other eye has dips") for row in rows] == [1, 0, 1]
    assert value(rows[1], "other eye's log probability of blink") == value(
        rows[1], "log probability of blink"
    )
    assert np.isfinite(rows).all()


def test_rates_leave_out_the_dip_itself() -> None:
    _, rows = told([series()])
    for row in rows:
        assert value(row, "log other blinks a minute") == pytest.approx(np.log1p(2 * 60 / SECONDS), abs=0.1)


def test_a_gap_parts_the_dips_but_not_what_the_eye_does() -> None:
    _, rows = told([series(gap=slice(600, 720))])  # from 5 to 6 s
    assert value(rows[1], "dip +1: log seconds away") == np.log(10.0)
    assert value(rows[2], "log other blinks a minute") == pytest.approx(
        np.log1p(2 * 60 / (SECONDS - 1)), abs=0.1
    )


def test_three_columns_are_three_eyes_alone() -> None:
    columns = [series(), series((2.05, 8.0)), series((4.0,))]
    together = contexts(looked_at(columns))
    for column, rows in zip(columns, together, strict=True):
        [alone] = contexts(looked_at([column]))
        assert np.array_equal(rows[0], alone[0])


@pytest.mark.parametrize("frames", [400, 700])
def test_an_eye_that_was_followed_for_less_is_not_seen_after_that(frames: int) -> None:
    whole = series()
    short = BlinkSeries(distance=whole.distance[:frames], fps=FPS, column="d", is_px=True)
    _, rows = told([whole, short])
    are_seen = [time * FPS < frames for time in (2.1, 3.6, 8.1)]
    assert [value(row, "other eye has dips") for row in rows] == are_seen
    assert np.isfinite(rows).all()
    _, rows = told([short, whole])
    assert np.isfinite(rows).all()


@pytest.mark.parametrize("other", [np.full(1440, 30.0), np.full(1440, np.nan)], ids=["still", "unseen"])
def test_an_eye_without_dips_says_nothing(other: Array) -> None:
    _, rows = told([series(), BlinkSeries(distance=other, fps=FPS, column="d", is_px=True)])
    assert np.isfinite(rows).all()
    assert [value(row, "other eye has dips") for row in rows] == [0, 0, 0]
    still = [BlinkSeries(distance=np.full(1440, 30.0), fps=FPS, column="d", is_px=True)] * 2
    shapes = [row.shape for of_eye in contexts(looked_at(still)) for row in of_eye]
    assert shapes == [(0, len(CONTEXT))] * 2


@pytest.mark.parametrize(("look", "features"), [("first", FEATURES), ("second", CONTEXT)])
def test_each_look_learns_from_its_input(look: str, features: tuple[str, ...]) -> None:
    rows, kinds = labelled_features(look, generate(np.random.default_rng(1), 30, 60.0))
    assert rows.shape == (len(kinds), len(features))
    assert {"blink", "nothing"} <= set(kinds) <= set(CLASSES)
