"""A character as baked pictures: any eyelid closure by linear interpolation in linear light.

The atlas holds one full open-eye frame and, for a rising list of closures, the crop that a blink changes.
"""

from collections.abc import Iterable
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from experiments.errors import InputError
from stimuli_builder.characters.colour import srgb_to_linear
from stimuli_builder.characters.declaration import DECLARATION_FILE, Declaration, Picture, read_declaration
from stimuli_builder.characters.lower_lid_layer import LowerLidLayer
from stimuli_builder.characters.reading import check_closures, decode_picture, slices

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
        return slices(self.declaration.crop)

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
    def lower_lid_layer(self) -> LowerLidLayer:
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
