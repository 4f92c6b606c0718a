"""From what each picture shows to each frame's onset, and what was missing or late.

Equations: t_k is the onset of frame k, r the clip's frame rate.

(1)  t_k = (a_k + b_k) / 2, where a_k is the last picture that showed frame k - 1 (or an earlier one) and b_k
     the first that showed k; it is known to within u_k = (b_k - a_k) / 2.
(2)  late_k = (t_k - k / r) - median over k of (t_k - k / r).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from experiments.errors import InputError
from stimuli_builder.sync_patch.code import NO_FRAME, NUMBERS, UNREADABLE

RATES = (24.0, 25.0, 30.0, 50.0, 60.0)
BACK_MAX = NUMBERS // 2


@dataclass(frozen=True)
class Onset:
    """A frame's onset and how exactly it is known, in ms."""

    frame: int
    at_ms: float
    within_ms: float


@dataclass(frozen=True)
class PlayOnScreen:
    """One showing of a clip.

    Times are in ms; `late_ms` is by frame, equation (2).

    Attributes
    ----------
    missing : list of int
        Frames never seen, of those up to `frames` - 1.
    """

    onsets: tuple[Onset, ...]
    ended_ms: float
    frames: int
    fps: float

    @property
    def missing(self) -> list[int]:
        """Frames that never were on the screen."""
        seen = {onset.frame for onset in self.onsets}
        return [frame for frame in range(self.frames) if frame not in seen]

    @property
    def intervals_ms(self) -> list[float]:
        """From each onset to the next; the last one to the end."""
        times = [*(onset.at_ms for onset in self.onsets), self.ended_ms]
        return [float(step) for step in np.diff(times)]

    @property
    def late_ms(self) -> list[float]:
        """How much later than the others each frame came, against the clip's own times."""
        delays = np.array([onset.at_ms - 1000 * onset.frame / self.fps for onset in self.onsets])
        return [float(late) for late in delays - np.median(delays)]


def plays(
    times_ms: NDArray[np.float64],
    numbers: NDArray[np.int64],
    fps: float | None = None,
    frames: int | None = None,
) -> list[PlayOnScreen]:
    """Cut the readings into plays.

    Parameters
    ----------
    times_ms : float array (pictures,)
        When each picture was taken.
    numbers : int array (pictures,)
        What it shows, as `code.read` gives it.
    fps : float, optional
        The clip's frame rate; by default the usual one nearest to what is seen.
    frames : int, optional
        How many frames the clip has; by default up to the highest number seen in any play.

    Raises
    ------
    InputError
        No play is in it, or only part of one.
    """
    cut = [_onsets(times_ms[part], numbers[part]) for part in _parts(numbers)]
    if not cut:
        raise InputError(
            "expected at least one whole play, white before and after it, found none: "
            "film from before the start key until after the clip"
        )
    rate = fps or _rate([onsets for onsets, _ in cut])
    count = frames or 1 + max(onset.frame for onsets, _ in cut for onset in onsets)
    return [PlayOnScreen(tuple(onsets), ended_ms, count, rate) for onsets, ended_ms in cut]


def _parts(numbers: NDArray[np.int64]) -> list[slice]:
    """From the last white picture before each play to the first one after it."""
    white = np.flatnonzero(numbers == NO_FRAME)
    return [
        slice(int(start), int(end) + 1)
        for start, end in pairwise(white)
        if (numbers[start + 1 : end] >= 0).any()
    ]


def _onsets(times_ms: NDArray[np.float64], numbers: NDArray[np.int64]) -> tuple[list[Onset], float]:
    """Each frame's onset by equation (1), and when the clip was over."""
    onsets: list[Onset] = []
    last_ms = float(times_ms[0])
    for at_ms, number in zip(times_ms[1:-1], numbers[1:-1], strict=True):
        if number == UNREADABLE:
            continue
        frame = _unwrapped(int(number), onsets)
        if not onsets or frame != onsets[-1].frame:
            onsets.append(Onset(frame, (last_ms + float(at_ms)) / 2, (float(at_ms) - last_ms) / 2))
        last_ms = float(at_ms)
    return onsets, (last_ms + float(times_ms[-1])) / 2


def _unwrapped(number: int, before: Sequence[Onset]) -> int:
    """The frame nearest after the one before; a step back is kept, it tells of a fault."""
    if not before:
        return number
    step = (number - before[-1].frame) % NUMBERS
    return before[-1].frame + (step if step < BACK_MAX else step - NUMBERS)


def _rate(cut: Sequence[Sequence[Onset]]) -> float:
    steps = [
        (after.at_ms - before.at_ms) / (after.frame - before.frame)
        for onsets in cut
        for before, after in pairwise(onsets)
        if after.frame > before.frame
    ]
    if not steps:
        raise InputError("expected a clip of two frames or more, saw one: give its rate with --fps")
    seen = 1000 / float(np.median(steps))
    return min(RATES, key=lambda rate: abs(np.log(rate / seen)))
