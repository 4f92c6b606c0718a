"""How far one eye goes along with the blinks of the other: a palsied eye says nothing of the other's blinks.

The networks learned from faces whose eyes do the same. Where one eye moves much less than the other, or not
at all, what it does not do would be taken for a sign that the other did not blink.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stimuli_builder.blinks.events.candidates import Candidate
from stimuli_builder.blinks.events.generated import CLASSES
from stimuli_builder.blinks.events.pieces import Piece
from stimuli_builder.blinks.profile import Array

LIKELY = 0.5
"""Probability from which a dip of an eye by itself is one of the blinks that the other is compared at."""
MUCH_LESS = 0.5
"""Below this part of the other's movement an eye is no witness of the other's blinks (decision 0962)."""
LEAST_MOVEMENT = 0.05
"""Below this part of the other's movement an eye does not move, whatever its noise."""
NOISES = 2.0
"""Standard errors by which a movement rises above what the eye does at other times."""
FLANK_S, CORE_S = 0.2, 0.02
ELSEWHERE_S = (-3.1, -2.3, -1.6, 1.6, 2.3, 3.1)
"""From a blink to the times whose wobble stands for the eye's noise."""


@dataclass(frozen=True)
class Asymmetry:
    """What an eye does at the blinks of the other.

    Attributes
    ----------
    share : float
        Median depth of its movement there, as part of the other's.
    blinks : int
        Blinks of the other at which it was seen.
    moves : bool
        Whether that is more than its noise.
    """

    share: float
    blinks: int
    moves: bool

    @property
    def is_weak(self) -> bool:
        """Whether the eye moves much less than the other."""
        return not self.moves or self.share < MUCH_LESS


def asymmetry(pieces: Sequence[Piece], other: Sequence[Piece], told: Sequence[Array]) -> Asymmetry | None:
    """What an eye does at the blinks of the other; None where the other has none at which it is seen.

    Parameters
    ----------
    pieces : sequence of Piece
        Of the eye.
    other, told : sequence of Piece, of float64 array (dips, kinds)
        Of the other eye looked at by itself, and what each dip is then.
    """
    own = _depth(pieces)
    moved, full, elsewhere = [], [], []
    for piece, probabilities in zip(other, told, strict=True):
        whole = _depth([piece])
        for candidate, row in zip(piece.candidates, probabilities, strict=True):
            if row[CLASSES.index("blink")] < LIKELY:
                continue
            moved.append(_movement(own, candidate, piece, 0.0))
            full.append(_movement(whole, candidate, piece, 0.0))
            elsewhere += [_movement(own, candidate, piece, away) for away in ELSEWHERE_S]
    known = np.isfinite(moved) & np.isfinite(full) & (np.array(full) > 0)
    if not known.any():
        return None
    return _judged(np.array(moved)[known], np.array(full)[known], np.array(elsewhere))


def _judged(moved: Array, full: Array, elsewhere: Array) -> Asymmetry:
    noise = elsewhere[np.isfinite(elsewhere)]
    # Median and its error by deviations: some of the times elsewhere hold a blink.
    sd = 1.4826 * float(np.median(np.abs(noise - np.median(noise)))) if noise.size else 0.0
    least = NOISES * 1.25 * sd / np.sqrt(moved.size)
    share = float(np.median(moved / full))
    return Asymmetry(share, moved.size, bool(share >= LEAST_MOVEMENT and np.median(moved) > least))


def _depth(pieces: Sequence[Piece]) -> Array:
    """Depth of an eye, not smoothed, to the end of its last piece; NaN in gaps."""
    ends = [piece.start + piece.depth.raw.size for piece in pieces]
    depth = np.full(max(ends, default=0), np.nan)
    for piece, end in zip(pieces, ends, strict=True):
        depth[piece.start : end] = piece.depth.raw
    return depth


def _movement(depth: Array, candidate: Candidate, piece: Piece, away_s: float) -> float:
    """Mean depth where a dip is deepest above the median beside it; NaN where that is not seen."""
    fps = piece.depth.fps
    start = piece.start + away_s * fps
    first, last = (start + edge for edge in (candidate.left[0], candidate.right[0]))
    core = _span(depth, start + candidate.left[2] - CORE_S * fps, start + candidate.right[2] + CORE_S * fps)
    flanks = np.concatenate(
        [_span(depth, first - FLANK_S * fps, first), _span(depth, last, last + FLANK_S * fps)]
    )
    if not np.isfinite(core).any() or not np.isfinite(flanks).any():
        return float("nan")
    return float(np.nanmean(core) - np.nanmedian(flanks))


def _span(depth: Array, start: float, stop: float) -> Array:
    """Frames from `start` to `stop`, those that are there."""
    return depth[max(0, round(start)) : max(0, round(stop) + 1)]
