"""How far brow, cheek, the skin of a squint and the eyeball move in a whole closure, in mm."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass

from experiments.declaration.rendering import RenderSettings

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
        """What a manifest says that a clip was rendered with; ValueError where it is no number."""
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
