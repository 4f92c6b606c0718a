"""Gapless pieces of lid series, their dips, and what a first look at each dip says of it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from stimuli_builder.blinks.events.candidates import Candidate, deep_level, features_of, find_candidates
from stimuli_builder.blinks.events.levels import Depth, depth_of
from stimuli_builder.blinks.events.network import FIRST_LOOK, shipped_network
from stimuli_builder.blinks.gaps import runs
from stimuli_builder.blinks.profile import Array
from stimuli_builder.blinks.series import BlinkSeries

SHORTEST_PIECE_S = 0.8


@dataclass(frozen=True, eq=False)
class Measured:
    """A gapless piece of one eye with its dips.

    Attributes
    ----------
    start : int
        Its first frame in the series.
    deep : float
        How deep this piece's blinks go, as depth.
    features : float64 array (dips, features)
        What the first look is told of each dip.
    """

    start: int
    depth: Depth
    candidates: list[Candidate]
    deep: float
    features: Array

    @property
    def peaks_s(self) -> Array:
        """(dips,) time of each deepest frame in the series."""
        return np.array([self.start + c.peak for c in self.candidates]) / self.depth.fps

    @property
    def depths(self) -> Array:
        """(dips,) depth of each dip."""
        return np.array([c.depth for c in self.candidates])


@dataclass(frozen=True, eq=False)
class Piece(Measured):
    """A piece after the first look.

    Attributes
    ----------
    probabilities : float64 array (dips, kinds)
        The probability of each kind that the first look gives each dip.
    """

    probabilities: Array


def looked_at(eyes: Sequence[BlinkSeries]) -> list[list[Piece]]:
    """Pieces of each series after a first look at their dips; two series are the two eyes of one face."""
    network = shipped_network(FIRST_LOOK)
    return [
        [Piece(**vars(piece), probabilities=network.probabilities(piece.features)) for piece in of_eye]
        for of_eye in measured(eyes)
    ]


def measured(eyes: Sequence[BlinkSeries]) -> list[list[Measured]]:
    """Pieces of each series with what the first look is told of their dips."""
    pieces = [_dips_of(series) for series in eyes]
    others = partners(pieces)
    return [
        [
            replace(piece, features=features_of(piece.candidates, piece.depth, of_piece(other, piece)))
            for piece in of_eye
        ]
        for of_eye, other in zip(pieces, others, strict=True)
    ]


def _dips_of(series: BlinkSeries) -> list[Measured]:
    """Pieces of a series with their dips, of which nothing is told yet."""
    pieces = []
    for start, stop in runs(np.isfinite(series.distance)):
        if stop - start >= max(5, SHORTEST_PIECE_S * series.fps):
            depth = depth_of(series.distance[start:stop], series.fps)
            candidates = find_candidates(depth)
            pieces.append(Measured(start, depth, candidates, deep_level(candidates, depth), np.empty((0, 0))))
    return pieces


def partners(eyes: Sequence[Sequence[Measured]]) -> list[Array | None]:
    """Depth of each eye's other eye, to the end of its last piece; None where there are not two."""
    if len(eyes) != 2:
        return [None] * len(eyes)
    return [_whole(eyes[1 - number]) for number in range(2)]


def _whole(pieces: Sequence[Measured]) -> Array:
    """Depth of an eye to the end of its last piece, its deep level 1; NaN in gaps."""
    ends = [piece.start + piece.depth.smooth.size for piece in pieces]
    whole = np.full(max(ends, default=0), np.nan)
    for piece, end in zip(pieces, ends, strict=True):
        whole[piece.start : end] = piece.depth.smooth / piece.deep
    return whole


def of_piece(whole: Array | None, piece: Measured) -> Array | None:
    """The part of a whole series that lies beside a piece, as long as it; NaN beyond the end."""
    if whole is None:
        return None
    size = piece.depth.smooth.size
    part = whole[piece.start : piece.start + size]
    return np.pad(part, (0, size - part.size), constant_values=np.nan)
