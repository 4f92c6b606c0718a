"""The classifier itself: a small network over the features of a dip; its weights ship beside it."""

import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from stimuli_builder.blinks.profile import Array

WEIGHTS = Path(__file__).with_name("weights.json")


@dataclass(frozen=True, eq=False)
class Network:
    """A multilayer perceptron: standardised features, layers of tanh, softmax over `kinds`.

    Attributes
    ----------
    mean, spread : float64 array (features,)
        Of the training data.
    layers : tuple of (float64 array, float64 array)
        Weights (in, out) and offsets (out,) in order.
    """

    kinds: tuple[str, ...]
    mean: Array
    spread: Array
    layers: tuple[tuple[Array, Array], ...]

    def probabilities(self, features: Array) -> Array:
        """Probability (rows, kinds) of each kind for features (rows, features)."""
        values = np.clip((features - self.mean) / self.spread, -6, 6)
        for number, (weights, offsets) in enumerate(self.layers):
            values = values @ weights + offsets
            if number < len(self.layers) - 1:
                values = np.tanh(values)
        values = np.exp(values - values.max(axis=1, keepdims=True))
        return np.asarray(values / values.sum(axis=1, keepdims=True))


@cache
def shipped_network() -> Network:
    """The network that ships, made by `train.py` beside it."""
    document = json.loads(WEIGHTS.read_text(encoding="utf-8"))
    layers = tuple((np.array(w), np.array(b)) for w, b in document["layers"])
    return Network(tuple(document["kinds"]), np.array(document["mean"]), np.array(document["spread"]), layers)
