"""Train the classifier of lid events on generated series and write its weights.

    python -m stimuli_builder.blinks.events.train first [series, default 12000]
    python -m stimuli_builder.blinks.events.train second [series, default 20000]

The second look learns from what the first one, as it ships, says of other series. Needs scikit-learn, which
comes with pingouin. The same seed gives the same weights.
"""

import argparse
import sys
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from sklearn.exceptions import ConvergenceWarning
from sklearn.neural_network import MLPClassifier

from stimuli_builder.blinks.events.candidates import FEATURES, Candidate, Depth
from stimuli_builder.blinks.events.generated import CLASSES, GeneratedSeries, Motion, generate
from stimuli_builder.blinks.events.network import (
    CONTEXT,
    FIRST_LOOK,
    SECOND_LOOK,
    MeasuredPiece,
    Network,
    contexts,
    looked_at,
    measure_pieces,
    store,
)
from stimuli_builder.blinks.profile import Array
from stimuli_builder.blinks.series import BlinkSeries


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
        made_by=f"python -m stimuli_builder.blinks.events.train {look} {count}",
        seed=lesson.seed,
        dips=len(kinds),
        features=lesson.features,
    )
    return f"{weights}: {len(kinds)} dips, loss {network.loss_:.3f}"


def main() -> None:
    """Train and write."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("look", choices=sorted(LESSONS))
    parser.add_argument("series", nargs="?", type=int, help="generated series to learn from")
    asked = parser.parse_args()
    lesson = LESSONS[asked.look]
    sys.stdout.write(learn(asked.look, asked.series or lesson.series, lesson.weights) + "\n")


if __name__ == "__main__":
    main()
