"""Train the classifier of lid events on generated series, measure the blink template, and write what ships.

    python -m bench.lid_event_training first [series, default 12000]
    python -m bench.lid_event_training second [series, default 20000]
    python -m bench.lid_event_training template

The second look learns from what the first one, as it ships, says of other series. Needs scikit-learn, which
comes with pingouin. The same seed gives the same weights. The template is measured from the profiles that
ship.
"""

import argparse
import json
import sys
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.exceptions import ConvergenceWarning
from sklearn.neural_network import MLPClassifier

from experiments.files import whole_file, whole_text
from stimuli_builder.blinks.events.candidates import (
    CLASSES,
    CLOSED_EYE_S,
    FEATURES,
    KINDS,
    Candidate,
    Depth,
    Kind,
)
from stimuli_builder.blinks.events.network import (
    CONTEXT,
    FIRST_LOOK,
    SECOND_LOOK,
    TICKS,
    MeasuredPiece,
    Network,
    contexts,
    looked_at,
    measure_pieces,
)
from stimuli_builder.blinks.events.template import FORMS
from stimuli_builder.blinks.library import load_library
from stimuli_builder.blinks.profile import Array, BlinkProfile
from stimuli_builder.blinks.series import BlinkSeries

# Generated lid series with known events: what the classifier is trained on.
#
# Published durations and depths, drawn wider than they are; nothing here is measured from a test recording.
# Blinks: VanderWerf et al. 2003, Ousler et al. 2014 (partial blinks), Doughty 2001 (rate). Squints, gaze
# shifts and closed eyes have no such tables: their ranges are stated below and are assumptions.

RATES = (15.0, 20.0, 24.0, 25.0, 29.97, 30.0, 30.0, 30.0, 50.0, 60.0, 90.0, 120.0, 240.0, 300.0, 500.0)


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


# Training: every dip of generated series with what it is, and a network that learns it.


def store(network: Network, path: Path, **about: str | int | Sequence[str]) -> None:
    """Write a network, its weights rounded to ten-thousandths, and the text `about` it, as npz."""
    arrays: dict[str, Any] = {name: np.array(value) for name, value in about.items()}
    arrays |= {"kinds": np.array(network.kinds), "mean": network.mean, "spread": network.spread}
    for number, (weights, offsets) in enumerate(network.layers):
        arrays |= {f"weights{number}": _ticks(weights), f"offsets{number}": _ticks(offsets)}
    with whole_file(path) as temporary:
        np.savez_compressed(temporary, **arrays)


def _ticks(values: Array) -> NDArray[np.int16] | NDArray[np.int32]:
    whole = np.rint(values * TICKS)
    if np.abs(whole).max() < 2**15:
        return whole.astype(np.int16)
    return whole.astype(np.int32)


@dataclass(frozen=True)
class Lesson:
    """What a look learns from: features, generated series, units of the network, and where its weights go."""

    features: tuple[str, ...]
    seed: int
    series: int
    units: tuple[int, ...]
    weights: Path


LESSONS = {
    "first": Lesson(FEATURES, 20261121, 12000, (256, 128), FIRST_LOOK),
    "second": Lesson(CONTEXT, 20261122, 20000, (256, 128), SECOND_LOOK),
}
SEED = 20261121
"""Of the networks' own draws."""
STAGES = ((2e-3, 6), (5e-4, 4), (1e-4, 3))
"""Rate of learning and passes over the dips of each stage; the last ones settle what the first one found."""
NEAR_HOLD_S = 0.1


def labelled_features(look: str, series: GeneratedSeries) -> tuple[Array, list[str]]:
    """A look's inputs for every dip of every eye, and what each dip is."""
    eyes = [BlinkSeries(distance=d, fps=series.fps, column="d", is_px=False) for d in series.distances]
    pieces: Sequence[Sequence[MeasuredPiece]]
    if look == "first":
        pieces = measure_pieces(eyes)
        told = [[piece.features for piece in of_eye] for of_eye in pieces]
    else:
        pieces = seen = looked_at(eyes)
        told = contexts(seen)
    kinds = [
        kind
        for of_eye in pieces
        for piece in of_eye
        for kind in true_kinds(piece.candidates, piece.depth, series.motions)
    ]
    return np.concatenate([row for of_eye in told for row in of_eye]), kinds


def true_kinds(candidates: list[Candidate], depth: Depth, motions: tuple[Motion, ...]) -> list[str]:
    """What each dip is: one dip of a blink is the blink, its ripples are nothing; the rest by `_event_at`.

    A blink is its deepest dip about its hold, or where noise left none there the dip nearest to it. Ripples
    on its way down or up taught as blinks would make every noisy re-opening a second blink.
    """
    slack = 1 / depth.fps + 0.02
    times = [candidate.peak / depth.fps for candidate in candidates]
    kinds = [_event_at(time, motions, slack) for time in times]
    for motion in motions:
        if motion.kind != "blink":
            continue
        inside = [k for k, time in enumerate(times) if _away(motion, time, slack) is not None]
        away = {k: _away(motion, times[k], slack) or 0.0 for k in inside}
        near = [k for k in inside if away[k] < NEAR_HOLD_S + slack]
        if near:
            kinds[max(near, key=lambda k: candidates[k].depth)] = "blink"
        elif inside:
            kinds[min(inside, key=away.__getitem__)] = "blink"
    return kinds


def _away(motion: Motion, time: float, slack: float) -> float | None:
    """Seconds from a time to an event's hold; None outside the event."""
    if not motion.onset_s - slack <= time <= motion.end_s + slack:
        return None
    return max(0.0, abs(time - (motion.onset_s + motion.down_s + motion.hold_s / 2)) - motion.hold_s / 2)


def _event_at(time: float, motions: tuple[Motion, ...], slack: float) -> str:
    """The event other than a blink whose hold is nearest to a time; 'nothing' outside of all."""
    distances = [(_away(m, time, slack), m.kind) for m in motions if m.kind != "blink"]
    near = [(away, kind) for away, kind in distances if away is not None]
    return min(near)[1] if near else "nothing"


def training_data(look: str, count: int) -> tuple[NDArray[np.float32], list[str]]:
    """Features and kinds of `count` generated series."""
    rows, kinds = [], []
    for number in range(count):
        series = generate(np.random.default_rng([LESSONS[look].seed, number]))
        features, names = labelled_features(look, series)
        rows.append(features.astype(np.float32))  # a million rows
        kinds += names
    return np.concatenate(rows), kinds


def train_network(features: NDArray[np.float32], classes: NDArray[np.int64], lesson: Lesson) -> MLPClassifier:
    """Train the network on standardized features (n, features), stage by stage."""
    network = MLPClassifier(
        lesson.units, activation="tanh", alpha=1e-4, batch_size=512, random_state=SEED, warm_start=True
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)  # a stage ends after its passes
        for rate, passes in STAGES:
            network.set_params(learning_rate_init=rate, max_iter=passes)
            network.fit(features, classes)
    return network


def learn(look: str, count: int, weights: Path) -> str:
    """Train a look, write its weights, and say how it went."""
    lesson = LESSONS[look]
    features, kinds = training_data(look, count)
    mean = features.mean(0, dtype=np.float64)
    spread = features.std(0, dtype=np.float64) + 1e-6
    features -= mean.astype(np.float32)
    features /= spread.astype(np.float32)
    np.clip(features, -6, 6, out=features)
    network = train_network(features, np.array([CLASSES.index(k) for k in kinds]), lesson)
    layers = tuple(
        (matrix.astype(np.float64), offsets.astype(np.float64))
        for matrix, offsets in zip(network.coefs_, network.intercepts_, strict=True)
    )
    store(
        Network(CLASSES, np.round(mean, 6), np.round(spread, 6), layers),
        weights,
        made_by=f"python -m bench.lid_event_training {look} {count}",
        seed=lesson.seed,
        dips=len(kinds),
        features=lesson.features,
    )
    return f"{weights}: {len(kinds)} dips, loss {network.loss_:.3f}"


# The blink template, measured from the profiles that ship.

NODES = 41
TOP = 0.97
"""Part of the greatest closure from which a profile counts as turning: above it is the closed phase."""
SHORTEST_HOLD_S = 0.004
SPREAD = (0.35, 1.2, 0.45)
"""Spread of the logarithms of the phases, wider than one person's (VanderWerf et al. 2003, over people)."""


def phases(profile: BlinkProfile) -> tuple[Array, Array, tuple[float, float, float]]:
    """Closing and opening of one profile over even shares of the phase, and the three phases in seconds."""
    closure = profile.closure / profile.closure.max()
    top = np.flatnonzero(closure >= TOP)
    first, last = int(top[0]), int(top[-1])
    shares = np.linspace(0, 1, NODES)
    before, after = closure[profile.onset_index : first + 1], closure[last : profile.end_index + 1]
    closing = np.interp(shares * (before.size - 1), np.arange(before.size), before)
    opening = np.interp(shares * (after.size - 1), np.arange(after.size), after)
    seconds = (
        before.size / profile.fps,
        max((last - first) / profile.fps, SHORTEST_HOLD_S),
        after.size / profile.fps,
    )
    return closing, 1 - opening, seconds


def make_rising(mean: Array) -> Array:
    """Make a mean form rise strictly from 0 to 1."""
    form = np.maximum.accumulate((mean - mean[0]) / (mean[-1] - mean[0])) + np.linspace(0, 1e-6, mean.size)
    return np.asarray(form / form[-1])


def measure_template() -> str:
    """Measure the blink template from the profiles that ship, and write it."""
    deep = [
        profile for profile in load_library() if profile.closure_other is None and profile.amplitude > 0.5
    ]
    closings, openings, seconds = zip(*(phases(profile) for profile in deep), strict=True)
    document = {
        "made_by": "python -m bench.lid_event_training template",
        "profiles": [profile.profile_id for profile in deep],
        "closing": np.round(make_rising(np.mean(closings, axis=0)), 6).tolist(),
        "opening": np.round(make_rising(np.mean(openings, axis=0)), 6).tolist(),
        "log_s": np.round(np.median(np.log(seconds), axis=0), 4).tolist(),
        "log_sd": list(SPREAD),
    }
    with whole_text(FORMS) as stream:
        json.dump(document, stream)
        stream.write("\n")
    return f"{FORMS}: {len(deep)} profiles"


def main() -> None:
    """Train or measure, and write."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("part", choices=[*LESSONS, "template"])
    parser.add_argument("series", nargs="?", type=int, help="generated series to learn from")
    asked = parser.parse_args()
    if asked.part == "template":
        said = measure_template()
    else:
        lesson = LESSONS[asked.part]
        said = learn(asked.part, asked.series or lesson.series, lesson.weights)
    sys.stdout.write(said + "\n")


if __name__ == "__main__":
    main()
