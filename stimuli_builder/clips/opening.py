"""How far an eye is open in a picture, measured against the character's own levels."""

import numpy as np
from numpy.typing import NDArray

from experiments.manifest import Clip
from stimuli_builder.clips.kernels import GAMMA
from stimuli_builder.clips.levels import LevelSet
from stimuli_builder.clips.motion_blur import frame_weights

Array = NDArray[np.float64]
STEP_PX = 3
"""Every third pixel both ways tells enough."""


class OpeningMeter:
    """Projects the luma of a picture's window on the difference between open and closed eye.

    The projection falls as the lid comes down, so a table of it over the character's levels, turned round,
    gives the closure of any picture. A frame with motion blur is a mean of light; its projection is
    compared with that of the frame the curve promises, in mm of opening.
    """

    def __init__(self, character: LevelSet, opening_mm: float) -> None:
        self._closures, self._opening_mm = character.closures, opening_mm
        self._weights_of = character.level_weights
        rows, columns = character.window.slices
        self._place = slice(rows.start, rows.stop, STEP_PX), slice(columns.start, columns.stop, STEP_PX)
        self._light = character.levels[:, ::STEP_PX, ::STEP_PX].astype(np.float32)
        opened, self._closed = _luma(self._light[0]), _luma(self._light[-1])
        self._template = (opened - self._closed) / np.sum((opened - self._closed) ** 2)
        table = np.array([self._project(_luma(level)) for level in self._light])
        # Equal steps could not be turned round.
        self._table = np.minimum.accumulate(table - 1e-9 * np.arange(len(table)))

    def measured_mm(self, luma: NDArray[np.uint8]) -> Array:
        """Opening in mm in each picture of (frames, height, width) limited-range luma."""
        pictures = (luma[:, *self._place].astype(np.float64) - 16) / 219
        return self._opening(np.array([self._project(picture) for picture in pictures]))

    def promised_mm(self, clip: Clip) -> Array:
        """Opening in mm that each frame of a clip should measure, from its curve."""
        blur = clip.inputs.get("motion_blur") != "false"
        weights = frame_weights(len(clip.closure), clip.fps, blur)
        different, back = np.unique(
            weights @ self._weights_of(np.asarray(clip.closure)), axis=0, return_inverse=True
        )
        return self._opening(np.array([self._promised(row) for row in different])[back])

    def _promised(self, level_weights: Array) -> float:
        used = np.flatnonzero(level_weights > 1e-9)
        return self._project(_luma(np.tensordot(level_weights[used], self._light[used], axes=1)))

    def _project(self, luma: Array) -> float:
        return float(np.sum((luma - self._closed) * self._template))

    def _opening(self, projected: Array) -> Array:
        closure = np.interp(projected, self._table[::-1], self._closures[::-1])
        return np.asarray(self._opening_mm * (1 - closure), np.float64)


def _luma(light: NDArray[np.floating]) -> Array:
    """Luma in 0-1 of 16-bit linear light (h, w, 3)."""
    code = GAMMA[np.clip(np.round(light), 0, 65535).astype(np.int64)]
    return np.asarray(code @ np.array([0.2126, 0.7152, 0.0722]), np.float64)
