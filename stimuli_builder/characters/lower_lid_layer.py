"""The lower lid of a baked character: poses of the open eye, laid under the upper lid of any closure."""

from collections.abc import Callable, Iterator
from functools import cached_property
from itertools import product
from typing import TYPE_CHECKING

import cv2
import numpy as np
from numpy.typing import NDArray

from experiments.errors import InputError
from stimuli_builder.characters.colour import srgb_to_linear
from stimuli_builder.characters.declaration import LowerLidPose
from stimuli_builder.characters.interpolation import level_weights
from stimuli_builder.characters.reading import decode_picture, slices

if TYPE_CHECKING:
    from stimuli_builder.characters.atlas import Atlas

LevelCodes = Callable[[int], NDArray[np.uint8]]
"""(h, w, 3) sRGB code values of a level's crop, by the level's number."""
SHADE_LIMITS = (0.2, 1.1)
SHADE_BLUR_MM = 0.4
DARKEST = np.float32(2e-3)


class LowerLidLayer:
    """Poses of the open eye's lower lid, laid under the upper lid of any closure.

    I(w, v, h) = I(w) + (1 - matte(w)) (pose(v, h) - pose(0, 0)) R(w), where w is the closure, v and h the
    lift and the slide in mm, and R the blurred brightness of I(w) over that of I(0), clipped: the shade that
    the upper lid throws on the moved skin. `stimuli_builder.clips.lower_lid` adds it to frames. `level_srgb`
    spares decoding the levels again where they are in memory.
    """

    def __init__(self, character: "Atlas", level_srgb: LevelCodes | None = None) -> None:
        self._level_srgb = level_srgb or character.level_srgb
        lower = character.declaration.lower_lid
        if lower is None:
            raise InputError(f"character '{character.name}' has no lower-lid layer: use lower lid 'none'")
        self._character, self._lower = character, lower
        self.vertical_mm, self.horizontal_mm = np.array(lower.vertical_mm), np.array(lower.horizontal_mm)
        crop = character.declaration.crop
        rows, columns = slices(lower.crop)
        self.window = (
            slice(rows.start - crop[1], rows.stop - crop[1]),
            slice(columns.start - crop[0], columns.stop - crop[0]),
        )
        self.matte_closures = np.array([matte.closure for matte in lower.mattes])
        self.shape = (lower.crop[3], lower.crop[2], 3)

    def factor_at(self, index: int) -> NDArray[np.float32]:
        """(h, w, 1 or 3) of visible share times shade at the closure of one matte."""
        matte = self._lower.mattes[index]
        what = f"lower-lid matte at closure {matte.closure:g}"
        code = decode_picture(self._character.folder, matte, self._lower.crop[2:], what)[..., :1]
        visible = np.float32(1) - code.astype(np.float32) / np.float32(255)
        return (visible * self._shade(matte.closure)).astype(np.float32)

    def _shade(self, closure: float) -> NDArray[np.float32]:
        character = self._character
        weights = level_weights(character.closures, [closure])[0].astype(np.float32)
        image = np.zeros((self._lower.crop[3], self._lower.crop[2], 3), np.float32)
        for index in np.flatnonzero(weights):
            image += weights[index] * srgb_to_linear(self._level_srgb(int(index)))[self.window]
        open_eye, open_blurred = self._open_eye
        ratio = _blur(image, self._sigma) / np.maximum(open_blurred, 1e-3)
        # Never take more light from a pixel than it has: lashes over the lid would turn into red flecks.
        left = (image + DARKEST) / (open_eye + DARKEST)
        bounded = np.minimum(np.clip(ratio, *SHADE_LIMITS), left.min(axis=2, keepdims=True))
        return np.asarray(bounded, dtype=np.float32)

    @cached_property
    def _open_eye(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """(h, w, 3) linear light of the open eye, and the same blurred: for the shade at every matte."""
        open_eye = srgb_to_linear(self._level_srgb(0))[self.window]
        return open_eye, _blur(open_eye, self._sigma)

    @property
    def _sigma(self) -> float:
        """Width of the shade's blur in px."""
        return SHADE_BLUR_MM * self._character.declaration.px_per_mm

    def each_change(self) -> Iterator[NDArray[np.float32]]:
        """(h, w, 3) change of each pose against the resting one; slides of the lowest lift first."""
        poses = {(pose.vertical_mm, pose.horizontal_mm): pose for pose in self._lower.poses}
        rest = self._pose(poses[(0.0, 0.0)])
        for v, h in product(self._lower.vertical_mm, self._lower.horizontal_mm):
            yield self._pose(poses[(v, h)]) - rest

    @property
    def changes(self) -> NDArray[np.float32]:
        """(vertical, horizontal, h, w, 3) changes, all at once."""
        whole = np.stack(list(self.each_change()))
        return whole.reshape(len(self.vertical_mm), len(self.horizontal_mm), *whole.shape[1:])

    def _pose(self, pose: LowerLidPose) -> NDArray[np.float32]:
        return srgb_to_linear(self._character.pose_srgb(pose, self._lower.crop[2:]))


def _blur(image: NDArray[np.float32], sigma: float) -> NDArray[np.float32]:
    return np.asarray(cv2.GaussianBlur(image, (0, 0), sigma), dtype=np.float32)
