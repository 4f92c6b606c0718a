"""One check's clip to be rendered: all that decides its bytes, the hash of that, and the rendering itself."""

import hashlib
import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

from experiments.checks import CHECK_KINDS, CheckName
from stimuli_builder.blinks.profile import PROFILE_FPS
from stimuli_builder.clips.curves import DECIMALS, Array, ClipCurve, generator
from stimuli_builder.clips.encode import encode_clip, encoder_signature
from stimuli_builder.clips.jobs import Look

# What a motion check may show, as masks on the lattice of its dots.

Mask = NDArray[np.bool_]
Generator = np.random.Generator

LATTICE = 60
"""Dots along each side of the picture."""
JITTER = 4
"""Maximum distance of what is shown from the middle, in dots."""

_DIGITS = (
    "00100 01100 00100 00100 00100 00100 01110",
    "01110 10001 00001 00110 01000 10000 11111",
    "01110 10001 00001 00110 00001 10001 01110",
    "00010 00110 01010 10010 11111 00010 00010",
    "11111 10000 11110 00001 00001 10001 01110",
    "01110 10000 10000 11110 10001 10001 01110",
    "11111 00001 00010 00100 00100 01000 01000",
    "01110 10001 10001 01110 10001 10001 01110",
    "01110 10001 10001 01111 00001 00001 01110",
)
"""The digits from 1 to 9, row by row: no font is needed, and every machine draws the same."""
_DOTS_A_PIXEL = 6


def digit(answer: int) -> Mask:
    """The digit `answer`, (42, 30) dots."""
    rows = [[dot == "1" for dot in row] for row in _DIGITS[answer - 1].split()]
    return np.kron(np.array(rows), np.ones((_DOTS_A_PIXEL, _DOTS_A_PIXEL))).astype(bool)


def shape(answer: int) -> Mask:
    """Circle, square, triangle or cross by the number of the answer, (36, 36) dots, of about one area."""
    down, across = np.mgrid[0:36, 0:36] - 17.5
    if answer == 1:
        return np.asarray(np.hypot(down, across) < 15.5)
    if answer == 2:
        return np.asarray((abs(down) < 14) & (abs(across) < 14))
    if answer == 3:
        return np.asarray(abs(across) * 2 < down + 18)
    return np.asarray((abs(down) < 6.5) | (abs(across) < 6.5))


def placed_mask(shown: Mask, rng: Generator) -> Mask:
    """A mask of the whole lattice with `shown` near its middle."""
    mask = np.zeros((LATTICE, LATTICE), bool)
    top, left = ((LATTICE - side) // 2 + int(rng.integers(-JITTER, JITTER + 1)) for side in shown.shape)
    mask[top : top + shown.shape[0], left : left + shown.shape[1]] = shown
    return mask


# Random dots of which no picture, and not their mean, says anything: only their motion does.
#
# Each picture is a lattice of independent dots, each dark or bright with probability 1/2. Within a segment
# of `SEGMENT` steps the dots inside the mask move one way and those outside the other, one dot per step, over
# two textures that are independent of each other; a share 1 - coherence of the dots is drawn again in each
# picture.
#
# - One picture. A shifted texture of independent dots is a texture of independent dots, so that inside,
# outside and across the edge the dots of one picture have one distribution, whatever the mask. - The mean.
# Every segment comes a second time with dark and bright exchanged, at another place of the order: each dot
# is dark in half of the pictures, and the mean is the background everywhere. Without this the mean shows
# streaks that break at the mask's edge.

Dots = NDArray[np.bool_]

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


# Checks in the study's own look: which blink came first, and which eye closed first.
#
# The two answers' clips hold the same pictures, one in the reverse order of the other: every blink closes
# as it opens. A picture alone says nothing; two pictures in their order say all, as in a study's clips
# themselves.

BLINK_S = 0.36
REST_S = 0.13
"""Open eyes at least this long before, between and after blinks."""


def first_blink(answer: int, difficulty: float, seconds: float, rng: Generator) -> ClipCurve:
    """A full and a half blink; 1: the full one comes first. The half one closes by 0.4 to 0.75."""
    length, blink = _samples(seconds), _samples(BLINK_S)
    free = length - 2 * blink - 3 * _samples(REST_S)
    before, between = np.sort(rng.integers(0, free + 1, 2))
    heights = (1.0, 0.4 + 0.35 * difficulty)
    closure = np.zeros(length)
    first = _samples(REST_S) + int(before)
    second = first + blink + _samples(REST_S) + int(between - before)
    for start, height in zip((first, second), heights, strict=True):
        closure[start : start + blink] = height * _bump(blink)
    return _turned(ClipCurve(_rounded(closure), first), turned=answer == 2)


def first_eye(answer: int, difficulty: float, seconds: float, rng: Generator) -> ClipCurve:
    """One blink of both eyes; 1: that at the left of the picture is first, by 200 to 67 ms by difficulty."""
    length, blink = _samples(seconds), _samples(BLINK_S)
    lag = _samples((6 - 4 * difficulty) / 30)
    start = _samples(REST_S) + int(rng.integers(0, length - blink - lag - 2 * _samples(REST_S) + 1))
    at_left, at_right = np.zeros(length), np.zeros(length)
    at_left[start : start + blink] = _bump(blink)
    at_right[start + lag : start + lag + blink] = _bump(blink)
    # `closure` is of the character's left eye, which is seen at the right.
    curve = ClipCurve(_rounded(at_right), start, closure_other=_rounded(at_left))
    return _turned(curve, turned=answer == 2)


def _samples(seconds: float) -> int:
    return round(seconds * PROFILE_FPS)


def _bump(length: int) -> Array:
    """A blink that closes as it opens: sin^2 over its length."""
    return np.asarray(np.sin(np.pi * (np.arange(length) + 0.5) / length) ** 2)


def _rounded(closure: Array) -> Array:
    return np.round(closure, DECIMALS)


def _turned(curve: ClipCurve, *, turned: bool) -> ClipCurve:
    if not turned:
        return curve
    other = None if curve.closure_other is None else curve.closure_other[::-1].copy()
    return ClipCurve(curve.closure[::-1].copy(), curve.onset_sample, closure_other=other)


CHECK_VERSION = 1
"""Raise this when the same inputs come to give other pictures; every check's clip is then made again."""
DOTS_QP, OWN_LOOK_QP = 16, 24
"""Quantisers: dots are coded nearly as drawn; so coded, a face would take 5 MB per clip."""
DOT_PX = 4
"""Side of a dot: that of the smallest block that H.264 transforms."""
SIDE_PX = LATTICE * DOT_PX
EVERYWHERE = np.ones((LATTICE, LATTICE), bool)
LUMA_BLACK, LUMA_WHITE = 16, 235

Planes = NDArray[np.uint8]


# Decision 0600: No single frame of a check reveals the answer.
@dataclass(frozen=True)
class CheckJob:
    """A check's clip to render.

    Attributes
    ----------
    seed, number : int
        Everything random is drawn from them.
    background : (int, int, int)
        (Y, Cb, Cr) of the page around the clip.
    look : Look or None
        Of the character, for checks in the study's own look.
    """

    check: CheckName
    number: int
    seed: int
    difficulty: float
    contrast: float
    seconds: float
    fps: float
    background: tuple[int, int, int]
    look: Look | None = None

    @property
    def answer(self) -> int:
        """The number of the right answer, drawn evenly."""
        return int(self._rng("answer").integers(1, len(CHECK_KINDS[self.check].choices) + 1))

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height of the clip."""
        return self.look.size_px if self.look else (SIDE_PX, SIDE_PX)

    @property
    def frames(self) -> int:
        """Pictures of the clip."""
        return 2 * round(self.seconds * self.fps / 2) if self.look else self._steps * self._hold

    @property
    def input_hash(self) -> str:
        """SHA-256 over everything that decides the clip's bytes; paths do not count."""
        values = asdict(self)
        if self.look:
            values["look"] = self.look.hashed()
        values |= {"encoder": self.encoder, "check_version": CHECK_VERSION}
        return hashlib.sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()

    def render(self) -> bytes:
        """The bytes of the clip's MP4 file."""
        planes = self._own_look(self.look) if self.look else self._of_dots()
        return encode_clip(planes, self.size_px, self.fps, alone_qp=self._qp)

    @property
    def encoder(self) -> str:
        """What codes the clip, and how."""
        return encoder_signature(self._qp)

    @property
    def _qp(self) -> int:
        return OWN_LOOK_QP if self.look else DOTS_QP

    @property
    def motion(self) -> Motion:
        """What moves where in a clip of dots."""
        rng = self._rng("motion")
        coherence = coherence_of(self.difficulty)
        if self.check == "direction":
            return Motion(EVERYWHERE, self.answer, coherence, self._steps)
        shown = digit(self.answer) if self.check == "digit" else shape(self.answer)
        return Motion(placed_mask(shown, rng), int(rng.integers(1, 5)), coherence, self._steps)

    @property
    def _steps(self) -> int:
        return steps_for(self.seconds)

    @property
    def _hold(self) -> int:
        """Pictures that show one step: dots move at the same speed whatever the rate."""
        return max(1, round(self.fps / 30))

    def _rng(self, what: str) -> np.random.Generator:
        return generator("check", self.seed, self.number, self.check, what)

    def _of_dots(self) -> Iterator[Planes]:
        grey, blue, red = self.background
        step = round(self.contrast * min(grey - LUMA_BLACK, LUMA_WHITE - grey))
        chroma = np.empty((2, SIDE_PX // 2 * (SIDE_PX // 2)), np.uint8)
        chroma[0], chroma[1] = blue, red
        below = chroma.reshape(SIDE_PX // 2, SIDE_PX)
        for dots in pictures(self.motion, self._rng("dots")):
            levels = np.where(dots, grey + step, grey - step).astype(np.uint8)
            picture = np.vstack([levels.repeat(DOT_PX, 0).repeat(DOT_PX, 1), below])
            for _ in range(self._hold):
                yield picture

    def _own_look(self, look: Look) -> Iterator[Planes]:
        # Its compiled kernels load slowly, and most studies have no such check.
        from stimuli_builder.clips.frames import FramePainter

        painter = FramePainter(look.levels())
        # Blurred always: only the means of whole frames are the same in the reverse order.
        return painter.frames(self.curve, look.fps, blur=True)

    @property
    def curve(self) -> ClipCurve:
        """The lids of a clip in the study's own look."""
        make = first_blink if self.check == "first_blink" else first_eye
        return make(self.answer, self.difficulty, self.frames / self.fps, self._rng("lids"))
