"""A character as baked pictures: any eyelid closure by linear interpolation in linear light.

The atlas holds one full open-eye frame and, for a rising list of closures, the crop that a blink changes.
"""

import hashlib
from collections.abc import Iterable, Sequence
from functools import cached_property
from io import BytesIO
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray
from PIL import Image, UnidentifiedImageError

from experiments.errors import InputError
from stimuli_builder.characters.colour import srgb_to_linear
from stimuli_builder.characters.declaration import DECLARATION_FILE, Declaration, Picture, read_declaration

SHADE_LIMITS = (0.2, 1.1)
SHADE_BLUR_MM = 0.4
DARKEST = np.float32(2e-3)
SHIPPED = Path(__file__).parent / "data"


class Character:
    """One character, decoded as far as it has been asked for.

    Attributes
    ----------
    folder : Path
        Where the pictures lie.
    declaration : Declaration
        The validated content of `character.toml`.
    """

    def __init__(self, folder: Path, declaration: Declaration) -> None:
        self.folder = folder
        self.declaration = declaration

    @property
    def name(self) -> str:
        """The character's name, as manifests have it."""
        return self.declaration.name

    @property
    def closures(self) -> NDArray[np.float64]:
        """(n,) closures of the baked levels, ascending from 0 to 1."""
        return np.array([level.closure for level in self.declaration.levels])

    @property
    def crop(self) -> tuple[slice, slice]:
        """Rows and columns of the full frame that a blink may change."""
        return _slices(self.declaration.crop)

    @property
    def size_px(self) -> tuple[int, int]:
        """(width, height) of the full frame."""
        return self.declaration.size_px

    @property
    def has_lower_lid(self) -> bool:
        """Whether the lower lid can be moved by its own signals."""
        return self.declaration.lower_lid is not None

    def base_linear(self) -> NDArray[np.float32]:
        """(height, width, 3) linear light of the whole open-eye frame."""
        return srgb_to_linear(self._decode(self.declaration.base, self.size_px, "base frame"))

    def level_srgb(self, index: int) -> NDArray[np.uint8]:
        """(h, w, 3) sRGB code values of one level's crop."""
        level = self.declaration.levels[index]
        return self._decode(
            level, self.declaration.crop[2:], f"atlas level {index} (closure {level.closure:g})"
        )

    def levels_linear(self) -> NDArray[np.float32]:
        """(n, h, w, 3) linear light of every level's crop; decoded at each call, so keep it.

        129 levels of 730 x 230 px take 260 MB.
        """
        width, height = self.declaration.crop[2:]
        levels = np.empty((len(self.declaration.levels), height, width, 3), np.float32)
        for index in range(len(levels)):
            levels[index] = srgb_to_linear(self.level_srgb(index))
        return levels

    def level_weights(self, closures: ArrayLike) -> NDArray[np.float32]:
        """(m, n) weights over levels of m closures; each row has at most two neighbours and sums to 1.

        The mean of rows is the weight vector of motion blur over these closures.

        Raises
        ------
        InputError
            A closure is NaN or outside 0-1.
        """
        wanted = check_closures(closures)
        upper = np.clip(np.searchsorted(self.closures, wanted, side="left"), 1, len(self.closures) - 1)
        low, high = self.closures[upper - 1], self.closures[upper]
        share = (wanted - low) / (high - low)
        weights = np.zeros((len(wanted), len(self.closures)), np.float32)
        rows = np.arange(len(wanted))
        weights[rows, upper - 1] = 1.0 - share
        weights[rows, upper] = share
        return weights

    def lower_lid_delta(
        self, closure: float, vertical_mm: float, horizontal_mm: float
    ) -> NDArray[np.float32]:
        """(h, w, 3) linear light to add to the crop for a moved lower lid; negative sums clip to 0.

        Parameters
        ----------
        closure : float
            Upper-lid closure of the frame, 0-1: the upper lid and its shadow cover the lower lid.
        vertical_mm, horizontal_mm : float
            Lower-lid displacement, up and towards the nose, within the baked range.

        Raises
        ------
        InputError
            The character has no lower-lid layer, or a value is outside its range.
        """
        layer = self.lower_lid_layer
        delta = np.zeros((self.declaration.crop[3], self.declaration.crop[2], 3), np.float32)
        delta[layer.window] = layer.delta(closure, vertical_mm, horizontal_mm)
        return delta

    @cached_property
    def lower_lid_layer(self) -> "LowerLidLayer":
        """The decoded lower-lid layer; InputError where the character has none."""
        return LowerLidLayer(self)

    def check_files(self) -> None:
        """Decode every picture once; InputError names the first that is missing or damaged."""
        self.base_linear()
        for index in range(len(self.declaration.levels)):
            self.level_srgb(index)
        if self.has_lower_lid:
            _ = self.lower_lid_layer

    def _decode(self, picture: Picture, size: Iterable[int], what: str) -> NDArray[np.uint8]:
        return decode_picture(self.folder, picture, tuple(size), what)


class LowerLidLayer:
    """Poses of the open eye's lower lid, laid under the upper lid of any closure.

    I(w, v, h) = I(w) + (1 - matte(w)) (pose(v, h) - pose(0, 0)) R(w), where R is the blurred brightness of
    I(w) over that of I(0), clipped: the shade that the upper lid throws on the moved skin.
    """

    def __init__(self, character: Character) -> None:
        lower = character.declaration.lower_lid
        if lower is None:
            raise InputError(f"character '{character.name}' has no lower-lid layer: use lower lid 'none'")
        self._character, self._lower = character, lower
        self.vertical_mm, self.horizontal_mm = np.array(lower.vertical_mm), np.array(lower.horizontal_mm)
        crop = character.declaration.crop
        rows, columns = _slices(lower.crop)
        self.window = (
            slice(rows.start - crop[1], rows.stop - crop[1]),
            slice(columns.start - crop[0], columns.stop - crop[0]),
        )
        self.changes = self._decode_poses()
        self.matte_closures = np.array([matte.closure for matte in lower.mattes])
        self._factors: dict[int, NDArray[np.float32]] = {}

    @property
    def vertical_range_mm(self) -> tuple[float, float]:
        """Lowest and highest vertical displacement that was baked."""
        return float(self.vertical_mm[0]), float(self.vertical_mm[-1])

    @property
    def horizontal_range_mm(self) -> tuple[float, float]:
        """Lowest and highest horizontal displacement that was baked."""
        return float(self.horizontal_mm[0]), float(self.horizontal_mm[-1])

    def delta(self, closure: float, vertical_mm: float, horizontal_mm: float) -> NDArray[np.float32]:
        """(h, w, 3) linear light to add to `window` of the crop. See Character.lower_lid_delta."""
        closure = float(check_closures([closure])[0])
        row, row_share = _neighbours(self.vertical_mm, vertical_mm, "vertical")
        column, column_share = _neighbours(self.horizontal_mm, horizontal_mm, "horizontal")
        change = np.zeros(self.changes.shape[2:], np.float32)
        for i, across in ((row, 1 - row_share), (row + 1, row_share)):
            for j, along in ((column, 1 - column_share), (column + 1, column_share)):
                if across * along > 0:
                    change += np.float32(across * along) * self.changes[i, j]
        return change * self._factor(closure)

    def _factor(self, closure: float) -> NDArray[np.float32]:
        """(h, w, 1 or 3) of visible share times shade at a closure, interpolated between mattes."""
        if len(self.matte_closures) == 1:
            return self.factor_at(0)
        inside = float(np.clip(closure, self.matte_closures[0], self.matte_closures[-1]))
        index, share = _neighbours(self.matte_closures, inside, "closure")
        if share == 0.0:
            return self.factor_at(index)
        low, high = self.factor_at(index), self.factor_at(index + 1)
        return (1 - np.float32(share)) * low + np.float32(share) * high

    def factor_at(self, index: int) -> NDArray[np.float32]:
        """(h, w, 1 or 3) of visible share times shade at the closure of one matte."""
        if index not in self._factors:
            matte = self._lower.mattes[index]
            what = f"lower-lid matte at closure {matte.closure:g}"
            code = decode_picture(self._character.folder, matte, self._lower.crop[2:], what)[..., :1]
            visible = np.float32(1) - code.astype(np.float32) / np.float32(255)
            self._factors[index] = (visible * self._shade(matte.closure)).astype(np.float32)
        return self._factors[index]

    def _shade(self, closure: float) -> NDArray[np.float32]:
        character = self._character
        weights = character.level_weights([closure])[0]
        image = np.zeros((self._lower.crop[3], self._lower.crop[2], 3), np.float32)
        for index in np.flatnonzero(weights):
            image += weights[index] * srgb_to_linear(character.level_srgb(int(index)))[self.window]
        open_eye = srgb_to_linear(character.level_srgb(0))[self.window]
        sigma = SHADE_BLUR_MM * character.declaration.px_per_mm
        ratio = _blur(image, sigma) / np.maximum(_blur(open_eye, sigma), 1e-3)
        # Never take more light from a pixel than it has: lashes over the lid would turn into red flecks.
        left = (image + DARKEST) / (open_eye + DARKEST)
        bounded = np.minimum(np.clip(ratio, *SHADE_LIMITS), left.min(axis=2, keepdims=True))
        return np.asarray(bounded, dtype=np.float32)

    def _decode_poses(self) -> NDArray[np.float32]:
        """(vertical, horizontal, h, w, 3) change of each pose against the resting one."""
        size = self._lower.crop[2:]
        images = {}
        for pose in self._lower.poses:
            at = (pose.vertical_mm, pose.horizontal_mm)
            what = f"lower-lid pose ({at[0]:g}, {at[1]:g}) mm"
            images[at] = srgb_to_linear(decode_picture(self._character.folder, pose, size, what))
        rest = images[(0.0, 0.0)]
        return np.stack(
            [np.stack([images[(v, h)] - rest for h in self.horizontal_mm]) for v in self.vertical_mm]
        )


def load_character(folder: Path) -> Character:
    """Load a character's declaration; its pictures are decoded when asked for.

    Raises
    ------
    InputError
        The declaration is missing or wrong, or a declared file is not there.
    """
    declaration = read_declaration(folder)
    lower = declaration.lower_lid
    pictures: list[Picture] = [declaration.base, *declaration.levels]
    if lower is not None:
        pictures += [*lower.poses, *lower.mattes]
    for picture in pictures:
        if not (folder / picture.file).is_file():
            raise InputError(
                f"character '{declaration.name}': {picture.file} is missing from {folder}; bake it again or "
                f"correct {DECLARATION_FILE}"
            )
    return Character(folder, declaration)


def check_closures(closures: ArrayLike) -> NDArray[np.float64]:
    """(m,) closures as floats; InputError where one is NaN or outside 0-1 (1e-9 of rounding is clipped)."""
    values = np.atleast_1d(np.asarray(closures, dtype=float)).ravel()
    wrong = ~((values >= -1e-9) & (values <= 1 + 1e-9))
    if wrong.any():
        at = int(np.flatnonzero(wrong)[0])
        raise InputError(f"closure must lie between 0 (open) and 1 (closed); sample {at} is {values[at]:g}")
    return np.asarray(np.clip(values, 0.0, 1.0), dtype=np.float64)


def decode_picture(folder: Path, picture: Picture, size: Sequence[int], what: str) -> NDArray[np.uint8]:
    """(h, w, 3) sRGB code values of one picture; InputError where missing, damaged or the wrong size."""
    try:
        content = (folder / picture.file).read_bytes()
        if picture.sha256 is not None and hashlib.sha256(content).hexdigest() != picture.sha256:
            raise InputError(
                f"{what} is damaged: {picture.file} does not match its declared sha256; bake it again"
            )
        image = Image.open(BytesIO(content)).convert("RGB")
    except FileNotFoundError as error:
        raise InputError(f"{what} is missing: no {picture.file} in {folder}; bake it again") from error
    except (OSError, UnidentifiedImageError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{what} is damaged: cannot decode {picture.file}; bake it again") from error
    if image.size != tuple(size):
        found, wanted = f"{image.width} x {image.height}", " x ".join(str(n) for n in size)
        raise InputError(f"{what}: {picture.file} is {found} px, the declaration asks for {wanted} px")
    return np.asarray(image, dtype=np.uint8)


def _slices(crop: tuple[int, int, int, int]) -> tuple[slice, slice]:
    x, y, width, height = crop
    return slice(y, y + height), slice(x, x + width)


def _neighbours(grid: NDArray[np.float64], value: float, axis: str) -> tuple[int, float]:
    """Index of the grid point at or below `value` (never the last) and the share of the next one."""
    if not (grid[0] - 1e-9 <= value <= grid[-1] + 1e-9):
        raise InputError(
            f"lower lid {axis} displacement must lie between {grid[0]:g} and {grid[-1]:g} mm; it is {value:g}"
        )
    index = int(np.clip(np.searchsorted(grid, value, side="right") - 1, 0, len(grid) - 2))
    return index, float(np.clip((value - grid[index]) / (grid[index + 1] - grid[index]), 0.0, 1.0))


def _blur(image: NDArray[np.float32], sigma: float) -> NDArray[np.float32]:
    return np.asarray(cv2.GaussianBlur(image, (0, 0), sigma), dtype=np.float32)
