"""How a clip of a cell is rendered: settings of the whole experiment, overridden by each level."""

from pathlib import PurePath
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from experiments.declaration.base import Declaration
from experiments.errors import did_you_mean

MIN_CLIP_PX, MAX_CLIP_PX = (320, 120), (1920, 1200)
"""Least and greatest width and height of a clip, in pixels."""
PROFILES = ("real", "phases", "model", "SL", "AL", "SL_ease", "AL_ease")
"""Built-in blink profiles: recorded, drawn phase by phase, PCA model, and the four textbook curves (symmetric
or asymmetric, linear or eased). Any other value names a CSV file of closure samples next to the experiment's
TOML."""


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
LowerLidGain = Annotated[float, Field(ge=0, le=3)]
Strength = Annotated[float, Field(ge=0, le=1)]
MovedMm = Annotated[float, Field(ge=0, le=1)]
CountingRate = Annotated[float, Field(ge=15, le=1000)]
MIN_BLINK_MS, MAX_BLINK_MS = 100.0, 2000.0
Timing = Literal["uniform", "intervals", "events", "none"]
State = Literal["rest", "reading", "screen", "speaking", "listening"]
EventKind = Literal["utterance_start", "utterance_end", "pause", "turn_end"]
Seconds = Annotated[float, Field(ge=1, le=60)]
PerMinute = Annotated[float, Field(ge=0.1, le=60)]
Moment = Annotated[float, Field(ge=0, le=60)]
Moments = Annotated[tuple[Moment, ...], Field(max_length=100)]


class RenderSettings(Declaration):
    """All settings that the clip builder needs for one cell."""

    character: str = "photorealistic"
    """A shipped character (see `stimuli character list`, for example `alder@8` or `cartoon`), or the path of
    your own character folder. A list of characters is short for a last factor `character` with one level per
    character. The default is the retired `photorealistic`, so that old declarations keep their
    meaning."""
    profile: ProfileName = "real"
    """Blink profile. `real`: recorded. `phases`: composed from recordings phase by phase. `model`: the
    paper's PCA model, which does not close the eye fully. `SL`, `AL`, `SL_ease`, `AL_ease`: textbook curves
    (symmetric or asymmetric, linear or eased). You can also name a CSV file of closure (0 open, 1
    closed)."""
    duration_frames: DurationFrames | None = None
    """Length of the blink in frames at `duration_frames_fps`. It does not depend on the frame rate of the
    clip. If this and `duration_ms` are empty, blinks keep their recorded length."""
    duration_frames_fps: CountingRate = 30.0
    """Frame rate of `duration_frames`, in frames per second."""
    duration_ms: DurationMs | None = None
    """Length of the blink in milliseconds, instead of `duration_frames`."""
    amplitude: Literal["full", "natural"] = "full"
    """`full` (FC) closes the eye fully, to closure 1. `natural` (NC) keeps the measured closure."""
    motion_blur: bool = True
    """On (MB): an output frame is the mean of its 300 fps samples in linear light. Off (NB): it is one of
    these samples."""
    lower_lid: Literal["both", "vertical", "horizontal", "none"] = "none"
    """Which recorded signals move the lower lid."""
    lower_lid_gain: LowerLidGain = 1.0
    """Motion of the lower lid relative to the recording; 0 keeps it still. A clip that exceeds the limits of
    its character (1 mm up, 5 mm toward the nose) is refused."""
    brow_mm: MovedMm | None = None
    """How far the brows move down and together while the eye closes, in mm at closure 1. The motion is
    proportional to closure; 0 keeps the brows still. If empty, the character's own value is used (`cartoon`
    0.45, baked faces 0)."""
    cheek_mm: MovedMm | None = None
    """How far the cheeks rise while the eye closes, in mm at closure 1; otherwise like `brow_mm`."""
    squint_mm: MovedMm | None = None
    """How far the skin below the eye moves up and toward the nose while the eye closes, in mm at closure 1;
    otherwise like `brow_mm`. It does not move the lid margin; see `lower_lid`."""
    gaze_mm: MovedMm | None = None
    """How far the iris turns down under the closing lid, in mm at closure 1 (0.2 is one degree); otherwise
    like `brow_mm`. It turns half as far toward the nose."""
    life: Strength = 0.0
    """Motion between blinks: head sway, breathing, gaze, pupil and sensor noise. 0 is none, 1 as much as in
    recordings of people. The lids follow the gaze; blinks stay as they are."""
    anticipation: Strength = 0.0
    """Animators' anticipation: the lids lift before the blink, by 8% of the opening at 1. To have room for
    it, they rest as much lower. Not used in a performance."""
    settle: Strength = 0.0
    """Animators' settle: the lids open beyond their rest after the blink, by 8% of the opening at 1, and
    sink back within 0.3 s; otherwise like `anticipation`."""
    eyes: Literal["alike", "separate"] = "alike"
    """`alike`: one signal drives both eyes. `separate`: the left and right recordings each drive one eye."""
    performance: Timing | None = None
    """Shows a performance of the blink engine for `seconds` instead of a single blink. `uniform`: a timer
    with intervals from 0.5 to 1.5 times the mean. `intervals`: the engine's fitted intervals. `events`: these
    plus the events of `events_s` or `speech`. `none`: the eyes stay open. Blink n of an exemplar looks the
    same in all of them. `profile` and the blink length apply to single blinks only."""
    seconds: Seconds = 20.0
    """Length of a performance, in seconds."""
    state: State = "listening"
    """What the person in a performance is doing. It sets the mean blink rate (page: blink engine)."""
    blinks_per_minute: PerMinute | None = None
    """Mean blink rate of a performance. If empty, the published rate for its state is used."""
    events_s: Moments = ()
    """Times at which an event triggers a blink, in seconds from the start of the clip. Used if `performance`
    is `events`."""
    event: EventKind = "turn_end"
    """What happens at the times in `events_s`."""
    speech: str = ""
    """A recording with sound or subtitles (.vtt, .srt) next to the TOML file, used if `performance` is
    `events`. Its pauses and turns trigger blinks. The person speaks during turns and is in `state` between
    them. To choose one voice in the subtitles, add its name: `dialogue.vtt#Anna`."""
    fps: Fps = 30
    """Frame rate of the clip, in frames per second."""
    width_px: Annotated[int, Field(ge=MIN_CLIP_PX[0], le=MAX_CLIP_PX[0], multiple_of=2)] = 960
    """Width of the clip, in pixels."""
    height_px: Annotated[int, Field(ge=MIN_CLIP_PX[1], le=MAX_CLIP_PX[1], multiple_of=2)] = 360
    """Height of the clip, in pixels."""

    @model_validator(mode="after")
    def _one_length(self) -> Self:
        if self.duration_ms is not None and self.duration_frames is not None:
            raise ValueError("expected duration_frames or duration_ms, got both; remove one of them")
        length_ms = self.blink_ms
        if length_ms is not None and not MIN_BLINK_MS - 1e-9 <= length_ms <= MAX_BLINK_MS + 1e-9:
            raise ValueError(
                f"expected a blink of {MIN_BLINK_MS:g} to {MAX_BLINK_MS:g} ms, got duration_frames "
                f"{self.duration_frames:g} at {self.duration_frames_fps:g} fps, {length_ms:.0f} ms"
            )
        return self

    @model_validator(mode="after")
    def _performance_fits(self) -> Self:
        answers = bool(self.events_s or self.speech)
        if self.performance == "events" and not answers:
            raise ValueError("performance is 'events': expected events_s or speech, got neither")
        if self.events_s and max(self.events_s) > self.seconds:
            raise ValueError(
                f"events_s: expected moments within the {self.seconds:g} s, got {max(self.events_s):g}"
            )
        return self

    @property
    def blink_ms(self) -> float | None:
        """Length of the blink in milliseconds; None where it keeps the recorded one."""
        if self.duration_frames is None:
            return self.duration_ms
        return self.duration_frames * 1000 / self.duration_frames_fps


class RenderOverrides(Declaration):
    """Settings of [render] that a level changes. Omitted keys keep their value from [render]."""

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
    lower_lid_gain: LowerLidGain | None = None
    """As [render] `lower_lid_gain`, for clips of this level."""
    brow_mm: MovedMm | None = None
    """As [render] `brow_mm`, for clips of this level."""
    cheek_mm: MovedMm | None = None
    """As [render] `cheek_mm`, for clips of this level."""
    squint_mm: MovedMm | None = None
    """As [render] `squint_mm`, for clips of this level."""
    gaze_mm: MovedMm | None = None
    """As [render] `gaze_mm`, for clips of this level."""
    life: Strength | None = None
    """As [render] `life`, for clips of this level."""
    anticipation: Strength | None = None
    """As [render] `anticipation`, for clips of this level."""
    settle: Strength | None = None
    """As [render] `settle`, for clips of this level."""
    eyes: Literal["alike", "separate"] | None = None
    """As [render] `eyes`, for clips of this level."""
    performance: Timing | None = None
    """As [render] `performance`, for clips of this level."""
    seconds: Seconds | None = None
    """As [render] `seconds`, for clips of this level."""
    state: State | None = None
    """As [render] `state`, for clips of this level."""
    blinks_per_minute: PerMinute | None = None
    """As [render] `blinks_per_minute`, for clips of this level."""
    events_s: Moments | None = None
    """As [render] `events_s`, for clips of this level."""
    event: EventKind | None = None
    """As [render] `event`, for clips of this level."""
    speech: str | None = None
    """As [render] `speech`, for clips of this level."""
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
