"""What the bench calls right, off, missing and not measured, on logs made by hand."""

import pytest
from screen_bench.compare import Change, Play, Record, compare, pair, sights

FPS, FRAMES, PRESSED = 30, 30, 1000.0
PERIOD = 1000 / FPS
DELAY = 20.0


def record(drawn: dict[int, float] | None = None, verdict: str = "good") -> Record:
    """A play drawn on time, changed where `drawn` says so."""
    times = {index: 5 + index * PERIOD for index in range(FRAMES)} | (drawn or {})
    return Record(tuple(times.items()), FRAMES, FPS, verdict, "", times[0])


def log(onsets: dict[int, float] | None = None, without: tuple[int, ...] = ()) -> list[Change]:
    """The poller's log of a play on time, changed where `onsets` says so."""
    times = {index: PRESSED + DELAY + 5 + index * PERIOD for index in range(FRAMES)} | (onsets or {})
    shown = [(at_ms, index, index) for index, at_ms in times.items() if index not in without]
    return [(0.0, -1, -1), *sorted(shown), (PRESSED + 1100, -1, -1)]


def play(changes: list[Change], stored: Record, held_up: tuple[tuple[float, float], ...] = ()) -> Play:
    [sight] = sights(changes)
    return compare(stored, PRESSED, sight, held_up)


def test_a_play_on_time_is_right_and_its_delay_is_no_fault() -> None:
    seen = play(log(), record())
    assert (seen.missing, seen.is_right, seen.is_off, seen.is_measured) == (0, True, False, True)
    assert seen.key_to_pixel_ms == pytest.approx(DELAY + 5)
    assert seen.lag_ms == pytest.approx(DELAY)


def test_a_frame_never_on_the_screen_is_missing() -> None:
    seen = play(log(without=(7,)), record())
    assert (seen.missing, seen.is_right, seen.is_off) == (1, False, True)


def test_a_late_picture_recorded_on_time_is_off() -> None:
    late = {9: PRESSED + DELAY + 5 + 9 * PERIOD + 25}
    seen = play(log(late), record())
    assert (seen.is_off, seen.is_right) == (True, False)
    assert seen.worst_off_ms == pytest.approx(25)


def test_a_late_picture_recorded_as_late_is_not_off() -> None:
    seen = play(log({9: PRESSED + DELAY + 5 + 9 * PERIOD + 25}), record({9: 5 + 9 * PERIOD + 25}))
    assert (seen.is_off, seen.is_right) == (False, False)


def test_a_poller_held_up_within_the_play_cannot_tell() -> None:
    assert not play(log(), record(), ((PRESSED + 300, PRESSED + 320),)).is_measured
    assert play(log(), record(), ((PRESSED - 300, PRESSED - 280),)).is_measured


def test_a_torn_picture_counts_once_it_is_whole() -> None:
    changes = [(0.0, -1, -1), (10.0, 0, 0), (43.0, 1, 0), (45.0, 1, 1), (76.0, -1, 1), (78.0, -1, -1)]
    [sight] = sights(changes)
    assert sight.onsets == ((0, 10.0), (1, 45.0))
    assert (sight.ended_ms, sight.torn) == (78.0, 2)


def test_each_press_is_paired_with_the_clip_that_followed_it() -> None:
    seen = sights([(0.0, -1, -1), (110.0, 0, 0), (150.0, -1, -1), (310.0, 0, 0), (350.0, -1, -1)])
    assert pair([100.0, 200.0, 300.0], seen, [record()] * 3) == [0, None, 1]


def test_presses_and_plays_that_do_not_agree_are_refused() -> None:
    with pytest.raises(ValueError, match="2 start keys were pressed, 1 plays are stored"):
        pair([100.0, 200.0], [], [record()])
