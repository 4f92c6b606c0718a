"""Gapless pieces of lid series, their dips, and what a first look at each dip says of it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from stimuli_builder.blinks.events.candidates import Candidate, deep_level, features_of, find_candidates
from stimuli_builder.blinks.events.levels import Depth, depth_of
from stimuli_builder.blinks.events.network import FIRST_LOOK, shipped_network
from stimuli_builder.blinks.profile import Array
from stimuli_builder.blinks.series import BlinkSeries, runs

SHORTEST_PIECE_S = 0.8


@dataclass(frozen=True, eq=False)
class Piece:
    """A gapless piece of one eye with its dips.

    Attributes
    ----------
    start : int
        Its first frame in the series.
    deep : float
        How deep this piece's blinks go, as depth.
    features, odds : float64 array (dips, features), (dips, kinds)
        What the first look is told of each dip, and the probabilities that it gives.
    """

    start: int
    depth: Depth
    candidates: list[Candidate]
    deep: float
    features: Array
    odds: Array

    @property
    def peaks_s(self) -> Array:
        """(dips,) time of each deepest frame in the series."""
        return np.array([self.start + c.peak for c in self.candidates]) / self.depth.fps

    @property
    def depths(self) -> Array:
        """(dips,) depth of each dip."""
        return np.array([c.depth for c in self.candidates])


def looked_at(eyes: Sequence[BlinkSeries]) -> list[list[Piece]]:
    """Pieces of each series after a first look at its dips; two series are the two eyes of one face."""
    pieces = [dips_of(series) for series in eyes]
    if len(eyes) == 1:
        return [[_first_look(piece, None) for piece in pieces[0]]]
    others = [beside(pieces[1 - number], series.distance.size) for number, series in enumerate(eyes)]
    return [
        [_first_look(piece, of_piece(other, piece)) for piece in of_eye]
        for of_eye, other in zip(pieces, others, strict=True)
    ]


def dips_of(series: BlinkSeries) -> list[Piece]:
    """Pieces of a series with their dips, not looked at yet."""
    pieces, none = [], np.empty((0, 0))
    for start, stop in runs(np.isfinite(series.distance)):
        if stop - start >= max(5, SHORTEST_PIECE_S * series.fps):
            depth = depth_of(series.distance[start:stop], series.fps)
            candidates = find_candidates(depth)
            pieces.append(Piece(start, depth, candidates, deep_level(candidates, depth), none, none))
    return pieces


def beside(pieces: list[Piece], size: int) -> Array:
    """Depth of an eye over the whole series (size,), its deep level 1; NaN in gaps."""
    whole = np.full(size, np.nan)
    for piece in pieces:
        stop = min(size, piece.start + piece.depth.smooth.size)
        whole[piece.start : stop] = piece.depth.smooth[: stop - piece.start] / piece.deep
    return whole


def of_piece(whole: Array, piece: Piece) -> Array:
    """The part of a whole series that lies beside a piece."""
    return whole[piece.start : piece.start + piece.depth.smooth.size]


def _first_look(piece: Piece, other: Array | None) -> Piece:
    features = features_of(piece.candidates, piece.depth, other)
    odds = shipped_network(FIRST_LOOK).probabilities(features)
    return replace(piece, features=features, odds=odds)
