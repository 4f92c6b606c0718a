"""The classifier itself: small networks over the features of a dip; their weights ship in the same folder."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from stimuli_builder.blinks.events.candidates import (
    CLASSES,
    COURSE,
    FEATURES,
    SHALLOWEST,
    Candidate,
    Depth,
    deep_level,
    depth_of,
    features_of,
    find_candidates,
    span_means,
)
from stimuli_builder.blinks.profile import Array
from stimuli_builder.blinks.series import BlinkSeries
from stimuli_builder.blinks.times import runs

FIRST_LOOK, SECOND_LOOK = (Path(__file__).with_name(f"{look}_look.npz") for look in ("first", "second"))
TICKS = 10_000
"""Weights are stored as whole numbers of ten-thousandths: two bytes each, and the same floats everywhere."""


@dataclass(frozen=True, eq=False)
class Network:
    """A multilayer perceptron: standardized features, layers of tanh, softmax over `kinds`.

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
        # As in training: beyond six spreads a feature says "far", and an outlier must not decide by its
        # size.
        values = np.clip((features - self.mean) / self.spread, -6, 6)
        for number, (weights, offsets) in enumerate(self.layers):
            values = values @ weights + offsets
            if number < len(self.layers) - 1:
                values = np.tanh(values)
        # Softmax is the same for shifted values, and exp cannot overflow below 0.
        values = np.exp(values - values.max(axis=1, keepdims=True))
        return np.asarray(values / values.sum(axis=1, keepdims=True))


@cache
def shipped_network(path: Path) -> Network:
    """One of the networks that ship, `FIRST_LOOK` or `SECOND_LOOK`, made by `bench/lid_event_training.py`."""
    return stored_network(path)


def stored_network(path: Path) -> Network:
    """Read a network that `bench/lid_event_training.py` wrote."""
    with np.load(path, allow_pickle=False) as stored:
        count = sum(name.startswith("weights") for name in stored)
        layers = tuple((stored[f"weights{n}"] / TICKS, stored[f"offsets{n}"] / TICKS) for n in range(count))
        return Network(tuple(stored["kinds"].tolist()), stored["mean"], stored["spread"], layers)


# Gapless pieces of lid series, their dips, and what a first look at each dip says of it.

SHORTEST_PIECE_S = 0.8


@dataclass(frozen=True, eq=False)
class MeasuredPiece:
    """A gapless piece of one eye with its dips.

    Attributes
    ----------
    start : int
        Its first frame in the series.
    deep : float
        How deep this piece's blinks go, as depth.
    features : float64 array (dips, features)
        Inputs of the first look for each dip.
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
class Piece(MeasuredPiece):
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
        for of_eye in measure_pieces(eyes)
    ]


def measure_pieces(eyes: Sequence[BlinkSeries]) -> list[list[MeasuredPiece]]:
    """Pieces of each series with the first look's inputs for their dips."""
    pieces = [_dips_of(series) for series in eyes]
    others = partners(pieces)
    return [
        [
            replace(piece, features=features_of(piece.candidates, piece.depth, of_piece(other, piece)))
            for piece in of_eye
        ]
        for of_eye, other in zip(pieces, others, strict=True)
    ]


def _dips_of(series: BlinkSeries) -> list[MeasuredPiece]:
    """Pieces of a series with their dips, not yet classified."""
    pieces = []
    for start, stop in runs(np.isfinite(series.distance)):
        if stop - start >= max(5, SHORTEST_PIECE_S * series.fps):
            depth = depth_of(series.distance[start:stop], series.fps)
            candidates = find_candidates(depth)
            pieces.append(
                MeasuredPiece(start, depth, candidates, deep_level(candidates, depth), np.empty((0, 0)))
            )
    return pieces


def partners(eyes: Sequence[Sequence[MeasuredPiece]]) -> list[Array | None]:
    """Depth of each eye's other eye, to the end of its last piece; None where there are not two."""
    if len(eyes) != 2:
        return [None] * len(eyes)
    return [_whole(eyes[1 - number]) for number in range(2)]


def _whole(pieces: Sequence[MeasuredPiece]) -> Array:
    """Depth of an eye to the end of its last piece, its deep level 1; NaN in gaps."""
    ends = [piece.start + piece.depth.smooth.size for piece in pieces]
    whole = np.full(max(ends, default=0), np.nan)
    for piece, end in zip(pieces, ends, strict=True):
        # As parts of the eye's own blinks: one eye may open wider than the other, or be seen from the side.
        whole[piece.start : end] = piece.depth.smooth / piece.deep
    return whole


def of_piece(whole: Array | None, piece: MeasuredPiece) -> Array | None:
    """The part of another series at the time of a piece, equally long; NaN beyond the end."""
    if whole is None:
        return None
    size = piece.depth.smooth.size
    part = whole[piece.start : piece.start + size]
    return np.pad(part, (0, size - part.size), constant_values=np.nan)


# A second look at each dip: its first classification, and what happens around it, classify it better.
#
# The dips before and after, the dip of the other eye, lids' courses about the crossings at half height (how
# fast a lid moves distinguishes a partial blink from a squint, and the deepest frame of a held lid does not
# show it), and what the recording is full of: where somebody squints often, one more squint is likelier.

NEIGHBOURS = (-2, -1, 1, 2)
SAME_DIP_S = 0.2
"""A dip of the other eye within this time of one is the same event."""
ROUNDING_S = 1e-6
FAR_S, NEAR_S = 10.0, 0.02
# The first look is hardly ever so sure; its logarithm stays within the range that the second one learned.
MIN_PROBABILITY = 1e-4
STEPS_S = (0.008, 0.025, 0.045, 0.07, 0.1, 0.14, 0.2, 0.3)
EDGES_S = np.concatenate([-np.array(STEPS_S[::-1]), STEPS_S])
"""Ends of the spans about a crossing: as fine as lids go there."""
SPANS = tuple(f"from {a:g} to {b:g} s" for a, b in pairwise(EDGES_S))
MEASURES = FEATURES[: -2 * len(COURSE)]
PROBABILITIES = tuple(f"log probability of {kind}" for kind in CLASSES)
CONTEXT = (
    *PROBABILITIES,
    *MEASURES,
    *(
        f"dip {step:+d}: {name}"
        for step in NEIGHBOURS
        for name in (*PROBABILITIES, "log seconds away", "relative depth")
    ),
    *(f"other eye's {name}" for name in PROBABILITIES),
    "other eye has a dip", "tenths of a second to it", "its depth to its deep", "other eye has dips",
    *(f"{lids}, {centre}, {span}"
      for centre in ("closing", "opening") for lids in ("this eye", "both eyes") for span in SPANS),
    *(f"both eyes, deepest, {span}" for span in SPANS),
    *(f"log other {kind}s a minute" for kind in CLASSES),
    *(f"log depth of {kind}s" for kind in CLASSES),
    "log noise", "log depth to blinks'", "log depth to squints'",
)  # fmt: skip


def second_look(eyes: list[list[Piece]]) -> list[list[Array]]:
    """Probabilities (dips, kinds) of each piece of each eye, by the network of the second look."""
    network = shipped_network(SECOND_LOOK)
    return [[network.probabilities(context) for context in of_eye] for of_eye in contexts(eyes)]


def contexts(eyes: list[list[Piece]]) -> list[list[Array]]:
    """Rows of `CONTEXT` (dips, features) of each piece of each eye."""
    out = []
    for number, (pieces, whole) in enumerate(zip(eyes, partners(eyes), strict=True)):
        other = [] if whole is None else eyes[1 - number]
        out.append([_context(piece, pieces, other, whole) for piece in pieces])
    return out


def _context(piece: Piece, pieces: list[Piece], other: list[Piece], whole: Array | None) -> Array:
    if not piece.candidates:
        return np.empty((0, len(CONTEXT)))
    parts = [_log(piece.probabilities), piece.features[:, : len(MEASURES)]]
    parts += [_neighbour(piece, step) for step in NEIGHBOURS]
    parts += [_partner(piece, other, whole), *_crossings(piece, whole), _recording(piece, pieces)]
    return np.concatenate(parts, axis=1)


def _log(probabilities: Array) -> Array:
    return np.asarray(np.log(np.clip(probabilities, MIN_PROBABILITY, 1)))


def _nothing(count: int) -> Array:
    """Log probabilities (count, kinds) of what is not a dip at all."""
    return np.tile(_log(np.eye(len(CLASSES))[-1]), (count, 1))


def _neighbour(piece: Piece, step: int) -> Array:
    """(dips, kinds + 2) of the dip so many after each; beyond the last one, nothing far away."""
    count, times, depths = len(piece.candidates), piece.peaks_s, piece.depths
    numbers = np.arange(count) + step
    is_there = (numbers >= 0) & (numbers < count)
    numbers = np.clip(numbers, 0, count - 1)
    away = np.where(is_there, np.abs(times[numbers] - times), FAR_S)
    part = np.where(is_there, np.clip(depths[numbers] / np.maximum(depths, SHALLOWEST), -1, 4), 0)
    probabilities = np.where(is_there[:, None], _log(piece.probabilities)[numbers], _nothing(count))
    return np.column_stack([probabilities, np.log(np.clip(away, NEAR_S, FAR_S)), part])


def _partner(piece: Piece, other: list[Piece], whole: Array | None) -> Array:
    """(dips, kinds + 4) of the other eye's dip at the same time that is least likely to be nothing.

    If the other eye is missing or not visible, a dip is its own partner, which is an input too.
    """
    count, times = len(piece.candidates), piece.peaks_s
    own = np.concatenate([_log(piece.probabilities), np.zeros((count, 4))], axis=1)
    with_dips = [one for one in other if one.candidates]
    beside = of_piece(whole, piece)
    if beside is None or not with_dips:
        return own
    theirs = np.concatenate([one.peaks_s for one in with_dips])
    probabilities = np.concatenate([one.probabilities for one in with_dips])
    deep = np.concatenate([one.depths / one.deep for one in with_dips])
    chosen = _likeliest(times, theirs, 1 - probabilities[:, -1])
    is_there = chosen >= 0
    later = np.where(is_there, theirs[chosen] - times, 0) * 10
    logs = np.where(is_there[:, None], _log(probabilities)[chosen], _nothing(count))
    told = np.column_stack([logs, is_there, later, np.where(is_there, deep[chosen], 0), np.ones(count)])
    peaks = np.array([c.peak for c in piece.candidates])
    return np.where(np.isfinite(beside[peaks])[:, None], told, own)


def _likeliest(times: Array, theirs: Array, weights: Array) -> NDArray[np.int64]:
    """(n,) number of the greatest weight among ascending times within `SAME_DIP_S` of each; -1 for none."""
    reach = SAME_DIP_S + ROUNDING_S
    first, last = np.searchsorted(theirs, times - reach), np.searchsorted(theirs, times + reach)
    spans = zip(first.tolist(), last.tolist(), strict=True)
    return np.array([a + int(weights[a:b].argmax()) if a < b else -1 for a, b in spans], np.int64)


def _crossings(piece: Piece, whole: Array | None) -> list[Array]:
    """Courses (dips, spans) about both crossings at half height and of both eyes about the deepest frame.

    As parts of the dip's depth; where the other eye is not seen, it does what this one does.
    """
    depth, heights = piece.depth, np.maximum(piece.depths, SHALLOWEST)[:, None]
    both = depth.smooth
    beside = of_piece(whole, piece)
    if beside is not None:
        both = (both + np.where(np.isfinite(beside), beside * piece.deep, both)) / 2
    closing = np.array([c.left[1] for c in piece.candidates])
    opening = np.array([c.right[1] for c in piece.candidates])
    deepest = np.array([float(c.peak) for c in piece.candidates])
    order = ((depth.raw, closing), (both, closing), (depth.raw, opening), (both, opening), (both, deepest))
    means = [span_means(lids, centres, EDGES_S * depth.fps) for lids, centres in order]
    return [np.clip(mean / heights, -2, 2) for mean in means]


def _recording(piece: Piece, pieces: list[Piece]) -> Array:
    """(dips, 2 kinds + 3) of what else the eye does: events of each kind a minute, their depth, the noise."""
    probabilities = np.concatenate([one.probabilities for one in pieces if one.candidates])
    logs = np.log(np.maximum(np.concatenate([one.depths for one in pieces if one.candidates]), 0.02))
    minutes = sum(one.depth.smooth.size for one in pieces) / piece.depth.fps / 60
    rates = np.log1p((probabilities.sum(0) - piece.probabilities) / minutes)
    usual = (probabilities * logs[:, None]).sum(0) / np.maximum(probabilities.sum(0), 1e-3)
    count = len(piece.candidates)
    to_usual = np.log(np.maximum(piece.depths, 0.02))[:, None] - usual[:2]
    noise: NDArray[np.float64] = np.full((count, 1), np.log(piece.depth.noise))
    return np.concatenate([rates, np.tile(usual, (count, 1)), noise, to_usual], axis=1)
