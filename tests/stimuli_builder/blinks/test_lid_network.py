"""The classifier's weights as they are stored."""

from pathlib import Path

import numpy as np
import pytest

from bench.lid_event_training import CLASSES, store
from stimuli_builder.blinks.events.candidates import FEATURES
from stimuli_builder.blinks.events.network import (
    CONTEXT,
    FIRST_LOOK,
    SECOND_LOOK,
    Network,
    stored_network,
)


def drawn(largest: float) -> Network:
    rng = np.random.default_rng(1)
    layers = tuple((largest * rng.uniform(-1, 1, (a, b)), rng.uniform(-1, 1, b)) for a, b in ((3, 7), (7, 2)))
    return Network(("blink", "nothing"), rng.normal(size=3), rng.uniform(1, 2, 3), layers)


@pytest.mark.parametrize("largest", [1.0, 50.0])
def test_a_network_is_read_as_it_was_stored(tmp_path: Path, largest: float) -> None:
    network, file = drawn(largest), tmp_path / "network.npz"
    store(network, file, made_by="a test", dips=4)
    read = stored_network(file)
    assert read.kinds == network.kinds
    assert np.array_equal(read.mean, network.mean)
    assert np.array_equal(read.spread, network.spread)
    for (weights, offsets), (kept, kept_offsets) in zip(network.layers, read.layers, strict=True):
        assert np.array_equal(np.round(weights, 4), kept)
        assert np.array_equal(np.round(offsets, 4), kept_offsets)
    assert np.load(file, allow_pickle=False)["made_by"] == "a test"


@pytest.mark.parametrize(
    ("weights", "features", "max_bytes"), [(FIRST_LOOK, FEATURES, 120_000), (SECOND_LOOK, CONTEXT, 160_000)]
)
def test_the_networks_that_ship_know_the_features_and_are_small(
    weights: Path, features: tuple[str, ...], max_bytes: int
) -> None:
    assert len(set(features)) == len(features)
    with np.load(weights, allow_pickle=False) as stored:
        assert tuple(stored["features"].tolist()) == features
        assert stored["weights0"].shape[0] == len(features)
    assert weights.stat().st_size < max_bytes


def test_both_looks_find_the_same_kinds() -> None:
    assert stored_network(FIRST_LOOK).kinds == stored_network(SECOND_LOOK).kinds == CLASSES
