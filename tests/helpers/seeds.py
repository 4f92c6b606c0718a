"""Seeds of runs that are the same whenever a test runs, others for every test."""

import os
import random
from collections.abc import Iterator
from unittest import mock

import pytest

from server.participation import links

OTHER_SEEDS = "TEST_SEEDS"
"""Set to a number, this environment variable gives every test other seeds: does it hang on chance?"""


ONE_SEED = 7


@pytest.fixture(autouse=True)
def seeds_by_name(request: pytest.FixtureRequest) -> Iterator[None]:
    """Runs that begin in this process draw their seeds from the test's name; tokens stay random.

    A test that failed and is run again draws others: what hangs on an order is named in the summary.
    """
    tries = getattr(request.node, "execution_count", 1)  # of pytest-rerunfailures
    drawn = random.Random(f"{request.node.nodeid}/{os.environ.get(OTHER_SEEDS, '')}/{tries}")

    def new_seed() -> int:
        return drawn.getrandbits(links.SEED_BITS)

    with mock.patch.object(links, "new_seed", new_seed):
        yield


@pytest.fixture
def one_seed(seeds_by_name: None) -> Iterator[None]:
    """Every run has this seed, however the test is run: simulated answers follow the order of the trials."""
    with mock.patch.object(links, "new_seed", return_value=ONE_SEED):
        yield
