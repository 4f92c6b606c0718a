"""What clips need of a character: its size, scale and levels, and how far its face moves."""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Protocol

from experiments.declaration.rendering import MAX_CLIP_PX, MIN_CLIP_PX, RenderSettings
from experiments.errors import InputError

if TYPE_CHECKING:
    from stimuli_builder.clips.levels import LevelSet


# What clips need of a character: its size and scale, and its levels at a size.


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
        # Even, since one row of chroma covers two rows of luma.
        top, scale = 2 * (spare // 4), width_px / self.size_px[0]
        first, after = self.blink_rows
        if after and (first * scale < top or after * scale > top + height_px):
            raise InputError(
                f"a picture of {width_px} x {height_px} px cuts off moving parts of a blink of "
                f"'{self.name}', which is {whole[1]} px high at that width. Use a larger height, such as its "
                f"own size: --size {self.size_px[0]}x{self.size_px[1]}, or width_px = {self.size_px[0]}, "
                f"height_px = {self.size_px[1]}"
            )
        return whole, top

    def clip_size_px(self) -> tuple[int, int]:
        """Size of a clip of the whole frame: its own, scaled into the limits of a clip."""
        width, height = self.size_px
        scale = min(1.0, MAX_CLIP_PX[0] / width, MAX_CLIP_PX[1] / height)
        scale = max(scale, MIN_CLIP_PX[0] / width, MIN_CLIP_PX[1] / height)
        clip_width = min(2 * math.ceil(width * scale / 2 - 1e-9), MAX_CLIP_PX[0])
        # From the rounded width, so that the clip is never higher than the frame at that width.
        clip_height = 2 * (round(height * clip_width / width) // 2)
        return clip_width, min(clip_height, MAX_CLIP_PX[1])

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


# How far brow, cheek, the skin of a squint and the eyeball move in a whole closure, in mm.

PARTS = ("brow", "cheek", "squint", "gaze")
PREFIX = "declared_"
"""Before the names of declared amounts among a manifest clip's `inputs`."""


@dataclass(frozen=True)
class Movement:
    """Declared amounts at closure 1, in mm; None leaves a part to what the character's levels show."""

    brow: float | None = None
    cheek: float | None = None
    squint: float | None = None
    gaze: float | None = None

    @classmethod
    def of_settings(cls, settings: RenderSettings) -> "Movement":
        """What a cell declares."""
        return cls(settings.brow_mm, settings.cheek_mm, settings.squint_mm, settings.gaze_mm)

    @classmethod
    def of_inputs(cls, inputs: Mapping[str, str]) -> "Movement":
        """What a manifest says that a clip was rendered with; ValueError if it is not a number."""
        said = {part: inputs.get(f"{PREFIX}{part}_mm") for part in PARTS}
        return cls(**{part: float(mm) for part, mm in said.items() if mm is not None})

    @property
    def declared(self) -> dict[str, float]:
        """Amount by part, of the declared ones alone."""
        return {part: mm for part, mm in asdict(self).items() if mm is not None}

    def inputs(self) -> dict[str, str]:
        """What a manifest says of it: `of_inputs` reads it back to the same bits."""
        return {f"{PREFIX}{part}_mm": repr(mm) for part, mm in self.declared.items()}

    def beyond(self, own_mm: Mapping[str, float]) -> dict[str, float]:
        """By how much each declared part moves beyond what the levels show of it; those alone that do."""
        added = {part: mm - own_mm.get(part, 0.0) for part, mm in self.declared.items()}
        return {part: mm for part, mm in added.items() if mm != 0.0}


AS_BAKED = Movement()
"""Nothing declared: the character's levels as they are."""
