"""One check's clip to be rendered: all that decides its bytes, the hash of that, and the rendering itself."""

import hashlib
import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

from experiments.checks import CHECK_KINDS, CheckName
from stimuli_builder.checks.dots import Motion, coherence_of, pictures, steps_for
from stimuli_builder.checks.masks import LATTICE, digit, placed, shape
from stimuli_builder.checks.own_look import first_blink, first_eye
from stimuli_builder.clips.curves import ClipCurve
from stimuli_builder.clips.encode import encode_clip, encoder_signature
from stimuli_builder.clips.jobs import Look
from stimuli_builder.clips.seeds import generator

CHECK_VERSION = 1
"""Raise this when the same inputs come to give other pictures; every check's clip is then made again."""
DOTS_QP, OWN_LOOK_QP = 16, 24
"""Quantisers: dots are coded nearly as drawn; so coded, a face would take 5 MB a clip."""
DOT_PX = 4
"""Side of a dot: that of the smallest block that H.264 transforms."""
SIDE_PX = LATTICE * DOT_PX
EVERYWHERE = np.ones((LATTICE, LATTICE), bool)
LUMA_BLACK, LUMA_WHITE = 16, 235

Planes = NDArray[np.uint8]


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
        return Motion(placed(shown, rng), int(rng.integers(1, 5)), coherence, self._steps)

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
