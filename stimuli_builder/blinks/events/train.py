"""Train the classifier of lid events on generated series and write its weights.

    python -m stimuli_builder.blinks.events.train [series, default 12000]

Needs scikit-learn, which comes with pingouin. The same seed gives the same weights.
"""

import sys
import warnings

import numpy as np
from numpy.typing import NDArray
from sklearn.exceptions import ConvergenceWarning
from sklearn.neural_network import MLPClassifier

from stimuli_builder.blinks.events.candidates import (
    FEATURES,
    Candidate,
    deep_level,
    features_of,
    find_candidates,
)
from stimuli_builder.blinks.events.generated import KINDS, Generated, Motion, generate
from stimuli_builder.blinks.events.levels import Depth, depth_of
from stimuli_builder.blinks.events.network import WEIGHTS, Network, store
from stimuli_builder.blinks.profile import Array

SEED = 20261121
SERIES = 12000
UNITS = (256, 128)
STAGES = ((2e-3, 6), (5e-4, 4), (1e-4, 3))
"""Rate of learning and passes over the dips of each stage; the last ones settle what the first one found."""
NEAR_HOLD_S = 0.1
CLASSES = (*KINDS, "nothing")


def labelled_features(series: Generated) -> tuple[Array, list[str]]:
    """Features of every dip of every eye, and what each is."""
    depths = [depth_of(distance, series.fps) for distance in series.distances]
    of_eyes = [find_candidates(depth) for depth in depths]
    rows, kinds = [], []
    for eye, (depth, candidates) in enumerate(zip(depths, of_eyes, strict=True)):
        other = None
        if len(depths) == 2:
            other = depths[1 - eye].smooth / deep_level(of_eyes[1 - eye], depths[1 - eye])
        rows.append(features_of(candidates, depth, other))
        kinds += true_kinds(candidates, depth, series.motions)
    return np.concatenate(rows), kinds


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


def training_data(count: int, seed: int) -> tuple[NDArray[np.float32], list[str]]:
    """Features and kinds of `count` generated series."""
    rows, kinds = [], []
    for number in range(count):
        features, names = labelled_features(generate(np.random.default_rng([seed, number])))
        rows.append(features.astype(np.float32))  # a million rows
        kinds += names
    return np.concatenate(rows), kinds


def trained(features: NDArray[np.float32], classes: NDArray[np.int64]) -> MLPClassifier:
    """Train the network on standardised features (n, features), stage by stage."""
    network = MLPClassifier(
        UNITS, activation="tanh", alpha=1e-4, batch_size=512, random_state=SEED, warm_start=True
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)  # a stage ends after its passes
        for rate, passes in STAGES:
            network.set_params(learning_rate_init=rate, max_iter=passes)
            network.fit(features, classes)
    return network


def main() -> None:
    """Train and write."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else SERIES
    features, kinds = training_data(count, SEED)
    mean = features.mean(0, dtype=np.float64)
    spread = features.std(0, dtype=np.float64) + 1e-6
    standard = np.clip((features - mean) / spread, -6, 6).astype(np.float32)
    network = trained(standard, np.array([CLASSES.index(k) for k in kinds]))
    layers = tuple(
        (weights.astype(np.float64), offsets.astype(np.float64))
        for weights, offsets in zip(network.coefs_, network.intercepts_, strict=True)
    )
    store(
        Network(CLASSES, np.round(mean, 6), np.round(spread, 6), layers),
        WEIGHTS,
        made_by=f"python -m stimuli_builder.blinks.events.train {count}",
        seed=SEED,
        dips=len(kinds),
        features=FEATURES,
    )
    sys.stdout.write(f"{WEIGHTS}: {len(kinds)} dips, loss {network.loss_:.3f}\n")


if __name__ == "__main__":
    main()
