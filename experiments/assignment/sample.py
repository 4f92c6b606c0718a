"""A balanced sample of each cell's clips for each participant."""

import random
from collections.abc import Sequence

from experiments.trials.declared import ClipSpec


def sampled(
    clips: Sequence[ClipSpec], per_cell: int, exemplars: int, seed: int, number: int
) -> frozenset[ClipSpec]:
    """The clips that one participant sees.

    Parameters
    ----------
    clips : sequence of ClipSpec
        Of the participant's group, all exemplars of each cell.
    per_cell : int
        How many of each cell's exemplars are seen.
    exemplars : int
        How many there are.
    seed : int
        Of the order in which exemplars are dealt, the same for all participants.
    number : int
        Of the participant in the group, from 0. Exemplars are dealt around a circle, so that over the first N
        places, for any N, how often two clips are seen differs by at most one.
    """
    order = list(range(1, exemplars + 1))
    random.Random(seed).shuffle(order)
    mine = {order[(number * per_cell + step) % exemplars] for step in range(per_cell)}
    return frozenset(clip for clip in clips if clip.exemplar in mine)
