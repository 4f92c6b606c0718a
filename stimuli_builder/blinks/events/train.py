"""Train the classifier of lid events on generated series and write its weights.

    python -m stimuli_builder.blinks.events.train [series, default 800]

Needs scikit-learn, which comes with pingouin. The same seed gives the same weights.
"""

import json
import sys

import numpy as np
from sklearn.neural_network import MLPClassifier

from experiments.files import whole_text
from stimuli_builder.blinks.events.candidates import (
    FEATURES,
    Candidate,
    deep_level,
    features_of,
    find_candidates,
)
from stimuli_builder.blinks.events.generated import KINDS, Generated, Motion, generate
from stimuli_builder.blinks.events.levels import Depth, depth_of
from stimuli_builder.blinks.events.network import WEIGHTS
from stimuli_builder.blinks.profile import Array

SEED = 20261121
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
        kinds += [true_kind(candidate, depth, series.motions) for candidate in candidates]
    return np.concatenate(rows), kinds


def true_kind(candidate: Candidate, depth: Depth, motions: tuple[Motion, ...]) -> str:
    """The event a dip belongs to: the one whose hold is nearest to its peak, blinks first; else nothing."""
    time = candidate.peak / depth.fps
    slack = 1 / depth.fps + 0.02
    near = [
        (abs(time - (m.onset_s + m.down_s + m.hold_s / 2)) - m.hold_s / 2, m.kind)
        for m in motions
        if m.onset_s - slack <= time <= m.end_s + slack
    ]
    blinks = [entry for entry in near if entry[1] == "blink" and entry[0] < 0.1 + slack]
    return min(blinks or near)[1] if near else "nothing"


def training_data(count: int, seed: int) -> tuple[Array, list[str]]:
    """Features and kinds of `count` generated series."""
    rows, kinds = [], []
    for number in range(count):
        features, names = labelled_features(generate(np.random.default_rng([seed, number])))
        rows.append(features)
        kinds += names
    return np.concatenate(rows), kinds


def main() -> None:
    """Train and write."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 800
    features, kinds = training_data(count, SEED)
    mean, spread = features.mean(0), features.std(0) + 1e-6
    network = MLPClassifier((20,), activation="tanh", alpha=1e-2, random_state=SEED, early_stopping=True)
    network.fit(np.clip((features - mean) / spread, -6, 6), np.array([CLASSES.index(k) for k in kinds]))
    layers = [
        [np.round(w, 5).tolist(), np.round(b, 5).tolist()]
        for w, b in zip(network.coefs_, network.intercepts_, strict=True)
    ]
    document = {
        "made_by": f"python -m stimuli_builder.blinks.events.train {count}",
        "seed": SEED,
        "dips": len(kinds),
        "kinds": list(CLASSES),
        "features": list(FEATURES),
        "mean": np.round(mean, 6).tolist(),
        "spread": np.round(spread, 6).tolist(),
        "layers": layers,
    }
    with whole_text(WEIGHTS) as stream:
        json.dump(document, stream)
        stream.write("\n")
    sys.stdout.write(f"{WEIGHTS}: {len(kinds)} dips, loss {network.loss_:.3f}\n")


if __name__ == "__main__":
    main()
