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
    """Everything the clip builder needs for one cell.

    Attributes
    ----------
    character: a shipped character (`photorealistic`, `cartoon`) or a character folder.
    profile: one of `PROFILES`, or a CSV file of closure samples (0 open, 1 closed).
    duration_frames: blink length in frames at 30 fps; None keeps the recorded length.
    amplitude: `full` (FC) reaches closure 1, `natural` (NC) keeps the measured closure.
    motion_blur: mean of the 300 fps samples of one output frame in linear light (MB), or one sample (NB).
    lower_lid: which lower-lid signals move: both, vertical, horizontal or none.
    eyes: `alike` drives both eyes by one signal, `separate` by the left and right recording.
    fps: frame rate of the clip. width_px, height_px: picture size.
    """

    character: str = "photorealistic"
    profile: ProfileName = "real"
    duration_frames: Annotated[float, Field(ge=3, le=60)] | None = None
    amplitude: Literal["full", "natural"] = "full"
    motion_blur: bool = True
    lower_lid: Literal["both", "vertical", "horizontal", "none"] = "none"
    eyes: Literal["alike", "separate"] = "alike"
    fps: Fps = 30
    width_px: Annotated[int, Field(ge=320, le=1920, multiple_of=2)] = 960
    height_px: Annotated[int, Field(ge=120, le=720, multiple_of=2)] = 360


class RenderOverrides(Declaration):
    """What one level changes of the experiment's `RenderSettings`; None leaves it as it is."""

    character: str | None = None
    profile: ProfileName | None = None
    duration_frames: Annotated[float, Field(ge=3, le=60)] | None = None
    amplitude: Literal["full", "natural"] | None = None
    motion_blur: bool | None = None
    lower_lid: Literal["both", "vertical", "horizontal", "none"] | None = None
    eyes: Literal["alike", "separate"] | None = None
    fps: Fps | None = None

    def applied_to(self, settings: RenderSettings) -> RenderSettings:
        """Return `settings` with this level's values in place, validated again."""
        merged = settings.model_dump() | self.model_dump(exclude_none=True)
        return RenderSettings.model_validate(merged)
