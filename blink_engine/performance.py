"""The lids at a moment, one call per frame, and a whole performance at once."""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from blink_engine.parameters import Event, Parameters, StateName, default_parameters
from blink_engine.plan import Array, Blink, BlinkPlan, lid_course

# One call a frame: the lids at a moment, for games, avatars and robots.

# A look up widens an eye a little; however far down it goes, the lid leaves it open.
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
        The lower lid's way toward the nose, 0 to 1 of its full travel.
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
        """Report an event, in order of time; an event in the past counts as happening at the last frame."""
        time_s = self._reach(event.time_s)
        self._plan.notify(Event(event.kind, time_s, event.amplitude_deg))

    def hold_blinks(self, held: bool, time_s: float | None = None) -> None:
        """Hold blinks back while a flag of yours is up (True), and blink again once it is down (False).

        A blink that has begun finishes. One that was due meanwhile begins when the flag goes down.
        """
        reached = self._reach(time_s)
        if held:
            self._plan.hold()
        else:
            self._plan.release(reached)

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
        # Blinks that a slow frame skipped whole are dropped unseen, as at that rate no frame shows them.
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


# A whole performance at once: the same lids as frame by frame, for rendering and export.


@dataclass(frozen=True)
class StateChange:
    """From `time_s` on the person is in `state`."""

    state: StateName
    time_s: float


@dataclass(frozen=True)
class Hold:
    """From `start_s` to `end_s` the eyes stay open."""

    start_s: float
    end_s: float


@dataclass(frozen=True, eq=False)
class Performance:
    """Lid curves of both eyes at `fps`: each array has one value per frame, as in `LidFrame`."""

    fps: float
    left: Array
    right: Array
    left_lower_up: Array
    right_lower_up: Array
    left_lower_in: Array
    right_lower_in: Array
    blinks: tuple[Blink, ...]


def perform(
    duration_s: float,
    fps: float,
    *,
    seed: int = 0,
    state: StateName = "rest",
    events: Iterable[Event] = (),
    changes: Iterable[StateChange] = (),
    holds: Iterable[Hold] = (),
    parameters: Parameters | None = None,
    ends_open: bool = False,
) -> Performance:
    """Return a performance of `duration_s` seconds.

    Events and state changes may come in any order. What happens at one moment is taken states first.

    Parameters
    ----------
    duration_s, fps : float
        Length in s, and frames a second (0 < fps <= 10,000).
    seed, state, parameters : int, str, Parameters, optional
        As for `BlinkEngine`.
    events : iterable of Event
    changes : iterable of StateChange
    holds : iterable of Hold
        When the eyes stay open. A blink that would reach into a hold is left out, unlike in a stream, which
        does not know the future. A blink that is due within a hold begins at its end.
    ends_open : bool, optional
        Leave out a blink that would not be over at the end, as for a clip; without it the last frames may
        show half a blink, as the same moments of a stream do.

    Returns
    -------
    Performance
        round(duration_s * fps) frames, at least one.

    Raises
    ------
    ValueError
        Where duration or rate make no sense.

    Examples
    --------
    >>> curve = perform(60.0, 30.0, seed=1)
    >>> curve.left.shape
    (1800,)
    """
    if not 0.0 < fps <= 10_000.0:
        raise ValueError(f"expected a frame rate above 0 and up to 10000, got {fps}")
    if not 0.0 < duration_s < 1e7:
        raise ValueError(f"expected a duration above 0 s and below 10,000,000 s, got {duration_s}")
    chosen = parameters or default_parameters()
    open_spans = join_holds(holds)
    blinks = plan_blinks(duration_s, BlinkPlan(chosen, state, seed), events, changes, open_spans)
    # The hold that follows each onset; one at infinity follows the last.
    starts = np.array([*(one.start_s for one in open_spans), math.inf])
    following = starts[np.searchsorted(starts, [blink.onset_s for blink in blinks])]
    blinks = [blink for blink, start_s in zip(blinks, following, strict=True) if blink.end_s <= start_s]
    # The last frame of n is at duration - 1 / fps.
    if ends_open:
        blinks = [blink for blink in blinks if blink.end_s <= duration_s - 1.0 / fps]
    count = max(1, round(duration_s * fps))
    left, right = (_lay(blinks, count, fps, right=eye) for eye in (False, True))
    resting, profile = resting_closure(chosen, 0.0, 0.0), chosen.profile
    return Performance(
        fps,
        resting + (1.0 - resting) * left,
        resting + (1.0 - resting) * right,
        profile.lower_up * left,
        profile.lower_up * right,
        profile.lower_in * left,
        profile.lower_in * right,
        tuple(blinks),
    )


def plan_blinks(
    duration_s: float,
    plan: BlinkPlan,
    events: Iterable[Event],
    changes: Iterable[StateChange],
    holds: Sequence[Hold] = (),
) -> list[Blink]:
    """Return every blink that begins within the duration, with events, state changes and holds in order."""
    happenings: list[tuple[float, Callable[[], None]]] = [
        # States first: an event at that moment is answered as in the state that it finds.
        *((one.time_s, partial(plan.set_state, one.state, one.time_s)) for one in changes),
        *((one.start_s, plan.hold) for one in holds),
        *((one.end_s, partial(plan.release, one.end_s)) for one in holds),
        *((one.time_s, partial(plan.notify, one)) for one in events),
    ]
    # The sort keeps this order where times are equal.
    happenings.sort(key=lambda one: one[0])
    blinks: list[Blink] = []
    for time_s, happen in happenings:
        if time_s > duration_s:
            break
        blinks += plan.due(time_s)
        happen()
    return [*blinks, *plan.due(duration_s)]


def join_holds(holds: Iterable[Hold]) -> list[Hold]:
    """Holds in order; those that touch or overlap are one."""
    joined: list[Hold] = []
    for one in sorted(holds, key=lambda hold: hold.start_s):
        if not one.start_s < one.end_s:
            raise ValueError(f"expected a hold that ends after its start, got {one}")
        if joined and one.start_s <= joined[-1].end_s:
            joined[-1] = Hold(joined[-1].start_s, max(joined[-1].end_s, one.end_s))
        else:
            joined.append(one)
    return joined


def _lay(blinks: Sequence[Blink], count: int, fps: float, *, right: bool) -> Array:
    """Lay the blinks of one eye (count,) over one another: the greater closure is kept.

    All blinks' frames are computed in one pass: blink b has the frames first[b] to last[b], one after the
    other in `frame`, and `owner` says whose each is.
    """
    closure = np.zeros(count)
    if not blinks:
        return closure
    onset, peak = np.array(
        [(b.right_onset_s, b.right_peak) if right else (b.left_onset_s, b.left_peak) for b in blinks]
    ).T
    shape = np.array([(b.shape.closing_s, b.shape.closed_s, b.shape.opening_s) for b in blinks])
    # A frame shows the moment at which it begins.
    first = np.clip(np.ceil(onset * fps), 0, count).astype(np.int64)
    last = np.clip(np.floor((onset + shape.sum(axis=1)) * fps) + 1, first, count).astype(np.int64)
    lengths = last - first
    owner = np.repeat(np.arange(len(blinks)), lengths)
    starts = np.concatenate([[0], np.cumsum(lengths)[:-1]])
    frame = np.arange(owner.size) - np.repeat(starts - first, lengths)
    closing, closed, opening = shape[owner].T
    powers = blinks[0].shape
    course = lid_course(
        frame / fps - onset[owner], closing, closed, opening, powers.closing_power, powers.opening_power
    )
    # `at`, since frames repeat where blinks overlap: a plain assignment would keep the last blink, not the
    # greatest.
    np.maximum.at(closure, frame, peak[owner] * course)
    return closure
