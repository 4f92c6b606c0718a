"""The classifier itself: small networks over the features of a dip; their weights ship beside them."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.files import whole_file
from stimuli_builder.blinks.profile import Array

FIRST_LOOK, SECOND_LOOK = (Path(__file__).with_name(f"{look}_look.npz") for look in ("first", "second"))
TICKS = 10_000
"""Weights are stored as whole numbers of ten-thousandths: two bytes each, and the same floats everywhere."""


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
def shipped_network(path: Path) -> Network:
    """One of the networks that ship, `FIRST_LOOK` or `SECOND_LOOK`, made by `train.py` beside them."""
    return stored_network(path)


def stored_network(path: Path) -> Network:
    """Read a network that `store` wrote."""
    with np.load(path, allow_pickle=False) as stored:
        count = sum(name.startswith("weights") for name in stored)
        layers = tuple((stored[f"weights{n}"] / TICKS, stored[f"offsets{n}"] / TICKS) for n in range(count))
        return Network(tuple(stored["kinds"].tolist()), stored["mean"], stored["spread"], layers)


def store(network: Network, path: Path, **about: str | int | Sequence[str]) -> None:
    """Write a network, its weights rounded to ten-thousandths, and what is told `about` it, as npz."""
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
