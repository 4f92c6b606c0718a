"""A balanced sample of each cell's clips for each participant."""

import random
from collections.abc import Sequence

from experiments.design import ClipSpec


def sampled(
    clips: Sequence[ClipSpec], per_cell: int, exemplars: int, seed: int, place: int
) -> frozenset[ClipSpec]:
    """The clips that one participant sees.

    Parameters
    ----------
    clips: of the participant's group, all exemplars of each cell.
    per_cell: how many of each cell's exemplars are seen.
    exemplars: how many there are.
    seed: of the order in which exemplars are dealt, the same for all participants.
    place: of the participant in the group, from 0. Exemplars are dealt around a circle, so that over the
        first N places, for any N, how often two clips are seen differs by at most one.
    """
    order = list(range(1, exemplars + 1))
    random.Random(seed).shuffle(order)
    mine = {order[(place * per_cell + step) % exemplars] for step in range(per_cell)}
    return frozenset(clip for clip in clips if clip.exemplar in mine)
