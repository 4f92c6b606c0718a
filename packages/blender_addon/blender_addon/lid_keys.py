"""From a performance to the frames and values that are keyed: nothing where the eye is at rest."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from blink_engine import Event, Hold, Performance, StateChange, StateName, default_parameters, perform

Density = Literal["EVERY_FRAME", "FEW"]
Array = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class LidKeys:
    """Keys of one eye: `frames` (n,) ascending, and closure `values` (n,), 0 open to 1 closed."""

    frames: Array
    values: Array


@dataclass(frozen=True)
class Passage:
    """A stretch of the timeline to be filled: frames `start` to `end`, both included, at `fps`."""

    start: int
    end: int
    fps: float
    seed: int
    state: StateName
    rate_per_minute: float | None = None
    holds: tuple[Hold, ...] = ()


def flag_holds(up: npt.NDArray[np.bool_], fps: float) -> tuple[Hold, ...]:
    """When a flag is up that has one value per frame: from its first frame to the first one after it."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], up, [False]]).astype(int)))
    return tuple(Hold(first / fps, after / fps) for first, after in edges.reshape(-1, 2).tolist())


def passage(asked: Passage, events: Sequence[Event] = (), changes: Sequence[StateChange] = ()) -> Performance:
    """The blinks of a stretch of the timeline; ValueError in one line where it makes no sense."""
    if asked.end <= asked.start:
        raise ValueError(f"expected an end after the start, got frames {asked.start} to {asked.end}")
    if not 1 <= asked.fps <= 1000:
        raise ValueError(f"expected 1 to 1000 frames per second, got {asked.fps:g}")
    parameters = default_parameters()
    if asked.rate_per_minute:
        parameters = parameters.with_rate(asked.state, asked.rate_per_minute)
    return perform(
        (asked.end - asked.start + 1) / asked.fps,
        asked.fps,
        seed=asked.seed,
        state=asked.state,
        events=events,
        changes=changes,
        holds=asked.holds,
        parameters=parameters,
        ends_open=True,
    )


def one_blink(fps: float, seed: int) -> Performance:
    """A single blink that begins at frame 1 of its time."""
    started = perform(2.0, fps, seed=seed, events=[Event("blink", 0.0)])
    first = min(started.blinks, key=lambda blink: blink.onset_s)
    frames = max(3, int(np.ceil((first.end_s + 1 / fps) * fps)) + 1)
    # A second, spontaneous blink within those two seconds is none of this one.
    return perform(frames / fps, fps, seed=seed, events=[Event("blink", 0.0)])


def lid_keys(closure: Array, start: int, density: Density = "EVERY_FRAME") -> LidKeys:
    """The keys of one eye's closure, one value per frame from frame `start` on.

    `EVERY_FRAME` keys each frame of a blink and the open frame on either side, to be joined by straight
    lines: the curve is then the engine's at every frame. `FEW` keys onset, first and last frame of the
    peak, and end, to be joined smoothly: easier to edit.
    """
    closing = closure > 1e-6
    beside = closing.copy()
    beside[1:] |= closing[:-1]
    beside[:-1] |= closing[1:]
    if density == "FEW":
        beside &= _corners(closure, closing)
    frames = np.flatnonzero(beside)
    return LidKeys(frames.astype(np.float64) + start, closure[frames])


def _corners(closure: Array, closing: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
    keep = ~closing
    edges = np.flatnonzero(np.diff(np.concatenate([[False], closing, [False]]).astype(int)))
    for first, after in zip(edges[::2], edges[1::2], strict=True):
        shut = np.flatnonzero(closure[first:after] >= closure[first:after].max() - 1e-6)
        keep[[first + shut[0], first + shut[-1]]] = True
    return keep


def blink_at(frames: Array, frame: float, gap: float = 2.5) -> tuple[float, float] | None:
    """First and last frame of the blink that keys at `frames` (n,) hold at `frame`; None between blinks."""
    if frames.size == 0:
        return None
    breaks = np.flatnonzero(np.diff(frames) > gap)
    starts = np.concatenate([[0], breaks + 1])
    ends = np.concatenate([breaks, [frames.size - 1]])
    for first, last in zip(frames[starts], frames[ends], strict=True):
        if first <= frame <= last:
            return float(first), float(last)
    return None
