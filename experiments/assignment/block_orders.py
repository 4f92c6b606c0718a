"""The orders of blocks that participants are dealt in turn."""

from itertools import islice, permutations
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from experiments.definition import Experiment

MAX_ORDERS = 120
"""Up to five blocks every order is dealt; beyond that a Latin square: each block in each place."""


def block_orders(experiment: "Experiment") -> list[tuple[int, ...]]:
    """The orders of the levels' blocks that slots are dealt, as indices; one where nothing is dealt."""
    split = experiment.blocks.split_by
    count = len(experiment.factor(split).levels) if split else 1
    if experiment.blocks.order == "alternating":
        return [tuple((start + step) % count for step in range(count)) for start in range(count)]
    if experiment.blocks.order == "counterbalanced":
        every = list(islice(permutations(range(count)), MAX_ORDERS + 1))
        return every if len(every) <= MAX_ORDERS else _latin_square(count)
    return [tuple(range(count))]


def _latin_square(count: int) -> list[tuple[int, ...]]:
    """Williams' balanced square (1949): each block in each place, and after each other equally often."""
    first = [0]
    for step in range(1, count):
        first.append((step + 1) // 2 if step % 2 else count - step // 2)
    rows = [tuple((index + shift) % count for index in first) for shift in range(count)]
    return rows if count % 2 == 0 else rows + [tuple(reversed(row)) for row in rows]
