"""The course of the lid about a dip, as means over spans of time that grow away from its deepest frame."""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from stimuli_builder.blinks.profile import Array

SPANS_S = (0.0, 0.025, 0.06, 0.1, 0.15, 0.2, 0.27, 0.35, 0.45, 0.6, 0.8, 1.1, 1.5, 2.1)
"""Ends of the spans on either side of the deepest frame: as fine as a blink moves, then coarser."""
EDGES_S = np.concatenate([-np.array(SPANS_S[:0:-1]), SPANS_S])
COURSE = tuple(f"from {a:g} to {b:g} s" for a, b in pairwise(EDGES_S))


def courses(values: Array, peaks: NDArray[np.int64], fps: float) -> Array:
    """Mean of a series (n,) over each span about each peak (p,): (p, spans); see `span_means`."""
    return span_means(values, peaks.astype(np.float64), EDGES_S * fps)


def span_means(values: Array, centres: Array, edges: Array) -> Array:
    """Mean of a series (n,) between edges (s + 1,) about each centre (p,), both in frames: (p, s).

    Samples are joined by straight lines, so that a span shorter than a frame has a mean too and the same
    lid gives the same means at every rate. Beyond its ends the series keeps its last value.
    """
    reach = int(np.ceil(np.abs(edges).max())) + 2
    long = np.pad(values, reach, mode="edge")
    areas = np.concatenate([[0.0], np.cumsum((long[1:] + long[:-1]) / 2)])
    places = np.clip(centres, 0, values.size - 1)[:, None] + reach + edges
    left = np.floor(places).astype(np.int64)
    part = places - left
    area = areas[left] + long[left] * part + (long[left + 1] - long[left]) * part**2 / 2
    return np.asarray(np.diff(area, axis=1) / np.diff(edges))
