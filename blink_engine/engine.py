"""One call a frame: the lids at a moment, for games, avatars and robots."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from blink_engine.events import Event
from blink_engine.parameters import Parameters, StateName, default_parameters
from blink_engine.plan import Blink, BlinkPlan

GAZE_CLOSURE_MIN, GAZE_CLOSURE_MAX = -0.15, 0.6


@dataclass(frozen=True)
class LidFrame:
    """Both eyes' lids at one moment.

    Attributes
    ----------
    left, right : float
        Closure by the upper lid, 0 open to 1 closed (below 0 where a look upwards widens the eye).
    left_lower_up, right_lower_up : float
        The lower lid's way upwards, 0 to 1 of its full travel.
    left_lower_in, right_lower_in : float
        The lower lid's way towards the nose, 0 to 1 of its full travel.
    """

    left: float
    right: float
    left_lower_up: float
    right_lower_up: float
    left_lower_in: float
    right_lower_in: float


class BlinkEngine:
    """A living pair of eyelids.

    Parameters
    ----------
    seed : int
        The same seed, states and events give the same blinks at every frame rate and in every language.
    state : {"rest", "reading", "screen", "speaking", "listening"}
    parameters : Parameters, optional
        The shipped defaults without it.

    Examples
    --------
    >>> engine = BlinkEngine(seed=4)
    >>> frames = [engine.frame(k / 60) for k in range(600)]
    >>> max(frame.left for frame in frames) > 0.5
    True
    """

    def __init__(
        self, seed: int = 0, state: StateName = "rest", parameters: Parameters | None = None
    ) -> None:
        self.parameters = parameters or default_parameters()
        self._plan = BlinkPlan(self.parameters, state, seed)
        self._active: list[Blink] = []
        self._time_s = 0.0

    def set_state(self, state: StateName, time_s: float | None = None) -> None:
        """Enter a state, at the moment of the last frame where no later one is named."""
        self._plan.set_state(state, self._reach(time_s))

    def notify(self, event: Event) -> None:
        """Tell of an event, in the order of time; one in the past counts as happening at the last frame."""
        time_s = self._reach(event.time_s)
        self._plan.notify(Event(event.kind, time_s, event.amplitude_deg))

    def _reach(self, time_s: float | None) -> float:
        """Plan up to a happening: what began before it is not its to move."""
        reached = self._time_s if time_s is None else max(time_s, self._time_s)
        self._active += self._plan.due(reached)
        return reached

    def frame(self, time_s: float, gaze_down_deg: float = 0.0, squint: float = 0.0) -> LidFrame:
        """Return the lids at `time_s`, which must not run backwards.

        Parameters
        ----------
        time_s : float
            Seconds since the start.
        gaze_down_deg : float
            Gaze below the horizon in degrees; the upper lid follows it.
        squint : float
            0 to 1.

        Raises
        ------
        ValueError
            Where time runs backwards or is not a number.
        """
        if not time_s >= self._time_s or math.isinf(time_s):
            raise ValueError(f"expected a time of at least {self._time_s} s, got {time_s}")
        self._time_s = time_s
        self._active = [blink for blink in self._active if blink.end_s > time_s]
        self._active += [blink for blink in self._plan.due(time_s) if blink.end_s > time_s]
        return self._lids(resting_closure(self.parameters, gaze_down_deg, squint), min(1.0, max(0.0, squint)))

    def _lids(self, resting: float, squint: float) -> LidFrame:
        left = _closure(self._active, self._time_s, right=False)
        right = _closure(self._active, self._time_s, right=True)
        profile = self.parameters.profile
        return LidFrame(
            max(resting, resting + (1.0 - resting) * left),
            max(resting, resting + (1.0 - resting) * right),
            max(squint, profile.lower_up * left),
            max(squint, profile.lower_up * right),
            profile.lower_in * left,
            profile.lower_in * right,
        )


def resting_closure(parameters: Parameters, gaze_down_deg: float, squint: float) -> float:
    """Return how much of the opening the upper lid covers between blinks."""
    by_gaze = parameters.gaze_closure_per_deg * gaze_down_deg
    covered = min(GAZE_CLOSURE_MAX, max(GAZE_CLOSURE_MIN, by_gaze))
    return covered + (1.0 - covered) * parameters.squint_closure * min(1.0, max(0.0, squint))


def _closure(blinks: Sequence[Blink], time_s: float, *, right: bool) -> float:
    closure = 0.0
    for blink in blinks:
        onset, peak = (
            (blink.right_onset_s, blink.right_peak) if right else (blink.left_onset_s, blink.left_peak)
        )
        closure = max(closure, peak * blink.shape.at(time_s - onset))
    return closure
