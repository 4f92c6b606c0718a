"""When the next blink comes and what it looks like: everything about time that is left to chance."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from blink_engine.laws import RandomNumbers
from blink_engine.parameters import Event, Parameters, StateName

# The course of one blink: closing, closed and opening phase, smooth at every point.

Array = npt.NDArray[np.float64]
_Number = TypeVar("_Number", float, Array)


@dataclass(frozen=True)
class BlinkShape:
    r"""The lid's course between open and its peak, as a share of the way.

    With s(u) = 10 u^3 - 15 u^4 + 6 u^5 (the minimum-jerk course) on [0, 1] and t from the onset,

    .. math::

        c(t) = s\left((t / T_c)^p\right) \qquad 0 \le t \le T_c \tag{1}

        c(t) = 1 \qquad T_c \le t \le T_c + T_p \tag{2}

        c(t) = 1 - s\left(((t - T_c - T_p) / T_o)^q\right) \qquad \text{then, for } T_o \tag{3}

    T_c, T_p, T_o: closing, closed and opening time in s. p, q: when within its phase the lid is fastest;
    q < 1 is the quick start and the long tail of the opening. c and its first derivative are continuous for
    p, q > 1/3: there is no cusp at the peak. Fitted to the 21 recorded one-eye profiles that ship with
    Palpebra the residual is 0.02 of the way (median); `bench/blink_engine_fit.py` prints it.
    """

    closing_s: float
    closed_s: float
    opening_s: float
    closing_power: float
    opening_power: float

    @property
    def duration_s(self) -> float:
        """From onset to the end of the opening."""
        return self.closing_s + self.closed_s + self.opening_s

    def at(self, time_s: float) -> float:
        """Return c at one moment after the onset (0 outside the blink)."""
        if time_s <= 0.0 or time_s >= self.duration_s:
            return 0.0
        if time_s < self.closing_s:
            return _smooth(math.pow(time_s / self.closing_s, self.closing_power))
        since = time_s - self.closing_s - self.closed_s
        if since <= 0.0:
            return 1.0
        return 1.0 - _smooth(math.pow(min(1.0, since / self.opening_s), self.opening_power))

    def course(self, time_s: Array) -> Array:
        """Return c at many moments (n,)."""
        powers = self.closing_power, self.opening_power
        return lid_course(time_s, self.closing_s, self.closed_s, self.opening_s, *powers)


def lid_course(
    time_s: Array,
    closing_s: Array | float,
    closed_s: Array | float,
    opening_s: Array | float,
    closing_power: float,
    opening_power: float,
) -> Array:
    """Return c of equations 1 to 3 at moments after the onset (n,); durations may differ by moment (n,)."""
    closing = np.clip(time_s / closing_s, 0.0, 1.0) ** closing_power
    opening = np.clip((time_s - closing_s - closed_s) / opening_s, 0.0, 1.0) ** opening_power
    # At its end 1 - s(1) may lie a rounding error below 0.
    return np.maximum(_smooth(closing) * (1.0 - _smooth(opening)), 0.0)


def _smooth(u: _Number) -> _Number:
    return u * u * u * (10.0 + u * (6.0 * u - 15.0))


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
        # The rest of an interval met at random is uniform within it.
        self._spontaneous_s = self._drifted(met) * self._intervals.uniform()
        self._answer_s, self._answer_cause = math.inf, ""
        self._anticipated = 0
        self._held = False

    def set_state(self, state: StateName, time_s: float) -> None:
        """Enter a state: what is left of the interval is stretched to the new state's mean."""
        mean_s = self._parameters.mean_interval_s
        ratio = mean_s(state) / mean_s(self._state)
        self._spontaneous_s = time_s + max(0.0, self._spontaneous_s - time_s) * ratio
        self._state = state

    def notify(self, event: Event) -> None:
        """Take an event, which a blink may answer; of two pending answers the sooner is kept."""
        if event.kind == "blink":
            self._answer(event.time_s, "blink")
            return
        response = self._parameters.responses[event.kind]
        # Both are drawn whether or not the event is answered, so that the next event's numbers stay the
        # same.
        chance, latency = self._responses.uniform(), self._responses.uniform()
        if chance < response.chance(event.amplitude_deg):
            delay = response.earliest_s + latency * (response.latest_s - response.earliest_s)
            self._answer(event.time_s + max(0.0, delay), event.kind)

    def hold(self) -> None:
        """Let no blink begin until `release`."""
        self._held = True

    def release(self, time_s: float) -> None:
        """Let blinks begin again; what was due meanwhile comes at once, as one blink."""
        self._held = False
        # Where both are late, the answer replaces the spontaneous blink in `due`, as always.
        self._spontaneous_s = max(self._spontaneous_s, time_s)
        self._answer_s = max(self._answer_s, time_s)

    def due(self, until_s: float) -> Iterator[Blink]:
        """Yield the blinks that begin at or before `until_s`, in order; each is yielded once."""
        while not self._held and min(self._spontaneous_s, self._answer_s) <= until_s:
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
            # An answer may just have come: two onsets closer than this are one blink to an observer.
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
            # The eye that is first keeps the planned onset: a blink never begins before `due` was asked for
            # it.
            onset + max(0.0, -delay),
            onset + max(0.0, delay),
            peak if complete else _bounded(peak + asymmetry / 2.0),
            peak if complete else _bounded(peak - asymmetry / 2.0),
            shape,
            cause,
        )


def _bounded(value: float) -> float:
    return min(1.0, max(0.0, value))
