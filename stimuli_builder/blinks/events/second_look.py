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
from stimuli_builder.blinks.events.network import SECOND_LOOK, shipped_network
from stimuli_builder.blinks.events.pieces import Piece, beside, of_piece
from stimuli_builder.blinks.profile import Array

KINDS = ("blink", "squint", "gaze_shift", "closed_eye", "nothing")
NEIGHBOURS = (-2, -1, 1, 2)
SAME_DIP_S = 0.2
"""A dip of the other eye within this time of one is the same event."""
FAR_S, NEAR_S = 10.0, 0.02
LEAST_ODDS = 1e-4
STEPS_S = (0.008, 0.025, 0.045, 0.07, 0.1, 0.14, 0.2, 0.3)
EDGES_S = np.concatenate([-np.array(STEPS_S[::-1]), STEPS_S])
"""Ends of the spans about a crossing: as fine as lids go there."""
SPANS = tuple(f"from {a:g} to {b:g} s" for a, b in pairwise(EDGES_S))
MEASURES = FEATURES[: -2 * len(COURSE)]
CONTEXT = (
    *(f"log odds of {kind}" for kind in KINDS),
    *MEASURES,
    *(
        f"dip {step:+d}: {name}"
        for step in NEIGHBOURS
        for name in (*(f"log odds of {kind}" for kind in KINDS), "log seconds away", "depth to this one's")
    ),
    *(f"other eye's log odds of {kind}" for kind in KINDS),
    "other eye has a dip", "tenths of a second to it", "its depth to its deep", "other eye has dips",
    *(f"{lids}, {centre}, {span}"
      for centre in ("closing", "opening") for lids in ("this eye", "both eyes") for span in SPANS),
    *(f"both eyes, deepest, {span}" for span in SPANS),
    *(f"log other {kind}s a minute" for kind in KINDS),
    *(f"log depth of {kind}s" for kind in KINDS),
    "log noise", "log depth to blinks'", "log depth to squints'",
)  # fmt: skip


def second_look(eyes: list[list[Piece]], sizes: list[int]) -> list[list[Array]]:
    """Probabilities (dips, kinds) of each piece of each eye, by the network of the second look.

    Parameters
    ----------
    sizes : list of int
        Frames of each eye's series.
    """
    network = shipped_network(SECOND_LOOK)
    return [[network.probabilities(context) for context in of_eye] for of_eye in contexts(eyes, sizes)]


def contexts(eyes: list[list[Piece]], sizes: list[int]) -> list[list[Array]]:
    """Rows of `CONTEXT` (dips, features) of each piece of each eye."""
    out = []
    for number, pieces in enumerate(eyes):
        other = eyes[1 - number] if len(eyes) == 2 else None
        whole = None if other is None else beside(other, sizes[number])
        out.append([_context(piece, pieces, other, whole) for piece in pieces])
    return out


def _context(piece: Piece, pieces: list[Piece], other: list[Piece] | None, whole: Array | None) -> Array:
    if not piece.candidates:
        return np.empty((0, len(CONTEXT)))
    parts = [_log(piece.odds), piece.features[:, : len(MEASURES)]]
    parts += [_neighbour(piece, step) for step in NEIGHBOURS]
    parts += [_partner(piece, other), *_crossings(piece, whole), _recording(piece, pieces)]
    return np.concatenate(parts, axis=1)


def _log(odds: Array) -> Array:
    return np.asarray(np.log(np.clip(odds, LEAST_ODDS, 1)))


def _nothing(count: int) -> Array:
    """Log odds (count, kinds) of what is no dip at all."""
    return np.tile(_log(np.eye(len(KINDS))[-1]), (count, 1))


def _neighbour(piece: Piece, step: int) -> Array:
    """(dips, kinds + 2) of the dip so many after each; beyond the last one, nothing far away."""
    count, times, depths = len(piece.candidates), piece.peaks_s, piece.depths
    numbers = np.arange(count) + step
    is_there = (numbers >= 0) & (numbers < count)
    numbers = np.clip(numbers, 0, count - 1)
    away = np.where(is_there, np.abs(times[numbers] - times), FAR_S)
    part = np.where(is_there, np.clip(depths[numbers] / np.maximum(depths, SHALLOWEST), -1, 4), 0)
    odds = np.where(is_there[:, None], _log(piece.odds)[numbers], _nothing(count))
    return np.column_stack([odds, np.log(np.clip(away, NEAR_S, FAR_S)), part])


def _partner(piece: Piece, other: list[Piece] | None) -> Array:
    """(dips, kinds + 4) of the other eye's dip at the same time that is least likely to be nothing."""
    count, times = len(piece.candidates), piece.peaks_s
    if other is None or not any(beside.candidates for beside in other):
        return np.concatenate([_log(piece.odds), np.zeros((count, 4))], axis=1)
    with_dips = [beside for beside in other if beside.candidates]
    theirs = np.concatenate([beside.peaks_s for beside in with_dips])
    odds = np.concatenate([beside.odds for beside in with_dips])
    depths = np.concatenate([beside.depths / beside.deep for beside in with_dips])
    near = np.abs(theirs - times[:, None]) < SAME_DIP_S
    likely = np.where(near, 1 - odds[:, -1], -1.0)
    chosen, is_there = likely.argmax(1), np.asarray(near.any(1))
    later = np.where(is_there, theirs[chosen] - times, 0) * 10
    deep = np.where(is_there, depths[chosen], 0)
    first = np.where(is_there[:, None], _log(odds)[chosen], _nothing(count))
    return np.column_stack([first, is_there, later, deep, np.ones(count)])


def _crossings(piece: Piece, whole: Array | None) -> list[Array]:
    """Courses (dips, spans) about both crossings at half height and of both eyes about the deepest frame.

    As parts of the dip's depth; where the other eye is not seen, it does what this one does.
    """
    depth, heights = piece.depth, np.maximum(piece.depths, SHALLOWEST)[:, None]
    both = depth.smooth
    if whole is not None:
        theirs = of_piece(whole, piece) * piece.deep
        both = (depth.smooth + np.where(np.isfinite(theirs), theirs, depth.smooth)) / 2
    closing = np.array([c.left[1] for c in piece.candidates])
    opening = np.array([c.right[1] for c in piece.candidates])
    deepest = np.array([float(c.peak) for c in piece.candidates])
    order = ((depth.raw, closing), (both, closing), (depth.raw, opening), (both, opening), (both, deepest))
    means = [span_means(lids, centres, EDGES_S * depth.fps) for lids, centres in order]
    return [np.clip(mean / heights, -2, 2) for mean in means]


def _recording(piece: Piece, pieces: list[Piece]) -> Array:
    """(dips, 2 kinds + 3) of what else the eye does: events of each kind a minute, their depth, the noise."""
    odds = np.concatenate([one.odds for one in pieces if one.candidates])
    logs = np.log(np.maximum(np.concatenate([one.depths for one in pieces if one.candidates]), 0.02))
    minutes = sum(one.depth.smooth.size for one in pieces) / piece.depth.fps / 60
    rates = np.log1p((odds.sum(0) - piece.odds) / minutes)
    usual = (odds * logs[:, None]).sum(0) / np.maximum(odds.sum(0), 1e-3)
    count = len(piece.candidates)
    to_usual = np.log(np.maximum(piece.depths, 0.02))[:, None] - usual[:2]
    noise: NDArray[np.float64] = np.full((count, 1), np.log(piece.depth.noise))
    return np.concatenate([rates, np.tile(usual, (count, 1)), noise, to_usual], axis=1)
