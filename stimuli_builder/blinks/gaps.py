"""Runs of frames that are alike, and short gaps filled by straight lines."""

import numpy as np
from numpy.typing import NDArray

from stimuli_builder.blinks.profile import Array


def bridge_gaps(values: Array, most_frames: int) -> tuple[Array, int]:
    """Fill inner runs of NaN no longer than `most_frames` by straight lines; return the number filled."""
    filled = values.copy()
    bridged = 0
    for start, stop in runs(np.isnan(values)):
        if start > 0 and stop < values.size and stop - start <= most_frames:
            share = np.arange(1, stop - start + 1) / (stop - start + 1)
            filled[start:stop] = values[start - 1] + share * (values[stop] - values[start - 1])
            bridged += stop - start
    return filled, bridged


def runs(mask: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return the (start, stop) of every run of True."""
    edges = np.diff(np.concatenate([[0], mask.astype(np.int8), [0]]))
    return list(zip(np.flatnonzero(edges == 1).tolist(), np.flatnonzero(edges == -1).tolist(), strict=True))
