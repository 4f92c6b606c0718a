"""A whole performance at once: the same lids as frame by frame, for rendering and export."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from blink_engine.engine import resting_closure
from blink_engine.events import Event
from blink_engine.parameters import Parameters, StateName, default_parameters
from blink_engine.plan import Blink, BlinkPlan
from blink_engine.profile import Array, lid_course


@dataclass(frozen=True)
class StateChange:
    """From `time_s` on the person is in `state`."""

    state: StateName
    time_s: float


@dataclass(frozen=True, eq=False)
class Performance:
    """Lid curves of both eyes at `fps`: each array has a value a frame, as in `LidFrame`."""

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
    blinks = planned(duration_s, BlinkPlan(chosen, state, seed), events, changes)
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


def planned(
    duration_s: float, plan: BlinkPlan, events: Iterable[Event], changes: Iterable[StateChange]
) -> list[Blink]:
    """Return every blink that begins within the duration, with events and state changes in their order."""
    happenings: list[Event | StateChange] = [*changes, *events]
    happenings.sort(key=lambda one: (one.time_s, isinstance(one, Event)))
    blinks: list[Blink] = []
    for happening in happenings:
        if happening.time_s > duration_s:
            break
        blinks += plan.due(happening.time_s)
        if isinstance(happening, Event):
            plan.notify(happening)
        else:
            plan.set_state(happening.state, happening.time_s)
    return [*blinks, *plan.due(duration_s)]


def _lay(blinks: Sequence[Blink], count: int, fps: float, *, right: bool) -> Array:
    """Lay the blinks of one eye (count,) over one another: the greater closure stands.

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
    np.maximum.at(closure, frame, peak[owner] * course)
    return closure
