from fractions import Fraction

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from video_conversion.video_file import STANDARD_RATES, constant_rate, frame_map, typical_rate

RATES = st.sampled_from(STANDARD_RATES)


def times_of(rate: Fraction, count: int) -> list[float]:
    return [float(number / rate) for number in range(count)]


@settings(deadline=None)
@given(RATES, st.integers(2, 200))
def test_times_rounded_to_a_millisecond_are_still_of_a_constant_rate(rate: Fraction, count: int) -> None:
    rounded = [round(time, 3) for time in times_of(rate, count)]
    assert constant_rate(rounded, (rate,)) == rate


@settings(deadline=None)
@given(RATES, st.integers(1, 300), st.floats(-5, 5))
def test_at_its_own_rate_each_frame_shows_itself(rate: Fraction, count: int, start: float) -> None:
    times = [start + time for time in times_of(rate, count)]
    assert frame_map(times, times[-1] + float(1 / rate), rate) == tuple(range(count))


@settings(deadline=None)
@given(st.lists(st.floats(0.002, 0.5), min_size=1, max_size=60), RATES)
def test_a_frame_map_ascends_from_the_first_frame_and_lasts_as_long(
    steps: list[float], rate: Fraction
) -> None:
    times = [0.0]
    for step in steps[:-1]:
        times.append(times[-1] + step)
    end = times[-1] + steps[-1]
    shown = frame_map(times, end, rate)
    assert list(shown) == sorted(shown)
    assert all(0 <= number < len(times) for number in shown)
    assert abs(len(shown) / float(rate) - end) <= max(0.5, 1.0) / float(rate)
    for number, original in enumerate(shown):
        middle = (number + 0.5) / float(rate)
        later = times[original + 1] if original + 1 < len(times) else float("inf")
        assert times[original] <= middle or original == 0
        assert middle < later


def test_a_frame_that_is_shown_longer_is_repeated() -> None:
    assert frame_map([0.0, 0.04, 0.16], 0.20, Fraction(25)) == (0, 1, 1, 1, 2)


def test_half_the_rate_leaves_out_every_other_frame() -> None:
    times = times_of(Fraction(50), 10)
    assert frame_map(times, 0.2, Fraction(25)) == (1, 3, 5, 7, 9)


@pytest.mark.parametrize(("steps_ms", "rate"), [((40, 40, 120, 40), 25), ((33, 34, 33, 100, 33), 30)])
def test_a_variable_rate_has_the_rate_of_its_median_step(steps_ms: tuple[int, ...], rate: int) -> None:
    times = [sum(steps_ms[:number]) / 1000 for number in range(len(steps_ms) + 1)]
    assert constant_rate(times, (None, None)) is None
    assert typical_rate(times) == rate
