"""The lag of continuous ratings behind events: found where it is known, not found where there is none."""

import numpy as np
import pytest

from analysis.traces import ClipTraces, correlogram, event_train, lag_of, mean_trace

RATE_HZ, LENGTH_S = 10.0, 20.0
EVENTS_S = ((2.2, 7.9, 12.4, 17.0), (1.0, 5.5, 9.1, 15.3))


def clips(lag_s: float, height: float, people: int = 8, seed: int = 3) -> list[ClipTraces]:
    """People who answer each event after `lag_s` by a rise of `height`, and wander meanwhile."""
    rng = np.random.default_rng(seed)
    time_s = np.arange(int(RATE_HZ * LENGTH_S)) / RATE_HZ
    made = []
    for number, events in enumerate(EVENTS_S):
        u = (time_s[:, None] - np.array(events) - lag_s) / 0.6
        answer = np.where(u > 0, u * np.exp(1 - np.clip(u, 0, None)), 0).sum(axis=1)
        wander = np.cumsum(rng.normal(0, 1, (people, time_s.size)), axis=1)
        who = tuple(f"p{index}" for index in range(people))
        made.append(ClipTraces(f"c{number}", "cell", RATE_HZ, events, who, 50 + wander + height * answer))
    return made


@pytest.mark.parametrize("lag_s", [0.4, 0.9, 1.7])
def test_a_known_lag_is_recovered(lag_s: float) -> None:
    found = lag_of(clips(lag_s, 12.0), 3.0)
    assert found is not None
    # An answer begins within the sample after its lag.
    assert found.lag_s == pytest.approx(lag_s + 0.1, abs=0.151)
    assert found.lag_low_s <= found.lag_s <= found.lag_high_s
    assert found.p < 0.01
    assert found.ci_low[0] < found.mean[0] < found.ci_high[0]


def test_ratings_that_answer_nothing_are_not_said_to() -> None:
    results = [lag_of(clips(0.9, 0.0, seed=seed), 3.0, seed=seed) for seed in range(40)]
    significant = sum(one is not None and one.p < 0.05 for one in results)
    # 2 of 40 by chance; with 7 or more the test would not hold its level (binomial, p 0.003).
    assert significant < 7


def test_constant_traces_and_clips_without_events() -> None:
    still = [ClipTraces("c", "cell", 10.0, (1.0,), ("a", "b"), np.full((2, 50), 5.0))]
    found = lag_of(still, 2.0)
    assert found is not None
    assert not found.mean.any()
    assert found.p == 1.0
    assert lag_of([ClipTraces("c", "cell", 10.0, (), ("a", "b"), np.zeros((2, 50)))], 2.0) is None
    one = [ClipTraces("c", "cell", 10.0, (1.0,), ("a",), np.zeros((1, 50)))]
    assert lag_of(one, 2.0) is None


def test_the_correlogram_is_the_correlation_of_shifted_series() -> None:
    rng = np.random.default_rng(1)
    values, train = rng.normal(size=(1, 60)), event_train((0.5, 2.0, 4.4), 60, 10.0)
    change = np.diff(values[0], prepend=values[0, 0])
    for lag in (0, 4, 11):
        expected = np.corrcoef(np.roll(change, -lag), train)[0, 1]
        assert correlogram(values, train)[0, lag] == pytest.approx(expected)


def test_a_mean_trace_weighs_people_alike() -> None:
    first = ClipTraces("a", "cell", 10.0, (), ("x", "y"), np.array([[1.0, 1.0], [3.0, 3.0]]))
    second = ClipTraces("b", "cell", 10.0, (), ("x",), np.array([[5.0, 5.0, 9.0]]))
    mean = mean_trace([first, second])
    np.testing.assert_allclose(mean.mean, [3.0, 3.0])
    assert (mean.level, mean.people) == (3.0, 2)
    assert mean.level_low < 3.0 < mean.level_high or mean.level_low == mean.level_high
