"""When and how the synthetic actor blinks, holds the head and looks: published statistics, one seed.

Sources: VanderWerf et al. 2003 (phases), Doughty 2001 (rate), Ousler et al. 2014 and the paper (complete and
partial blinks); the table stands in docs/tracking.md.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Values = NDArray[np.float64]

DOWN_MS = (92.0, 17.0)
UP_MS = (242.0, 55.0)
INTERVAL_MEDIAN_S = 3.4
INTERVAL_LOG_SD = 0.87
SHORTEST_INTERVAL_S = 0.55
FIRST_BLINK_S = (0.25, 0.6)
COMPLETE_SHARE = 0.5
PARTIAL_DEPTH = (0.30, 0.92)
FAST_SHARE = 0.72
SETTLED = 0.95
ONSET = 0.05


@dataclass(frozen=True)
class Blink:
    """One blink of the plan.

    Attributes
    ----------
    apex_s : float
        Time of greatest closure.
    down_s, up_s : float
        From 5% of the amplitude to the apex, and from the apex to 95% recovery.
    depth : float
        Closure at the apex, 1 for a complete blink.
    """

    apex_s: float
    down_s: float
    up_s: float
    depth: float


def plan_blinks(seconds: float, rng: np.random.Generator) -> list[Blink]:
    """Blinks of a recording: log-normal intervals, half of them complete."""
    blinks: list[Blink] = []
    apex = float(rng.uniform(*FIRST_BLINK_S))
    while apex < seconds - 0.05:
        down = float(np.clip(rng.normal(*DOWN_MS), 50, 150)) / 1000
        up = float(np.clip(rng.normal(*UP_MS), 120, 420)) / 1000
        complete = len(blinks) == 0 or rng.random() < COMPLETE_SHARE
        depth = 1.0 if complete else float(rng.uniform(*PARTIAL_DEPTH))
        blinks.append(Blink(apex, down, up, depth))
        pause = float(rng.lognormal(np.log(INTERVAL_MEDIAN_S), INTERVAL_LOG_SD))
        apex += max(pause, SHORTEST_INTERVAL_S + up)
    return blinks


def _septic(x: Values) -> Values:
    """Smooth step whose first three derivatives vanish at 0 and 1."""
    x = np.clip(x, 0, 1)
    return np.asarray(x**4 * (35 - 84 * x + 70 * x**2 - 20 * x**3))


SEPTIC_ONSET = float(np.interp(ONSET, _septic(np.linspace(0, 1, 4001)), np.linspace(0, 1, 4001)))


def _recovery(t: Values, up_s: float) -> Values:
    """Reopening, 0 to 1: a fast part and a slow tail, 95% reached after `up_s`."""
    slow_s = up_s / np.log((1 - FAST_SHARE) / (1 - SETTLED))
    rise = _septic(t / (0.84 * up_s))
    tail = (1 - np.exp(-np.maximum(t, 0) / slow_s)) * _septic(t / (0.6 * up_s))
    return np.asarray(FAST_SHARE * rise + (1 - FAST_SHARE) * tail)


def blink_closure(times_s: Values, blink: Blink) -> Values:
    """Closure this blink adds at each time, 0 to its depth."""
    length = blink.down_s / (1 - SEPTIC_ONSET)
    down = _septic((times_s - blink.apex_s) / length + 1)
    up = 1 - _recovery(times_s - blink.apex_s, blink.up_s)
    return np.asarray(blink.depth * np.where(times_s <= blink.apex_s, down, up))


@dataclass(frozen=True)
class Course:
    """The plan sampled in time; every array (samples,) unless said otherwise.

    Attributes
    ----------
    closure : float64 array (samples, 2)
        Per eye: 0 open, 1 closed.
    blink : int
        Blink number from 1, 0 between blinks.
    phase : str array
        'open', 'down' or 'up'.
    head : float64 array (samples, 4)
        Shift x and y in pixels, turn in radians, scale.
    gaze : float64 array (samples, 2)
        Shift of the iris in eye widths.
    light : float64 array
        Gain of the lighting.
    """

    times_s: Values
    closure: Values
    blink: NDArray[np.int64]
    phase: NDArray[np.str_]
    head: Values
    gaze: Values
    light: Values


def course(times_s: Values, blinks: list[Blink], seed: int) -> Course:
    """Sample plan, head, gaze and light at ascending times; the same seed gives the same course."""
    rng = np.random.default_rng([seed, 2])
    both = np.zeros((len(times_s), 2))
    for blink in blinks:
        start, stop = np.searchsorted(times_s, [blink.apex_s - 0.4, blink.apex_s + 2.5])
        part = times_s[start:stop]
        lag, share = rng.normal(0, 0.0012), rng.normal(0, 0.015)
        both[start:stop, 0] = np.maximum(both[start:stop, 0], blink_closure(part, blink))
        other = blink_closure(part + lag, blink) * (1.0 if blink.depth == 1 else 1 + share)
        both[start:stop, 1] = np.maximum(both[start:stop, 1], other)
    rest = 0.035 * _wander(times_s, rng, (4, 23))
    number, phase = _phases(times_s, blinks)
    return Course(
        times_s=times_s,
        closure=np.clip(both + rest[:, None] * (1 - both), -0.1, 1.0),
        blink=number,
        phase=phase,
        head=_head(times_s, rng),
        gaze=0.012 * np.stack([_wander(times_s, rng, (1.5, 9)) for _ in range(2)], axis=1),
        light=1 + 0.012 * _wander(times_s, rng, (5, 40)),
    )


def _phases(times_s: Values, blinks: list[Blink]) -> tuple[NDArray[np.int64], NDArray[np.str_]]:
    number = np.zeros(len(times_s), np.int64)
    phase = np.full(len(times_s), "open")
    for count, blink in enumerate(blinks, start=1):
        down = (times_s >= blink.apex_s - blink.down_s) & (times_s <= blink.apex_s)
        up = (times_s > blink.apex_s) & (times_s <= blink.apex_s + blink.up_s)
        number[down | up] = count
        phase[down], phase[up] = "down", "up"
    return number, phase


def _head(times_s: Values, rng: np.random.Generator) -> Values:
    shift_x, shift_y = (5.0 * _wander(times_s, rng, (2.5, 17)) for _ in range(2))
    turn = np.radians(1.0) * _wander(times_s, rng, (3, 19))
    return np.stack([shift_x, shift_y, turn, 1 + 0.012 * _wander(times_s, rng, (4, 21))], axis=1)


def _wander(times_s: Values, rng: np.random.Generator, periods_s: tuple[float, float]) -> Values:
    """A smooth, bounded, aperiodic signal of about unit amplitude."""
    total = np.zeros(len(times_s))
    for _ in range(5):
        period, phase = rng.uniform(*periods_s), rng.uniform(0, 2 * np.pi)
        total += np.sin(2 * np.pi * times_s / period + phase)
    return np.asarray(total / np.sqrt(5))
