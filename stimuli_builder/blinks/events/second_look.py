"""A second look at each dip: what it was taken for at first, and what goes on about it, tell it better.

The dips before and after, the dip of the other eye, lids' courses about the crossings at half height (how
fast a lid goes tells a partial blink from a squint, and the deepest frame of a held lid does not show it),
and what the recording is full of: where somebody squints often, one more squint is likelier.
"""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from stimuli_builder.blinks.events.candidates import FEATURES, SHALLOWEST
from stimuli_builder.blinks.events.courses import COURSE, span_means
from stimuli_builder.blinks.events.generated import CLASSES
from stimuli_builder.blinks.events.network import SECOND_LOOK, shipped_network
from stimuli_builder.blinks.events.pieces import Piece, of_piece, partners
from stimuli_builder.blinks.profile import Array

NEIGHBOURS = (-2, -1, 1, 2)
SAME_DIP_S = 0.2
"""A dip of the other eye within this time of one is the same event."""
ROUNDING_S = 1e-6
FAR_S, NEAR_S = 10.0, 0.02
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
    """Log probabilities (count, kinds) of what is no dip at all."""
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

    Where the other eye is not seen, as where there is none, a dip is its own partner, and is told so.
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
