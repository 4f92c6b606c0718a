"""Generated lid series with known events: what the classifier of lid events is trained on.

Published durations and depths, drawn wider than they are; nothing here is measured from a test recording.
Blinks: VanderWerf et al. 2003, Ousler et al. 2014 (partial blinks), Doughty 2001 (rate). Squints, gaze shifts
and closed eyes have no such tables: their ranges are stated below and are assumptions.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from stimuli_builder.blinks.profile import Array

Kind = Literal["blink", "squint", "gaze_shift", "closed_eye"]
KINDS: tuple[Kind, ...] = ("blink", "squint", "gaze_shift", "closed_eye")
CLASSES = (*KINDS, "nothing")
"""What a dip of a series may be."""
RATES = (15.0, 20.0, 24.0, 25.0, 29.97, 30.0, 30.0, 30.0, 50.0, 60.0, 90.0, 120.0, 240.0, 300.0, 500.0)
CLOSED_EYE_S = 0.5
"""A closed phase of half a second or more is a closed eye, not a blink."""


@dataclass(frozen=True)
class Motion:
    """One known event: when it begins to close, phases in seconds, and depth as part of the full closure."""

    kind: Kind
    onset_s: float
    down_s: float
    hold_s: float
    up_s: float
    depth: float

    @property
    def end_s(self) -> float:
        """When the lid is back."""
        return self.onset_s + self.down_s + self.hold_s + self.up_s


@dataclass(frozen=True, eq=False)
class GeneratedSeries:
    """A series of one or two eyes, (eyes, n) distances, and what happened in it."""

    distances: Array
    fps: float
    motions: tuple[Motion, ...]


def draw(kind: Kind, onset: float, rng: np.random.Generator) -> Motion:
    """One event of a kind, its phases and depth from the ranges of this module."""
    if kind == "blink":
        full = rng.random() < 0.55
        depth = 1.0 if full else rng.uniform(0.35, 0.95)
        hold = rng.exponential(0.03) if rng.random() < 0.85 else rng.uniform(0.08, 0.4)
        down, up = rng.lognormal(np.log(0.095), 0.3), rng.lognormal(np.log(0.24), 0.35)
        return Motion(
            kind, onset, float(np.clip(down, 0.04, 0.25)), min(hold, 0.45), float(min(up, 0.7)), depth
        )
    if kind == "squint":
        return Motion(
            kind,
            onset,
            rng.uniform(0.12, 0.8),
            rng.exponential(0.8),
            rng.uniform(0.15, 1.0),
            rng.uniform(0.15, 0.7),
        )
    if kind == "gaze_shift":
        down, up = rng.uniform(0.03, 0.16), rng.uniform(0.03, 0.2)
        return Motion(kind, onset, down, rng.uniform(0.18, 4.0), up, rng.uniform(0.12, 0.7))
    return Motion(
        kind,
        onset,
        rng.uniform(0.08, 0.35),
        rng.uniform(CLOSED_EYE_S, 5.0),
        rng.uniform(0.15, 0.6),
        rng.uniform(0.85, 1),
    )


def smooth_step(share: Array, sharpness: float) -> Array:
    """Smooth step from 0 to 1 over share 0 to 1; greater sharpness moves it toward the end."""
    x = np.clip(share, 0, 1) ** sharpness
    return np.asarray(x * x * (3 - 2 * x))


def course(motion: Motion, times: Array, rng: np.random.Generator) -> Array:
    r"""Closure of one event at `times`; opening is fast, then slow.

    Notes
    -----
    .. math::

        s(x) &= y^2 (3 - 2 y), \quad y = x^a \tag{1} \\
        c(t) &= d \, s\{(t - t_0) / T_d\}, \text{ then } d \, [1 - s\{(t - t_0 - T_d - T_h) / T_u\}] \tag{2}

    t_0 is the onset; T_d, T_h and T_u last closing, hold and opening; d is the depth and a the sharpness
    (`smooth_step`). Squints and closed eyes tremble, gaze shifts drift.
    """
    down = smooth_step((times - motion.onset_s) / motion.down_s, rng.uniform(0.9, 1.3))
    back = (times - motion.onset_s - motion.down_s - motion.hold_s) / motion.up_s
    up = smooth_step(back, rng.uniform(0.55, 0.95))
    shape = np.where(back <= 0, down, 1 - up)
    if motion.kind in ("squint", "closed_eye"):
        wobble = np.sin(2 * np.pi * rng.uniform(0.5, 3) * times + rng.uniform(0, 6.3)) * rng.uniform(0, 0.12)
        shape = shape * (1 + wobble)
    if motion.kind == "gaze_shift":
        shape = shape * (1 + rng.uniform(-0.25, 0.25) * np.clip((times - motion.onset_s) / 2, 0, 1))
    return motion.depth * np.clip(shape, 0, 1.1)


def plan(seconds: float, rng: np.random.Generator) -> list[Motion]:
    """Events of a recording: blinks mostly, sometimes two in a row or on top of a gaze shift."""
    shares = rng.dirichlet([4.0, 1.0, 1.5, 0.5])
    motions: list[Motion] = []
    time = rng.uniform(0.3, 2.0)
    pause = rng.uniform(0.8, 4.0)
    while time < seconds - 1:
        motion = draw(KINDS[rng.choice(4, p=shares)], time, rng)
        motions.append(motion)
        if motion.kind == "gaze_shift" and motion.hold_s > 1 and rng.random() < 0.4:
            motions.append(draw("blink", time + rng.uniform(0.2, motion.hold_s - 0.6), rng))
        gap = 0.03 if motion.kind == "blink" and rng.random() < 0.12 else 0.25 + rng.exponential(pause)
        time = motion.end_s + gap
    return motions


def generate(rng: np.random.Generator, seconds: float = 40.0, fps: float | None = None) -> GeneratedSeries:
    """One recording: events, closed level, drift, wobble of a talking face, noise, glitches, 1 or 2 eyes."""
    rate = float(fps or rng.choice(RATES))
    finer = max(1, int(np.ceil(120 / rate)))
    times = np.arange(round(seconds * rate) * finer) / (rate * finer)
    motions = plan(seconds, rng)
    seed = int(rng.integers(2**32))
    closure = _closure(motions, times, seed)
    closure = closure.reshape(-1, finer)[:, : max(1, round(finer * rng.uniform(0.2, 1)))].mean(1)
    eyes = 2 if rng.random() < 0.6 else 1
    floor, bend = rng.uniform(0, 0.6), rng.uniform(0.7, 1.6)
    shared = _drift(closure.size, rate, rng)
    distances = [_measured(closure, floor, bend, shared, rate, rng) for _ in range(eyes)]
    return GeneratedSeries(np.array(distances), rate, tuple(motions))


def _closure(motions: list[Motion], times: Array, seed: int) -> Array:
    rng = np.random.default_rng(seed)
    open_share = np.ones(times.size)
    for motion in motions:
        first, last = np.searchsorted(times, [motion.onset_s, motion.end_s])
        open_share[first:last] *= 1 - np.minimum(course(motion, times[first:last], rng), 1.0)
    return 1 - open_share


def _drift(count: int, rate: float, rng: np.random.Generator) -> Array:
    """Factor of a head that moves and a face that talks: slow drift and wobbles of 0.3 to 3 s."""
    times = np.arange(count) / rate
    drift = 1 + rng.uniform(0, 0.12) * np.sin(2 * np.pi * times / rng.uniform(8, 60) + rng.uniform(0, 6.3))
    strength = rng.uniform(0, 0.12) * (rng.random() < 0.7)
    for _ in range(12):
        length = rng.lognormal(np.log(1.0), 0.7)
        drift = drift + strength / 3 * np.sin(2 * np.pi * times / length + rng.uniform(0, 6.3))
    return np.asarray(drift)


def _measured(
    closure: Array, floor: float, bend: float, shared: Array, rate: float, rng: np.random.Generator
) -> Array:
    """What a tracker makes of it: closed level, bent scale, correlated and white noise, single glitches."""
    shut = np.clip(closure * rng.uniform(0.85, 1.0), 0, 1) ** bend
    distance = shared * (1 - shut * (1 - floor))
    white = rng.lognormal(np.log(0.02), 0.9)
    distance = distance + rng.normal(0, min(white, 0.12), closure.size)
    slow = rng.normal(0, 1, closure.size)
    width = max(1, round(rng.uniform(0.03, 0.3) * rate))
    slow = np.convolve(slow, np.ones(width) / np.sqrt(width), mode="same")
    distance = distance + min(rng.lognormal(np.log(0.02), 0.8), 0.09) * slow
    for _ in range(rng.poisson(3) if rng.random() < 0.3 else 0):
        start = int(rng.integers(closure.size))
        length = 1 + int(rng.exponential(0.05) * rate)
        distance[start : start + length] += rng.normal(0, 0.3)
    return np.maximum(distance, 0.0) * rng.uniform(0.2, 60)
