"""Random dots of which no picture, and not their mean, says anything: only their motion does.

Each picture is a lattice of independent dots, each dark or bright with probability 1/2. Within a segment of
`SEGMENT` steps the dots inside the mask move one way and those outside the other, one dot a step, over two
textures that are independent of each other; a share 1 - coherence of the dots is drawn anew in each picture.

- One picture. A shifted texture of independent dots is a texture of independent dots, so that inside, outside
  and across the edge the dots of one picture have one distribution, whatever the mask.
- The mean. Every segment comes a second time with dark and bright exchanged, at another place of the order:
  each dot is dark in half of the pictures, and the mean is the background everywhere. Without this the mean
  shows streaks that break at the mask's edge.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stimuli_builder.checks.masks import LATTICE, Mask

Dots = NDArray[np.bool_]
Generator = np.random.Generator

SEGMENT = 6
"""Steps for which a texture moves on; at 30 a second a fifth of a second."""
STEPS_PER_SECOND = 30
WAYS = ((0, -1), (0, 1), (-1, 0), (1, 0))
"""Left, right, up, down: what a step adds to row and column."""


@dataclass(frozen=True)
class Motion:
    """How the dots move.

    Attributes
    ----------
    way : int
        Of the dots inside the mask, from 1 in the order of `WAYS`.
    """

    mask: Mask
    way: int
    coherence: float
    steps: int


def coherence_of(difficulty: float) -> float:
    """Share of dots that follow: all where nothing is difficult, half of them at a difficulty of 1."""
    return 1 - difficulty / 2


def steps_for(seconds: float) -> int:
    """Steps of a clip that lasts about as long: whole pairs of segments."""
    return 2 * SEGMENT * max(1, round(seconds * STEPS_PER_SECOND / (2 * SEGMENT)))


def pictures(motion: Motion, rng: Generator) -> Dots:
    """(steps, LATTICE, LATTICE) dots, True where bright."""
    pairs = motion.steps // (2 * SEGMENT)
    segments = [_segment(motion, rng) for _ in range(pairs)]
    order = rng.permutation(2 * pairs)
    both = [*segments, *(~segment for segment in segments)]
    return np.concatenate([both[index] for index in order])


def _segment(motion: Motion, rng: Generator) -> Dots:
    size = (LATTICE, LATTICE)
    inside, outside = rng.random(size) < 0.5, rng.random(size) < 0.5
    down, across = WAYS[motion.way - 1]
    made = np.empty((SEGMENT, *size), bool)
    for step in range(SEGMENT):
        there = np.roll(inside, (step * down, step * across), (0, 1))
        back = np.roll(outside, (-step * down, -step * across), (0, 1))
        moved = np.where(motion.mask, there, back)
        drawn_anew = rng.random(size) >= motion.coherence
        made[step] = np.where(drawn_anew, rng.random(size) < 0.5, moved)
    return made
