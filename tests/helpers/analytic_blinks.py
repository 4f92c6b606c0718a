"""Lid series made of formulas, so that the phases and amplitude of every blink are known exactly."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Steps = Sequence[tuple[float, float]]
"""When a gaze shift begins, and by what it multiplies the opening."""
FIRST_S, EVERY_S, STEP_S = 2.0, 4.0, 0.1


def smooth_step(share: Array) -> Array:
    """From 0 to 1 over shares 0 to 1, by a raised cosine."""
    return np.asarray((1 - np.cos(np.pi * np.clip(share, 0, 1))) / 2)


def _share_at(level: float) -> float:
    return float(np.arccos(1 - 2 * level) / np.pi)


@dataclass(frozen=True)
class LidForm:
    """Closing, hold and opening in seconds; `sharp` and `slow` bend the time of closing and opening."""

    down_s: float
    hold_s: float
    up_s: float
    sharp: float = 1.0
    slow: float = 1.0

    @property
    def length_s(self) -> float:
        return self.down_s + self.hold_s + self.up_s

    def closure(self, since: Array) -> Array:
        down = smooth_step(np.clip(since / self.down_s, 0, 1) ** self.sharp)
        up = smooth_step(np.clip((since - self.down_s - self.hold_s) / self.up_s, 0, 1) ** self.slow)
        return np.asarray(down * (1 - up))

    def edges_s(self) -> tuple[float, float, float]:
        """5% of the closing, the middle of the hold, 95% of the opening, from the beginning."""
        onset = self.down_s * _share_at(0.05) ** (1 / self.sharp)
        end = self.down_s + self.hold_s + self.up_s * _share_at(0.95) ** (1 / self.slow)
        return onset, self.down_s + self.hold_s / 2, end


FORMS = {
    "usual": LidForm(0.09, 0.02, 0.22),
    "slow end": LidForm(0.12, 0.015, 0.28, 1.25, 0.7),
    "long": LidForm(0.14, 0.06, 0.32, 1.1, 0.8),
    "short": LidForm(0.08, 0.01, 0.16, 1.0, 0.9),
}
GAZES: dict[str, Callable[[int, float, float], Steps]] = {
    "none": lambda _number, _start, _end: [],
    "down before, up long after": lambda number, start, _end: (
        [(start - 0.2, 0.8), (start + 1.6, 1 / 0.8)] if number % 2 == 0 else []
    ),
    "down just before, up just after": lambda number, start, end: (
        [(start - 0.15, 0.7), (end + 0.1, 1 / 0.7)] if number % 2 == 0 else []
    ),
    "before": lambda number, start, _end: [(start - 0.3, 0.75 if number % 2 == 0 else 1 / 0.75)],
    "after": lambda number, _start, end: [(end + 0.1, 0.75 if number % 2 == 0 else 1 / 0.75)],
    "during": lambda number, start, _end: [(start + 0.02, 0.75 if number % 2 == 0 else 1 / 0.75)],
    "while opening": lambda number, start, _end: [(start + 0.12, 0.75 if number % 2 == 0 else 1 / 0.75)],
}


@dataclass(frozen=True)
class KnownBlink:
    """One blink: 5% of its closing, middle of its hold and 95% of its opening (s), and its amplitude."""

    onset_s: float
    minimum_s: float
    end_s: float
    amplitude: float


def analytic_recording(
    fps: float, seed: int, form: LidForm, depth: float, gaze: str, noise: float, opening: float = 10.0
) -> tuple[Array, list[KnownBlink]]:
    """Seven blinks every 4 s from 2 s on, their depth a part of the opening about then, and white noise."""
    rng = np.random.default_rng(seed)
    count = 7
    frames = round((FIRST_S + count * EVERY_S) * fps)
    times = np.arange(frames) / fps
    starts = FIRST_S + EVERY_S * np.arange(count) + rng.uniform(0, 1 / fps, count)
    steps = [
        step
        for number, start in enumerate(starts.tolist())
        for step in GAZES[gaze](number, start, start + form.length_s)
    ]

    def level(at: Array) -> Array:
        value = np.full(at.shape, opening)
        for begins, factor in steps:
            value = value * (1 + (factor - 1) * smooth_step((at - begins) / STEP_S))
        return value

    closure = depth * np.sum([form.closure(times - start) for start in starts], axis=0)
    distance = level(times) * (1 - closure) + rng.normal(0, noise * opening, frames)
    onset, minimum, end = form.edges_s()
    deepest = depth * level(starts + minimum)
    blinks = [
        KnownBlink(start + onset, start + minimum, start + end, float(fall))
        for start, fall in zip(starts.tolist(), deepest, strict=True)
    ]
    return np.maximum(distance, 0.0), blinks
