"""The eyeball that a half-shut eye shows, found in a character's levels, and how it turns under the lid.

Along a column of the picture the upper lid's margin goes from its place in the open eye to the lower lid's
(docs/characters.md: closure w leaves an opening of 1 - w). So the closure at which a pixel is covered rises
along the column in proportion to the distance from the upper margin:

    y_m(x, w) = y_u(x) + w (y_l(x) - y_u(x))                                                              (1)

and a line fitted to it gives the upper margin, the lower one lying the declared opening below it. The iris
then moves at closure w by w m, where m is the declared amount, and what lies at either margin stays there:

    d(x, y; w) = w m E(x, y; w) (-1/2, -1),   E = A(x) S(y_m - y) S(y - y_l)                               (2)

Letters: x to the temple, y up, mm from the middle of the open eye; S a smoothstep over RAMP_MM, A one over
the iris, falling to 0 beside it.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from stimuli_builder.characters.facekit.kit import Array
from stimuli_builder.characters.facekit.sphere import smooth
from stimuli_builder.clips.kernels import GAMMA
from stimuli_builder.clips.levels import LevelSet

IRIS_MM, BESIDE_MM = 5.9, 2.5
"""Half the width of what turns with the iris, and how far beside it the sclera follows."""
RAMP_MM = 1.6
IN_PER_DOWN = 0.5
_FITTED_MM = 4.5
_LEVELS = 33
_BLUR_MM = 0.2
_CLEAR = 0.01
"""Squared difference of colour between open and shut below which a pixel tells nothing."""
_RANGE = (0.15, 0.85)
_LEAST_MM2 = 4.0
"""Least area that tells where the margins lie."""
_ROUNDS, _NEAR_MM = 8, 0.5


@dataclass(frozen=True, eq=False)
class Fissure:
    """Both margins of one open eye as parabolas in px: row = p[0] x^2 + p[1] x + p[2], x in mm outwards."""

    column: float
    upper: Array
    lower: Array

    @property
    def middle_row(self) -> float:
        """Row of the open eye's middle."""
        return float(self.upper[2] + self.lower[2]) / 2


@dataclass(frozen=True, eq=False)
class Fissures:
    """When the pixels of a character's levels are covered: what `Fissure`s are fitted to.

    Attributes
    ----------
    covered : float32 array (h, w)
        Closure at which each pixel of the window comes to look more shut than open.
    told : bool array (h, w)
        Where open and shut differ enough to tell.
    """

    character: LevelSet
    opening_mm: float
    covered: NDArray[np.float32]
    told: NDArray[np.bool_]

    @classmethod
    def of(cls, character: LevelSet, opening_mm: float) -> "Fissures":
        """Read off 33 levels at most; `opening_mm` is between the margins at the middle."""
        last = len(character.levels) - 1
        chosen = np.unique(np.rint(np.linspace(0, last, _LEVELS)).astype(int))
        opened, shut = _blurred(character, 0), _blurred(character, last)
        covered = np.full(opened.shape[:2], np.nan, np.float32)
        for index in chosen:
            picture = _blurred(character, int(index))
            looks_shut = ((picture - opened) ** 2).sum(2) > ((picture - shut) ** 2).sum(2)
            covered[looks_shut & np.isnan(covered)] = character.closures[index]
        return cls(character, opening_mm, covered, ((opened - shut) ** 2).sum(2) > _CLEAR)

    def at(self, column: float, outwards: int) -> Fissure | None:
        """The margins of the eye whose middle lies in a column of the frame; None where nothing shuts there.

        Parameters
        ----------
        outwards : {1, -1}
            1 where the temple lies at the picture's right.
        """
        window, scale = self.character.window, self.character.px_per_mm
        rows, columns = np.nonzero(self.told & (self.covered > _RANGE[0]) & (self.covered < _RANGE[1]))
        x = (columns + window.x + 0.5 - column) * outwards / scale
        near = np.abs(x) < _FITTED_MM
        rows, x, w = rows[near], x[near], self.covered[rows[near], columns[near]]
        kept, opening = np.ones(len(x), bool), self.opening_mm * scale
        upper_rows = rows + window.y + 0.5 - w * opening
        terms = np.stack([x**2, x, np.ones_like(x), w * x**2, w * x], 1)
        for _ in range(_ROUNDS):
            if kept.sum() < _LEAST_MM2 * scale**2:
                return None
            fitted = np.linalg.lstsq(terms[kept], upper_rows[kept], rcond=None)[0]
            off = np.abs(terms @ fitted - upper_rows)
            kept = off < max(_NEAR_MM * scale, 2 * float(np.median(off)))
        upper = fitted[:3]
        return Fissure(column, upper, upper + np.append(fitted[3:], opening))


def _blurred(character: LevelSet, index: int) -> NDArray[np.float32]:
    """(h, w, 3) gamma-encoded level, so that hairs and noise count for little."""
    blur = _BLUR_MM * character.px_per_mm
    return np.asarray(cv2.GaussianBlur(GAMMA[character.levels[index]], (0, 0), blur), np.float32)


def turning_share(fissure: Fissure, x_mm: Array, rows: Array, closure: float, px_per_mm: float) -> Array:
    """E of equation (2) at pixels: (h, w) or broadcast of `x_mm` (w,) and `rows` (h, 1)."""
    upper, lower = np.polyval(fissure.upper, x_mm), np.polyval(fissure.lower, x_mm)
    margin = upper + closure * (lower - upper)
    shown = smooth(0, RAMP_MM, (rows - margin) / px_per_mm) * smooth(0, RAMP_MM, (lower - rows) / px_per_mm)
    return np.asarray(smooth(IRIS_MM + BESIDE_MM, IRIS_MM, np.abs(x_mm)) * shown)
