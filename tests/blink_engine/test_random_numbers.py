"""The generator against its published reference, and the laws against scipy."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from blink_engine import Law
from blink_engine.laws import MASK, RandomNumbers, SplitMix32, normal_quantile


def test_xoshiro_equals_its_published_code() -> None:
    # Transcribed from the authors' xoshiro128starstar.c, on state 1, 2, 3, 4.
    state = [1, 2, 3, 4]
    expected = []
    for _ in range(50):
        rotated = (state[1] * 5) & MASK
        expected.append(((((rotated << 7) | (rotated >> 25)) & MASK) * 9) & MASK)
        carried = (state[1] << 9) & MASK
        state[2] ^= state[0]
        state[3] ^= state[1]
        state[1] ^= state[2]
        state[0] ^= state[3]
        state[2] ^= carried
        state[3] = ((state[3] << 11) | (state[3] >> 21)) & MASK
    assert expected[:4] == [11520, 0, 5927040, 70819200]  # as printed by that program
    numbers = RandomNumbers(0)
    numbers._state = [1, 2, 3, 4]
    assert [numbers.integer() for _ in range(50)] == expected


def test_streams_of_one_seed_differ_and_the_same_agree() -> None:
    draws = {stream: RandomNumbers(5, stream).integer() for stream in range(50)}
    assert len(set(draws.values())) == 50
    assert RandomNumbers(5, 3).integer() == RandomNumbers(5 + 2**32, 3).integer()


def test_splitmix_never_fills_a_state_with_zeros() -> None:
    for seed in (0, MASK, 0x61C88647):
        filler = SplitMix32(seed)
        assert any(filler.next() for _ in range(4))


@given(st.floats(1e-300, 1 - 1e-15))
def test_normal_quantile_equals_scipy(probability: float) -> None:
    assert normal_quantile(probability) == pytest.approx(stats.norm.ppf(probability), rel=2e-14, abs=2e-15)


@pytest.mark.parametrize("probability", [0.0, 1.0, -0.1, math.nan])
def test_normal_quantile_refuses(probability: float) -> None:
    with pytest.raises(ValueError, match="between 0 and 1"):
        normal_quantile(probability)


def test_uniform_numbers_are_uniform() -> None:
    numbers = RandomNumbers(11)
    drawn = np.array([numbers.uniform() for _ in range(20_000)])
    assert drawn.min() > 0
    assert drawn.max() < 1
    assert stats.kstest(drawn, "uniform").pvalue > 0.001
    assert abs(np.corrcoef(drawn[:-1], drawn[1:])[0, 1]) < 0.03


def test_the_greatest_uniform_number_is_below_one() -> None:
    class Greatest(RandomNumbers):
        def integer(self) -> int:
            return MASK

    assert Greatest(0).uniform() < 1.0
    assert math.isfinite(Greatest(0).normal())


@pytest.mark.parametrize("law", [Law("lognormal", 3.0, 0.9), Law("gamma", 3.0, 2.4), Law("gamma", 3.0, 0.7)])
def test_laws_draw_what_they_say(law: Law) -> None:
    numbers = RandomNumbers(3)
    drawn = np.array([law.draw(numbers) for _ in range(8000)])
    mean = law.mean
    reference = (
        stats.lognorm(law.spread, scale=law.median)
        if law.kind == "lognormal"
        else stats.gamma(law.spread, scale=mean / law.spread)
    )
    assert stats.kstest(drawn, reference.cdf).pvalue > 0.001
    assert reference.mean() == pytest.approx(mean)
    assert law.with_mean(10.0).mean == pytest.approx(10.0)
