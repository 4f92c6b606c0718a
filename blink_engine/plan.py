"""When the next blink comes and what it looks like: everything about time that is left to chance."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

from blink_engine.events import Event
from blink_engine.parameters import Parameters, StateName
from blink_engine.profile import BlinkShape
from blink_engine.random_numbers import RandomNumbers

INTERVALS, SHAPES, RESPONSES, DRIFT = 1, 2, 3, 4
ANTICIPATED_MAX = 2
LONGEST_CLOSED_SPREADS = 2.0
"""How far the closed time of a blink that is not long may lie above its median, in spreads of its logarithm:
at most 0.25 s. The tail of the fitted law would keep eyes shut for half a second and more."""


@dataclass(frozen=True)
class Blink:
    """One planned blink: onsets in s and peak closures of both eyes, and their common course."""

    left_onset_s: float
    right_onset_s: float
    left_peak: float
    right_peak: float
    shape: BlinkShape
    cause: str

    @property
    def onset_s(self) -> float:
        """Onset of the eye that is first."""
        return min(self.left_onset_s, self.right_onset_s)

    @property
    def end_s(self) -> float:
        """When both eyes are open again."""
        return max(self.left_onset_s, self.right_onset_s) + self.shape.duration_s


class BlinkPlan:
    """Plans one spontaneous blink and at most one answer to an event ahead; its memory does not grow.

    An event's blink is one that would have come anyhow: the next spontaneous one is left out for it (two at
    most wait so), so that the rate stays the state's, as the published rates hold both kinds. Four streams
    of random numbers serve intervals, shapes, responses and the drifts, so that an event changes when blinks
    come, never what those that still come look like.
    """

    def __init__(self, parameters: Parameters, state: StateName = "rest", seed: int = 0) -> None:
        self._parameters = parameters
        self._state = state
        self._intervals = RandomNumbers(seed, INTERVALS)
        self._shapes = RandomNumbers(seed, SHAPES)
        self._responses = RandomNumbers(seed, RESPONSES)
        self._drifts = RandomNumbers(seed, DRIFT)
        self._last_onset_s = -math.inf
        # A run begins at a random moment of a life: within a long interval rather than a short one, and in a
        # stretch of few blinks rather than of many. Else its first seconds would hold too many blinks.
        self._drift = parameters.drift.under_way(self._drifts.normal())
        self._slow = parameters.slow_drift.under_way(self._drifts.normal())
        met = parameters.intervals[state].draw_under_way(self._intervals)
        self._spontaneous_s = self._drifted(met) * self._intervals.uniform()
        self._answer_s, self._answer_cause = math.inf, ""
        self._anticipated = 0

    def set_state(self, state: StateName, time_s: float) -> None:
        """Enter a state: what is left of the interval is stretched to the new state's mean."""
        mean_s = self._parameters.mean_interval_s
        ratio = mean_s(state) / mean_s(self._state)
        self._spontaneous_s = time_s + max(0.0, self._spontaneous_s - time_s) * ratio
        self._state = state

    def notify(self, event: Event) -> None:
        """Take an event, which a blink may answer; of two answers still to come the sooner stands."""
        if event.kind == "blink":
            self._answer(event.time_s, "blink")
            return
        response = self._parameters.responses[event.kind]
        chance, latency = self._responses.uniform(), self._responses.uniform()
        if chance < response.chance(event.amplitude_deg):
            delay = response.earliest_s + latency * (response.latest_s - response.earliest_s)
            self._answer(event.time_s + max(0.0, delay), event.kind)

    def due(self, until_s: float) -> Iterator[Blink]:
        """Yield the blinks that begin at or before `until_s`, in order; each is yielded once."""
        while min(self._spontaneous_s, self._answer_s) <= until_s:
            if self._answer_s <= self._spontaneous_s:
                onset, cause = self._answer_s, self._answer_cause
                self._answer_s = math.inf
                self._anticipated = min(ANTICIPATED_MAX, self._anticipated + 1)
                yield self._blink(onset, cause)
                continue
            onset = self._spontaneous_s
            self._spontaneous_s = onset + self._interval()
            if self._anticipated:
                self._anticipated -= 1
            elif onset >= self._last_onset_s + self._parameters.least_interval_s:
                yield self._blink(onset, "spontaneous")

    def _answer(self, onset_s: float, cause: str) -> None:
        onset = max(onset_s, self._last_onset_s + self._parameters.least_interval_s)
        if onset < self._answer_s:
            self._answer_s, self._answer_cause = onset, cause

    def _interval(self) -> float:
        return self._drifted(self._parameters.intervals[self._state].draw(self._intervals))

    def _drifted(self, drawn_s: float) -> float:
        """Apply the drifts to an interval, and take them to the next one."""
        parameters, numbers = self._parameters, self._drifts
        fixed = parameters.intervals[self._state].kind == "fixed"
        interval_s = drawn_s if fixed else drawn_s * math.exp(self._drift + self._slow)
        self._drift = parameters.drift.following(self._drift, numbers.normal())
        self._slow = parameters.slow_drift.following(self._slow, numbers.normal())
        return max(interval_s, parameters.least_interval_s)

    def _blink(self, onset: float, cause: str) -> Blink:
        """Draw the shape: nine uniform numbers, whatever comes of it."""
        model, numbers = self._parameters.profile, self._shapes
        kind, partial = numbers.uniform(), numbers.normal()
        closing, opening = model.closing_s.draw(numbers), model.opening_s.draw(numbers)
        closed_z = numbers.normal()
        asymmetry, delay = model.asymmetry * numbers.normal(), model.delay_s * numbers.normal()
        again = numbers.uniform() < model.double_share
        long, complete = kind < model.long_share, kind < model.long_share + model.complete_share
        law = model.long_closed_s if long else model.closed_s
        if not long and closed_z > LONGEST_CLOSED_SPREADS:
            closed_z = (
                2.0 * LONGEST_CLOSED_SPREADS - closed_z
            )  # reflected: no pile of equal blinks at the limit
        closed = law.median * math.exp(law.spread * closed_z) if complete else 0.0
        logit = model.partial_logit_median + model.partial_logit_spread * partial
        peak = 1.0 if complete else 1.0 / (1.0 + math.exp(-logit))
        shape = BlinkShape(closing, closed, opening, model.closing_power, model.opening_power)
        self._last_onset_s = onset
        if again and cause != "double":
            self._answer(onset + shape.duration_s, "double")
        return Blink(
            onset + max(0.0, -delay),
            onset + max(0.0, delay),
            peak if complete else _bounded(peak + asymmetry / 2.0),
            peak if complete else _bounded(peak - asymmetry / 2.0),
            shape,
            cause,
        )


def _bounded(value: float) -> float:
    return min(1.0, max(0.0, value))
