"""How a clip of a cell is rendered: settings of the whole experiment, overridden by each level."""

from pathlib import PurePath
from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from experiments.base import Declaration
from experiments.errors import did_you_mean

PROFILES = ("real", "model", "SL", "AL", "SL_ease", "AL_ease")
"""Built-in blink profiles: recorded, PCA model, and the four textbook curves (symmetric or asymmetric,
linear or eased). Any other value names a CSV file of closure samples beside the experiment's TOML."""


def _known_profile(value: str) -> str:
    if value in PROFILES or PurePath(value).suffix == ".csv":
        return value
    near = did_you_mean(value, PROFILES)
    raise ValueError(
        f"expected one of {', '.join(PROFILES)} or a .csv file of closure samples, got '{value}'{near}"
    )


ProfileName = Annotated[str, AfterValidator(_known_profile)]
Fps = Annotated[int, Field(ge=24, le=60)]


class RenderSettings(Declaration):
    """Everything the clip builder needs for one cell."""

    character: str = "photorealistic"
    """A shipped character (`photorealistic`, `cartoon`), or the path of a character folder of your own."""
    profile: ProfileName = "real"
    """Blink profile: recorded (`real`), of the PCA model (`model`), a textbook curve (`SL`, `AL`, `SL_ease`,
    `AL_ease`: symmetric or asymmetric, linear or eased), or a CSV file of closure (0 open, 1 closed)."""
    duration_frames: Annotated[float, Field(ge=3, le=60)] | None = None
    """Length of the blink, in frames at 30 per second; left out, blinks keep their recorded length."""
    amplitude: Literal["full", "natural"] = "full"
    """`full` (FC) closes the eye fully, to closure 1; `natural` (NC) keeps the closure that was measured."""
    motion_blur: bool = True
    """Mean of the 300 fps samples of an output frame in linear light (MB), or one sample of it (NB)."""
    lower_lid: Literal["both", "vertical", "horizontal", "none"] = "none"
    """Which recorded signals move the lower lid."""
    eyes: Literal["alike", "separate"] = "alike"
    """One signal drives both eyes, or the left and the right recording an eye each."""
    fps: Fps = 30
    """Frame rate of the clip, in frames per second."""
    width_px: Annotated[int, Field(ge=320, le=1920, multiple_of=2)] = 960
    """Width of the clip, in pixels."""
    height_px: Annotated[int, Field(ge=120, le=720, multiple_of=2)] = 360
    """Height of the clip, in pixels."""


class RenderOverrides(Declaration):
    """What a level changes of [render]; a key left out stays as it is there."""

    character: str | None = None
    """As [render] `character`, for clips of this level."""
    profile: ProfileName | None = None
    """As [render] `profile`, for clips of this level."""
    duration_frames: Annotated[float, Field(ge=3, le=60)] | None = None
    """As [render] `duration_frames`, for clips of this level."""
    amplitude: Literal["full", "natural"] | None = None
    """As [render] `amplitude`, for clips of this level."""
    motion_blur: bool | None = None
    """As [render] `motion_blur`, for clips of this level."""
    lower_lid: Literal["both", "vertical", "horizontal", "none"] | None = None
    """As [render] `lower_lid`, for clips of this level."""
    eyes: Literal["alike", "separate"] | None = None
    """As [render] `eyes`, for clips of this level."""
    fps: Fps | None = None
    """As [render] `fps`, for clips of this level."""

    def applied_to(self, settings: RenderSettings) -> RenderSettings:
        """Return `settings` with this level's values in place, validated again."""
        merged = settings.model_dump() | self.model_dump(exclude_none=True)
        return RenderSettings.model_validate(merged)
