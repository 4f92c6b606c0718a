"""How a clip of a cell is rendered: settings of the whole experiment, overridden by each level."""

from pathlib import PurePath
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, Field, model_validator

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
DurationFrames = Annotated[float, Field(ge=3, le=600)]
DurationMs = Annotated[float, Field(ge=100, le=2000)]
CountingRate = Annotated[float, Field(ge=15, le=1000)]
MIN_BLINK_MS, MAX_BLINK_MS = 100.0, 2000.0


class RenderSettings(Declaration):
    """Everything the clip builder needs for one cell."""

    character: str = "photorealistic"
    """A shipped character (`photorealistic`, `cartoon`), or the path of a character folder of your own."""
    profile: ProfileName = "real"
    """Blink profile: recorded (`real`), of the PCA model (`model`), a textbook curve (`SL`, `AL`, `SL_ease`,
    `AL_ease`: symmetric or asymmetric, linear or eased), or a CSV file of closure (0 open, 1 closed)."""
    duration_frames: DurationFrames | None = None
    """Length of the blink, in frames at `duration_frames_fps`, whatever rate the clip has; left out (and
    `duration_ms` too), blinks keep their recorded length."""
    duration_frames_fps: CountingRate = 30.0
    """Rate at which `duration_frames` counts, in frames per second."""
    duration_ms: DurationMs | None = None
    """Length of the blink in milliseconds, instead of `duration_frames`."""
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

    @model_validator(mode="after")
    def _one_length(self) -> Self:
        if self.duration_ms is not None and self.duration_frames is not None:
            raise ValueError("expected duration_frames or duration_ms, got both; leave one out")
        length_ms = self.blink_ms
        if length_ms is not None and not MIN_BLINK_MS - 1e-9 <= length_ms <= MAX_BLINK_MS + 1e-9:
            raise ValueError(
                f"expected a blink of {MIN_BLINK_MS:g} to {MAX_BLINK_MS:g} ms, got duration_frames "
                f"{self.duration_frames:g} at {self.duration_frames_fps:g} fps, {length_ms:.0f} ms"
            )
        return self

    @property
    def blink_ms(self) -> float | None:
        """Length of the blink in milliseconds; None where it keeps the recorded one."""
        if self.duration_frames is None:
            return self.duration_ms
        return self.duration_frames * 1000 / self.duration_frames_fps


class RenderOverrides(Declaration):
    """What a level changes of [render]; a key left out stays as it is there."""

    character: str | None = None
    """As [render] `character`, for clips of this level."""
    profile: ProfileName | None = None
    """As [render] `profile`, for clips of this level."""
    duration_frames: DurationFrames | None = None
    """As [render] `duration_frames`, for clips of this level."""
    duration_frames_fps: CountingRate | None = None
    """As [render] `duration_frames_fps`, for clips of this level."""
    duration_ms: DurationMs | None = None
    """As [render] `duration_ms`, for clips of this level."""
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
        own = self.model_dump(exclude_none=True)
        merged = settings.model_dump() | own
        for length, other in (("duration_ms", "duration_frames"), ("duration_frames", "duration_ms")):
            if length in own and other not in own:
                merged[other] = None
        return RenderSettings.model_validate(merged)
