"""The bar code that the bench reads from the frame buffer."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from screen_bench import bars

numbers = st.integers(0, bars.MAX_FRAMES - 1)


def values(number: int) -> list[int]:
    """One gray value per bar, as a frame buffer would hold it."""
    return [235 if white else 16 for white in bars.pattern(number)]


@given(numbers)
def test_a_frame_reads_as_its_number(number: int) -> None:
    assert bars.read(values(number)) == number
    row = bars.planes(number)[bars.HEIGHT_PX // 2, bars.BAR_PX // 2 :: bars.BAR_PX]
    assert bars.read([int(value) for value in row]) == number


@given(numbers, st.integers(0, bars.BARS - 1))
def test_one_wrong_bar_is_noticed(number: int, bar: int) -> None:
    changed = values(number)
    changed[bar] = 251 - changed[bar]
    assert bars.read(changed) == bars.UNREADABLE


@given(numbers, st.integers(1, bars.BARS - 1))
def test_a_row_half_surround_is_no_frame(number: int, bar: int) -> None:
    assert bars.read(values(number)[:bar] + [128] * (bars.BARS - bar)) == bars.UNREADABLE


def test_the_surround_is_told_from_a_frame() -> None:
    assert bars.read([128] * bars.BARS) == bars.SURROUND


def test_a_number_too_great_is_refused() -> None:
    with pytest.raises(ValueError, match="expected a frame number from 0 to 63, got 64"):
        bars.pattern(64)
