"""What moves in a face in addition to its lids when a study declares it: brow, cheek, squint and gaze."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from experiments.errors import InputError
from stimuli_builder.characters.colour import smooth
from stimuli_builder.clips.character_levels import DRAWN_LOOKS
from stimuli_builder.clips.geometry import Geometry, Movement
from stimuli_builder.clips.kernels import GAMMA
from stimuli_builder.clips.levels import LevelSet, Light, LowerLid, Window, window_inside

# What moves in a face in addition to its lids when a study declares it: brow, cheek, squint and gaze.

Array = NDArray[np.float64]


# How the skin round an eye follows brow, cheek and squint: fields of displacement in the picture.
#
# Positions are in mm from the middle of the open eye: x to the temple, y up. A part that moves by its
# amount m at closure 1 displaces the picture at closure w by
#
# d(x, y; w) = w m F(x, y) u,      F = exp(-|(x - c) / s|^p / 2) S(y)                                    (1)
#
# Letters: u the direction (unit length), c and s the middle and the spread along x, p how steep its ends are,
# S a smoothstep that is 0 on the lids and 1 where the part lies. The numbers of brow, cheek and squint follow
# the front of ICT-FaceKit's mean shapes browDown, cheekSquint and eyeSquint.


@dataclass(frozen=True)
class SkinField:
    """One part's field: equation (1) at m = w = 1."""

    direction: tuple[float, float]
    middle_mm: float
    spread_mm: float
    still_mm: float
    """Height at which S begins to leave 0."""
    whole_mm: float
    """Height at which S reaches 1."""
    power: float = 2.0

    def share(self, x_mm: Array, y_mm: Array) -> Array:
        """F in 0-1 at positions relative to one eye."""
        along = np.exp(-(np.abs((x_mm - self.middle_mm) / self.spread_mm) ** self.power) / 2)
        return np.asarray(along * smooth(self.still_mm, self.whole_mm, y_mm))


FIELDS = {
    "brow": SkinField((-0.71, -0.71), 5.0, 13.0, 9.0, 17.0),
    "cheek": SkinField((-0.21, 0.98), 17.0, 15.0, -6.5, -19.0),
    "squint": SkinField((-0.71, 0.71), 5.0, 12.0, -6.5, -15.0),
}
DRAWN_BROW = SkinField((0.0, -1.0), 3.0, 27.0, 4.5, 6.5, power=16.0)
"""The cartoon's brows sink whole, as they are drawn to do."""


# The eyeball that a half-shut eye shows, found in a character's levels, and how it turns under the lid.
#
# Along a column of the picture the upper lid's margin goes from its place in the open eye to the lower lid's
# (closure w leaves an opening of 1 - w). So the closure at which a pixel is covered rises
# along the column in proportion to the distance from the upper margin:
#
# y_m(x, w) = y_u(x) + w (y_l(x) - y_u(x))                                                              (1)
#
# and a line fitted to it gives the upper margin, the lower one lying the declared opening below it. The iris
# then moves at closure w by w m, where m is the declared amount, and what lies at either margin stays there:
#
# d(x, y; w) = w m E(x, y; w) (-1/2, -1),   E = A(x) S(y_m - y) S(y - y_l)                               (2)
#
# Letters: x to the temple, y up, mm from the middle of the open eye; S a smoothstep over RAMP_MM, A one over
# the iris, falling to 0 next to it.

IRIS_MM, BESIDE_MM = 5.9, 2.5
"""Half the width of what turns with the iris, and how far next to it the sclera follows."""
RAMP_MM = 1.6
IN_PER_DOWN = 0.5
_FITTED_MM = 4.5
_LEVELS = 33
_BLUR_MM = 0.2
_CLEAR = 0.01
"""Squared difference of color between open and shut below which a pixel is not informative."""
_RANGE = (0.15, 0.85)
_LEAST_MM2 = 4.0
"""Minimum area from which the margins can be estimated."""
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
        Where open and closed differ enough.
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
            # Nearer to the shut picture than to the open one: no threshold that would depend on skin or
            # light.
            looks_shut = ((picture - opened) ** 2).sum(2) > ((picture - shut) ** 2).sum(2)
            # The first level that looks shut decides: later ones must not replace it.
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
            # Lashes and highlights are covered at other closures than the skin about them: they are dropped
            # round by round.
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


# A character's levels with brow, cheek, squint and gaze moved in them: each is fetched along one field.

STILL_PX = 0.01
"""Displacements at closure 1 below which a pixel counts as still."""
Shift = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class _Eye:
    """Where one eye lies in the frame; `outwards` is 1 where its temple lies at the right."""

    outwards: int
    fissure: Fissure


def moved_levels(character: LevelSet, geometry: Geometry, movement: Movement) -> LevelSet:
    """The levels with what is declared moved in proportion to closure; the same object where nothing is.

    The picture at closure 0 stays. What comes in at the picture's edge, at most the declared mm, is skin
    mirrored there.

    Raises
    ------
    InputError
        No eye is found to move anything about.
    """
    added = movement.beyond(geometry.moved_mm)
    if not added:
        return character
    eyes = _eyes(character, geometry)
    skin = _skin_shift(character, eyes, added)
    gaze = added.get("gaze", 0.0)
    window = _window_of(character, skin)
    first = character.window.y - window.y, character.window.x - window.x
    levels = np.empty((len(character.levels), window.height, window.width, 3), np.uint16)
    # Where the window grows, pixels that no blink changes show the base at every level.
    levels[:] = character.base[window.slices]
    inside = tuple(slice(at, at + n) for at, n in zip(first, character.levels.shape[1:3], strict=True))
    levels[:, *inside] = character.levels
    skin = skin[window.slices]
    for index, closure in enumerate(character.closures):
        shift = np.float32(closure) * skin
        for eye in eyes if gaze else ():
            _add_gaze(shift, character, eye, float(closure) * gaze, float(closure), window)
        _fetch(levels[index], shift)
    return replace(character, levels=levels, window=window, read_lower=_placed(character, *first))


def _eyes(character: LevelSet, geometry: Geometry) -> list[_Eye]:
    eyes = []
    fissures = Fissures.of(character, geometry.opening_mm)
    half_px = geometry.inter_ocular_mm / 2 * character.px_per_mm
    for outwards in (-1, 1):
        column = character.size_px[0] / 2 + outwards * half_px
        fissure = fissures.at(column, outwards)
        if fissure is None:
            raise InputError(
                f"character '{character.name}': no eye that closes was found "
                f"{geometry.inter_ocular_mm / 2:g} mm from the picture's center; remove brow_mm, cheek_mm, "
                "squint_mm and gaze_mm"
            )
        eyes.append(_Eye(outwards, fissure))
    return eyes


def _skin_shift(character: LevelSet, eyes: list[_Eye], added: Mapping[str, float]) -> Shift:
    """(height, width, 2) px to the right and down that the frame's skin moves at closure 1."""
    width, height = character.size_px
    shift = np.zeros((height, width, 2), np.float32)
    fields = FIELDS | ({"brow": DRAWN_BROW} if character.name in DRAWN_LOOKS else {})
    for eye in eyes:
        x = (
            (np.arange(width, dtype=np.float64) + 0.5 - eye.fissure.column)
            * eye.outwards
            / character.px_per_mm
        )
        y = (
            eye.fissure.middle_row - np.arange(height, dtype=np.float64)[:, None] - 0.5
        ) / character.px_per_mm
        for part, mm in added.items():
            if part in fields:
                px = mm * character.px_per_mm * fields[part].share(x, y)
                shift[..., 0] += px * fields[part].direction[0] * eye.outwards
                # Rows grow downwards, y upwards.
                shift[..., 1] -= px * fields[part].direction[1]
    return shift


def _add_gaze(
    shift: Shift, character: LevelSet, eye: _Eye, down_mm: float, closure: float, window: Window
) -> None:
    """Add to a window's displacements in px what the eyeball turns, `down_mm` at the iris."""
    scale, fissure = character.px_per_mm, eye.fissure
    reach = (IRIS_MM + BESIDE_MM) * scale
    left, right = (int(at) - window.x for at in (fissure.column - reach, fissure.column + reach + 1))
    columns = slice(max(left, 0), min(right, window.width))
    x = (
        (np.arange(window.width, dtype=np.float64)[columns] + window.x + 0.5 - fissure.column)
        * eye.outwards
        / scale
    )
    ends = np.polyval(fissure.upper, x).min(), np.polyval(fissure.lower, x).max()
    rows = slice(max(int(ends[0]) - window.y, 0), min(int(ends[1]) + 1 - window.y, window.height))
    y = np.arange(window.height, dtype=np.float64)[rows, None] + window.y + 0.5
    down = down_mm * scale * turning_share(fissure, x, y, closure, scale)
    shift[rows, columns, 0] -= IN_PER_DOWN * eye.outwards * down
    shift[rows, columns, 1] += down


def _window_of(character: LevelSet, shift: Shift) -> Window:
    """The even window round the blink's and whatever else moves."""
    moves = np.abs(shift).max(axis=2) > STILL_PX
    if not moves.any():
        return character.window
    rows, columns = np.flatnonzero(moves.any(axis=1)), np.flatnonzero(moves.any(axis=0))
    now = character.window
    left, top = min(now.x, int(columns[0])), min(now.y, int(rows[0]))
    right = max(now.x + now.width, int(columns[-1]) + 1)
    bottom = max(now.y + now.height, int(rows[-1]) + 1)
    return window_inside(left, top, right - left, bottom - top, character.size_px)


def _fetch(level: Light, shift: Shift) -> None:
    """Bring each pixel of a level from where its displacement began; leave it where it is still.

    The displacement is small and smooth, so that of the place it ends at stands for that of its origin.
    """
    moves = np.abs(shift).max(axis=2) > STILL_PX
    rows = np.flatnonzero(moves.any(axis=1))
    if len(rows):
        part = slice(int(rows[0]), int(rows[-1]) + 1)
        # Fetched, not pushed: every pixel of the result gets a value, with no holes between.
        at = _pixels(level.shape[:2])[part] - shift[part]
        fetched = cv2.remap(level, at, None, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT_101)
        np.copyto(level[part], fetched, where=moves[part, :, None])


@lru_cache(maxsize=1)
def _pixels(size: tuple[int, int]) -> Shift:
    """(height, width, 2) column and row of each pixel."""
    rows, columns = np.mgrid[0 : size[0], 0 : size[1]].astype(np.float32)
    return np.stack([columns, rows], -1)


def _placed(character: LevelSet, down: int, across: int) -> Callable[[], LowerLid] | None:
    """Reads the lower lid at its place in the greater window."""
    if character.read_lower is None:
        return None

    def read() -> LowerLid:
        lower = character.lower
        rows, columns = (
            slice(part.start + by, part.stop + by)
            for part, by in ((lower.rows, down), (lower.columns, across))
        )
        return replace(lower, rows=rows, columns=columns)

    return read
