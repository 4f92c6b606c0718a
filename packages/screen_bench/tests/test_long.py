"""Frames of long clips are distinguished although their bars restart."""

from hypothesis import given
from hypothesis import strategies as st
from screen_bench import bars
from screen_bench.compare import Sight
from screen_bench.long import long_play, unwrapped


@given(st.lists(st.integers(1, bars.MAX_FRAMES), min_size=1, max_size=80))
def test_frames_are_numbered_on_where_the_bars_begin_anew(steps: list[int]) -> None:
    indices, index = [], -1
    for step in steps:
        index += step
        indices.append(index)
    assert unwrapped([index % bars.MAX_FRAMES for index in indices]) == indices


def test_a_frame_in_one_of_both_only_is_counted() -> None:
    numbers = [number % bars.MAX_FRAMES for number in range(200) if number != 70]
    sight = Sight(tuple((number, 10.0 + at) for at, number in enumerate(numbers)), 300.0, 0)
    play = long_play(sight, list(range(200)), 200, "good", (1.0, 2.0), [(20.0, 25.0), (400.0, 500.0)])
    assert play.lost == (70,)
    assert (play.shown, play.logged, play.differing, play.blind_ms) == (199, 200, 1, 5.0)
