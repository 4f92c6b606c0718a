"""What clips need of a character: its size and scale, and its levels at a size."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Protocol

from experiments.errors import InputError

if TYPE_CHECKING:
    from stimuli_builder.clips.levels import LevelSet


@dataclass(frozen=True)
class Geometry:
    """Size and scale of a character's whole frame, before it is scaled to a clip."""

    name: str
    size_px: tuple[int, int]
    px_per_mm: float
    inter_ocular_mm: float
    opening_mm: float
    lower_range_mm: tuple[tuple[float, float], tuple[float, float]] | None
    """Least and greatest lift, and slide, of the lower lid; None without a lower-lid layer."""
    moved_mm: Mapping[str, float] = field(default_factory=dict)
    """What else a whole closure moves, by part; empty where nobody measured it."""
    blink_rows: tuple[int, int] = (0, 0)
    """First row of the whole frame that a blink changes, and the row after the last."""

    def scaled(self, width_px: int, height_px: int) -> tuple[tuple[int, int], int]:
        """Size of the whole frame when `width_px` wide, and the rows to cut above to get `height_px`.

        Raises
        ------
        InputError
            The character is less high than that, or a blink would not be seen whole.
        """
        whole = (width_px, round(self.size_px[1] * width_px / self.size_px[0]))
        spare = whole[1] - height_px
        if spare < 0:
            raise InputError(
                f"character '{self.name}' is {whole[1]} px high at a width of {width_px} px; expected a "
                f"height of at most that, got {height_px}"
            )
        top, scale = 2 * (spare // 4), width_px / self.size_px[0]
        first, after = self.blink_rows
        if after and (first * scale < top or after * scale > top + height_px):
            raise InputError(
                f"a picture of {width_px} x {height_px} px cuts off what moves in a blink of '{self.name}', "
                f"which is {whole[1]} px high at that width; ask for a greater height (its own size: "
                f"width_px = {self.size_px[0]}, height_px = {self.size_px[1]})"
            )
        return whole, top

    def px_per_mm_at(self, width_px: int) -> float:
        """Scale of a clip of that width."""
        return self.px_per_mm * width_px / self.size_px[0]


class Character(Protocol):
    """What clips need of a character, drawn or baked."""

    @property
    def geometry(self) -> Geometry:
        """Size and scale of its whole frame."""

    @property
    def fingerprint(self) -> str:
        """SHA-256 of everything that decides its pictures."""

    def levels(self, size_px: tuple[int, int]) -> "LevelSet":
        """Its pictures at a size (width, height), ready to be blended."""
