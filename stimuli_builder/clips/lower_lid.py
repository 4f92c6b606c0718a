"""The lower lid's layer at one picture size, added to blended frames for many samples at once."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from stimuli_builder.characters.atlas import Atlas
from stimuli_builder.characters.lower_lid_layer import LevelCodes, LowerLidLayer
from stimuli_builder.clips.kernels import FULL_SCALE, add_products

CHANGE_STEP, FACTOR_STEP = 2.0, 2.0**-15
Array = NDArray[np.float64]
Picture = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class LowerLid:
    """Changes of the open eye by lower-lid pose, and how much of them shows at each closure.

    I(w, v, h) = I(w) + factor(w) change(v, h), bilinear in pose and linear in closure; so the mean over
    the samples of a shutter time is a sum over few (pose, matte) pairs.

    Attributes
    ----------
    vertical_mm, horizontal_mm, closures : float64 array
        Ascending grids of poses and mattes.
    changes : int16 array (vertical x horizontal, h, w, 3)
        In CHANGE_STEP of 65535.
    factors : uint16 array (mattes, h, w, 3)
        In FACTOR_STEP. Floats would take 200 MB more at most.
    rows, columns : slice
        Place in the character's window.
    """

    vertical_mm: Array
    horizontal_mm: Array
    closures: Array
    changes: NDArray[np.int16]
    factors: NDArray[np.uint16]
    rows: slice
    columns: slice

    @classmethod
    def of_character(
        cls, character: Atlas, to_window: Callable[[Picture], Picture], level_srgb: LevelCodes | None = None
    ) -> "LowerLid":
        """Decode a character's layer; `to_window` brings a picture of its crop to the size in use."""
        layer = LowerLidLayer(character, level_srgb)
        vertical, horizontal, closures = layer.vertical_mm, layer.horizontal_mm, layer.matte_closures
        shape = (character.declaration.crop[3], character.declaration.crop[2], 3)

        def placed(part: Picture) -> Picture:
            whole = np.zeros(shape, np.float32)
            whole[layer.window] = part
            return to_window(whole)

        # Cut as they come: whole windows of all poses at once would take 1 GB at the largest size.
        rows, columns = _where_any(placed(np.ones(layer.shape, np.float32)))
        array_shape = (rows.stop - rows.start, columns.stop - columns.start, 3)
        changes = np.empty((len(vertical) * len(horizontal), *array_shape), np.int16)
        for index, change in enumerate(layer.each_change()):
            part = placed(change)[rows, columns] * np.float32(FULL_SCALE / CHANGE_STEP)
            changes[index] = np.clip(np.rint(part), -32767, 32767)
        # The poses' video need not lie beside that of the levels, from which the factors' shade is made.
        character.forget_poses()
        factors = np.empty((len(closures), *array_shape), np.uint16)
        for index in range(len(closures)):
            part = placed(layer.factor_at(index))[rows, columns] / np.float32(FACTOR_STEP)
            factors[index] = np.clip(np.rint(part), 0, FULL_SCALE)
        return cls(vertical, horizontal, closures, changes, factors, rows, columns)

    def limited(self, vertical_mm: Array, horizontal_mm: Array) -> tuple[Array, Array]:
        """The signals held within the poses that exist."""
        return (
            np.clip(vertical_mm, self.vertical_mm[0], self.vertical_mm[-1]),
            np.clip(horizontal_mm, self.horizontal_mm[0], self.horizontal_mm[-1]),
        )

    def thinned(self, step: int) -> "LowerLid":
        """Every `step`th pixel both ways, counted from the window's first."""
        first = [-part.start % step for part in (self.rows, self.columns)]
        inside = slice(first[0], None, step), slice(first[1], None, step)
        changes = np.ascontiguousarray(self.changes[:, *inside])
        starts = (self.rows.start + first[0]) // step, (self.columns.start + first[1]) // step
        rows, columns = (slice(a, a + n) for a, n in zip(starts, changes.shape[1:3], strict=True))
        factors = np.ascontiguousarray(self.factors[:, *inside])
        return replace(self, changes=changes, factors=factors, rows=rows, columns=columns)

    def add(
        self, light: Picture, weights: Array, closure: Array, vertical_mm: Array, horizontal_mm: Array
    ) -> None:
        """Add the weighted mean over samples of the moved lower lid to `light` (h, w, 3), of 65535."""
        vertical, horizontal = self.limited(vertical_mm, horizontal_mm)
        across = _hat(self.vertical_mm, vertical)
        along = _hat(self.horizontal_mm, horizontal)
        covered = _hat(self.closures, np.clip(closure, self.closures[0], self.closures[-1]))
        shares = np.einsum("s,sv,sh,sm->vhm", weights, across, along, covered)
        steps = CHANGE_STEP * FACTOR_STEP
        table = (steps * shares.reshape(-1, shares.shape[2])).astype(np.float32)
        part = np.zeros((*self.changes.shape[1:3], 3), np.float32)
        add_products(self.changes, self.factors, table, part)
        light[self.rows, self.columns] += part


def _hat(grid: Array, values: Array) -> Array:
    """(samples, grid) shares of the two neighbours of each value."""
    if len(grid) == 1:
        return np.ones((len(values), 1))
    index = np.clip(np.searchsorted(grid, values, side="right") - 1, 0, len(grid) - 2)
    share = (values - grid[index]) / (grid[index + 1] - grid[index])
    hat = np.zeros((len(values), len(grid)))
    rows = np.arange(len(values))
    hat[rows, index] = 1.0 - share
    hat[rows, index + 1] = share
    return hat


def _where_any(picture: Picture) -> tuple[slice, slice]:
    """Rows and columns that hold all of a (h, w, 3) picture that is not 0."""
    seen = np.any(picture != 0.0, axis=2)
    rows, columns = np.flatnonzero(seen.any(axis=1)), np.flatnonzero(seen.any(axis=0))
    return slice(int(rows[0]), int(rows[-1]) + 1), slice(int(columns[0]), int(columns[-1]) + 1)
