"""How far an eye is open in a picture, measured against the character's own levels."""

import numpy as np
from numpy.typing import NDArray

from experiments.manifest import Clip
from stimuli_builder.clips.kernels import GAMMA
from stimuli_builder.clips.levels import LevelSet
from stimuli_builder.clips.motion_blur import frame_weights

Array = NDArray[np.float64]


class OpeningMeter:
    """Projects the luma of a picture's window on the difference between open and closed eye.

    The projection falls as the lid comes down, so a table of it over the character's levels, turned round,
    gives the closure of any picture. A frame with motion blur is a mean of light; its projection is
    compared with that of the frame the curve promises, in mm of opening.
    """

    def __init__(self, character: LevelSet, opening_mm: float) -> None:
        self._character, self._opening_mm = character, opening_mm
        rows, columns = character.window.slices
        self._place = rows, columns
        pictures = np.stack([_luma(level) for level in character.levels])
        difference = pictures[0] - pictures[-1]
        self._closed = pictures[-1]
        self._template = difference / np.sum(difference**2)
        table = np.tensordot(pictures - self._closed, self._template, axes=2)
        # Equal steps could not be turned round.
        self._table = np.minimum.accumulate(table - 1e-9 * np.arange(len(table)))

    def measured_mm(self, luma: NDArray[np.uint8]) -> Array:
        """Opening in mm in each picture of (frames, height, width) limited-range luma."""
        rows, columns = self._place
        pictures = (luma[:, rows, columns].astype(np.float64) - 16) / 219
        return self._opening(np.tensordot(pictures - self._closed, self._template, axes=2))

    def promised_mm(self, clip: Clip) -> Array:
        """Opening in mm that each frame of a clip should measure, from its curve."""
        blur = clip.inputs.get("motion_blur") != "false"
        weights = frame_weights(len(clip.closure), clip.fps, blur)
        levels = weights @ self._character.level_weights(np.asarray(clip.closure))
        light = self._character.levels
        values = np.empty(len(levels))
        seen: dict[bytes, float] = {}
        for index, row in enumerate(levels):
            key = row.tobytes()
            if key not in seen:
                used = np.flatnonzero(row > 1e-9)
                frame = _luma(np.tensordot(row[used], light[used], axes=1))
                seen[key] = float(np.sum((frame - self._closed) * self._template))
            values[index] = seen[key]
        return self._opening(values)

    def _opening(self, projected: Array) -> Array:
        closure = np.interp(projected, self._table[::-1], self._character.closures[::-1])
        return np.asarray(self._opening_mm * (1 - closure), np.float64)


def _luma(light: NDArray[np.uint16] | Array) -> Array:
    """Luma in 0-1 of 16-bit linear light (h, w, 3)."""
    code = GAMMA[np.clip(np.round(light), 0, 65535).astype(np.int64)]
    return np.asarray(code @ np.array([0.2126, 0.7152, 0.0722]), np.float64)
