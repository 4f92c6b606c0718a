"""`stimuli verify`: are the clips what the manifest says, byte for byte and pixel for pixel?"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from pathlib import Path
from typing import Any

import av
import numpy as np
from numpy.typing import NDArray

from experiments.errors import InputError
from experiments.level_leaks import BRIGHTNESS, LevelLeak, Value, level_leaks
from experiments.manifest import (
    MANIFEST_NAME,
    UPLOADED,
    CheckClip,
    Clip,
    file_sha256,
    place_of,
    read_manifest,
)
from stimuli_builder.clips.build import Progress, silent
from stimuli_builder.clips.characters import fingerprint, geometry, kept_levels, shipped_names
from stimuli_builder.clips.curves import ClipCurve
from stimuli_builder.clips.frames import SEAM_MM, eye_light, frame_windows, regions_of, same_picture
from stimuli_builder.clips.geometry import Movement
from stimuli_builder.clips.kernels import GAMMA
from stimuli_builder.clips.levels import LevelSet
from stimuli_builder.clips.life import EyeRegions, draw_life
from video_conversion.conversion import conversion_of
from video_conversion.video_file import NotAClip, examine

# How far each eye is open in a picture, measured against the character's own levels.

Array = NDArray[np.float64]
STEP_PX = 3
"""Every third pixel in both directions is enough."""


@dataclass(frozen=True, eq=False)
class _Eye:
    """One half of the window: its luma projected on open minus closed gives a number that falls with closure.

    A table of that number over the character's levels, turned round, gives the closure of any picture.
    """

    left_eye: bool
    columns: slice
    closed: Array
    template: Array
    table: Array

    def project(self, luma: Array) -> float:
        """The number of a (h, w) window's luma."""
        return float(np.sum((luma[:, self.columns] - self.closed) * self.template))


class OpeningMeter:
    """Measures both eyes of a picture, each on its own side, and says what a clip's curves promise there.

    A frame with motion blur is a mean of light, and a lower lid that moves changes the projection too. So the
    promised number is that of the frame which the curves describe, blended as the clip builder blends it;
    both numbers are compared as mm of opening.
    """

    def __init__(self, character: LevelSet, opening_mm: float) -> None:
        # Motion between blinks is undone at full resolution, before pixels are left out.
        self._whole, self._character = character, character.thinned(STEP_PX)
        self._opening_mm = opening_mm
        rows, columns = character.window.slices
        self._pixels = slice(rows.start, rows.stop, STEP_PX), slice(columns.start, columns.stop, STEP_PX)
        self._eyes = _eyes(self._character)

    @cached_property
    def eye_regions(self) -> EyeRegions:
        """Where the character's eyes lie."""
        return regions_of(self._whole)

    def measured_mm(self, luma: NDArray[np.uint8]) -> Array:
        """(frames, eyes) opening in mm in pictures of (frames, height, width) limited-range luma."""
        # Limited range, 16 to 235, to 0-1.
        pictures = (luma[:, *self._pixels].astype(np.float64) - 16) / 219
        return self._opening([[eye.project(picture) for eye in self._eyes] for picture in pictures])

    def promised_mm(self, clip: Clip) -> Array:
        """(frames, eyes) opening in mm that each frame of a clip should measure, from its curves.

        Raises
        ------
        InputError
            The clip's curves do not fit one another or the character.
        """
        curve = _curve_of(clip)
        if curve.lower_vertical_mm is not None and self._character.read_lower is None:
            raise InputError("its lower lid moves, but its character's does not")
        # Most frames of a clip show the open eye: equal pictures are computed once.
        known: dict[bytes, list[float]] = {}
        rows = []
        # Inputs are texts; only an explicit false means sharp frames.
        blur = clip.inputs.get("motion_blur") != "false"
        for samples, weights in frame_windows(len(curve.closure), clip.fps, blur):
            key = same_picture(curve, samples, weights)
            if key not in known:
                known[key] = self._promised(curve, samples, weights)
            rows.append(known[key])
        return self._opening(rows)

    def _promised(self, curve: ClipCurve, samples: NDArray[np.int64], weights: Array) -> list[float]:
        luma = _luma(eye_light(self._character, curve, curve.closure, samples, weights))
        other = luma
        if curve.closure_other is not None:
            other = _luma(eye_light(self._character, curve, curve.closure_other, samples, weights))
        return [eye.project(luma if eye.left_eye else other) for eye in self._eyes]

    def _opening(self, projected: list[list[float]]) -> Array:
        # Turned round, since `interp` needs ascending numbers and the table falls with closure.
        closures = self._character.closures[::-1]
        columns = [
            np.interp(values, eye.table[::-1], closures)
            for eye, values in zip(self._eyes, np.array(projected).T, strict=True)
        ]
        return np.asarray(self._opening_mm * (1 - np.stack(columns, axis=-1)), np.float64)


def _eyes(character: LevelSet) -> list[_Eye]:
    """The halves of the thinned window in which a blink shows, without the seam between them."""
    window = character.window
    from_middle = window.x + np.arange(0, window.width, STEP_PX) + 0.5 - character.size_px[0] / 2
    seam_px = SEAM_MM / 2 * character.px_per_mm
    # The participant sees the character's left eye at the right.
    halves = {False: from_middle < -seam_px, True: from_middle > seam_px}
    levels = [_luma(level.astype(np.float32)) for level in character.levels]
    eyes = []
    for left_eye, half in halves.items():
        where = np.flatnonzero(half)
        columns = slice(int(where[0]), int(where[-1]) + 1) if len(where) else slice(0, 0)
        opened, closed = levels[0][:, columns], levels[-1][:, columns]
        energy = float(np.sum((opened - closed) ** 2))
        # A half in which nothing changes cannot show a blink, as of a character with one eye.
        if energy > 0:
            # Divided by the energy: open gives 1, closed 0.
            template = (opened - closed) / energy
            table = np.array([np.sum((level[:, columns] - closed) * template) for level in levels])
            # Equal steps could not be turned round.
            table = np.minimum.accumulate(table - 1e-9 * np.arange(len(table)))
            eyes.append(_Eye(left_eye, columns, closed, template, table))
    return eyes


def _curve_of(clip: Clip) -> ClipCurve:
    def signal(values: tuple[float, ...]) -> Array | None:
        return np.asarray(values) if values else None

    return ClipCurve(
        closure=np.asarray(clip.closure),
        onset_sample=0,
        profile_id=clip.profile,
        closure_other=signal(clip.closure_other),
        lower_vertical_mm=signal(clip.lower_vertical_mm),
        lower_horizontal_mm=signal(clip.lower_horizontal_mm),
    )


def _luma(light: NDArray[np.floating]) -> Array:
    """Luma in 0-1 of 16-bit linear light (h, w, 3)."""
    # Luma is a sum of gamma-encoded values, as in the video; a sum of light differs.
    code = GAMMA[np.clip(np.round(light), 0, 65535).astype(np.int64)]
    # Weights of BT.709.
    return np.asarray(code @ np.array([0.2126, 0.7152, 0.0722]), np.float64)


TOLERANCE_MM = 0.3
RATE_TOLERANCE = 1e-3


@dataclass(frozen=True)
class Finding:
    """Something wrong with a clip."""

    clip: Clip | CheckClip
    problem: str

    def __str__(self) -> str:
        return f"{self.clip.file[:12]}... ({place_of(self.clip)}): {self.problem}"


@dataclass(frozen=True)
class Verdict:
    """What a check of a folder found.

    `opening_checked` counts the clips whose eyelid opening was measured in the pixels; clips of a
    character that has changed since, or that is not here, cannot be measured. `worst_opening_mm` is the
    largest distance between measured and promised opening. `leaks` has what distinguishes the levels of a
    factor, for every feature of the clips. `is_made_elsewhere` is true for clips that `stimuli manifest` or a
    server took in: they need not be as `stimuli build` makes them, but must play as they are.
    """

    clips: int
    findings: tuple[Finding, ...]
    opening_checked: int
    worst_opening_mm: float
    leaks: tuple[LevelLeak, ...] = ()
    is_made_elsewhere: bool = False


@dataclass(frozen=True, eq=False)
class DecodedClip:
    """What the pictures of a clip show.

    Attributes
    ----------
    opening_mm : (frames, eyes) array
        Empty where no meter was given.
    brightness : tuple of float
        Mean luma of the first and of the last frame, 0 to 255.
    problems : list of str
        What is wrong with number, size and timing of the frames.
    """

    opening_mm: NDArray[np.float64]
    brightness: tuple[float, float]
    problems: list[str]


def verify(folder: Path, beside: Path | None = None, progress: Progress = silent) -> Verdict:
    """Check every clip of a folder's manifest: presence, hash, size, frames, timing, opening in pixels.

    Raises
    ------
    InputError
        There is no manifest that can be read.
    """
    manifest = read_manifest(folder)
    # Levels of a character are loaded once for all its clips of a size.
    clips = sorted(manifest.files, key=lambda clip: (clip.inputs.get("character", ""), clip.width_px))
    meters = _Meters(beside)
    # Uploads were converted by a server: no builder promised their encoding either.
    is_own = manifest.made_elsewhere or manifest.program_version == UPLOADED
    findings: list[Finding] = []
    brightness: dict[str, tuple[float, float]] = {}
    checked, worst = 0, 0.0
    for number, clip in enumerate(clips, start=1):
        problems, error_mm = _check(clip, folder, meters, brightness, is_own=is_own)
        findings += [Finding(clip, problem) for problem in problems]
        if error_mm is not None:
            checked, worst = checked + 1, max(worst, error_mm)
        progress(number, len(clips))
    measured: dict[str, dict[str, Value]] = {
        name: {sha256: round(both[end], 1) for sha256, both in brightness.items()}
        for end, name in enumerate(BRIGHTNESS)
    }
    leaks = level_leaks(manifest.clips, measured)
    return Verdict(len(clips), tuple(findings), checked, worst, leaks, is_own)


def _own_problems(path: Path, clip: Clip | CheckClip) -> Iterator[str]:
    """Whatever `stimuli manifest` would not take as it is: one rule decides there and here."""
    try:
        video = examine(path)
        conversion = conversion_of(video, None)
    except NotAClip as error:
        yield str(error)
        return
    if conversion.changes:
        yield f"browsers cannot play it; it needs a conversion ({'; '.join(conversion.changes)})"
    # Rates such as 30000/1001 have no exact decimal.
    if abs(float(conversion.rate) - clip.fps) > RATE_TOLERANCE * clip.fps:
        yield f"expected {clip.fps:g} frames per second, got {float(conversion.rate):g}"


def _check(
    clip: Clip | CheckClip,
    folder: Path,
    meters: "_Meters",
    brightness: dict[str, tuple[float, float]],
    *,
    is_own: bool,
) -> tuple[list[str], float | None]:
    path = folder / clip.file
    if not path.is_file():
        return [f"missing from {folder}"], None
    if file_sha256(path) != clip.sha256:
        return [f"its bytes differ from the {MANIFEST_NAME} (another sha256)"], None
    try:
        # Checks of motion and clips without a curve promise no opening.
        meter = None if isinstance(clip, CheckClip) or not clip.closure else meters.of(clip)
    except (InputError, ValueError) as error:
        return [f"its inputs in the {MANIFEST_NAME} cannot be read ({error})"], None
    try:
        decoded = _decoded(path, clip, meter, is_own=is_own)
    # A damaged file can fail in the decoder, in the reading or in the shape of a picture.
    except (av.error.FFmpegError, InputError, ValueError) as error:
        return [f"cannot be decoded ({error})"], None
    measured, problems = decoded.opening_mm, decoded.problems
    if isinstance(clip, Clip):
        brightness[clip.sha256] = decoded.brightness
    if problems or meter is None or isinstance(clip, CheckClip):
        return problems, None
    try:
        promised = meter.promised_mm(clip)
    except InputError as error:
        return [str(error)], None
    if len(promised) != len(measured):
        return [f"its curve is {len(promised)} frames long, the clip {len(measured)}"], None
    # The worse eye of each frame.
    off = np.abs(measured - promised).max(axis=1)
    worst = float(off.max())
    if worst > TOLERANCE_MM:
        problems.append(
            f"frame {int(off.argmax())}: the opening of an eye differs from the curve by {worst:.2f} mm"
        )
    return problems, worst


def _decoded(path: Path, clip: Clip | CheckClip, meter: OpeningMeter | None, *, is_own: bool) -> DecodedClip:
    """Decode a clip frame by frame."""
    measured: list[NDArray[np.float64]] = []
    steady = _steadier(clip, meter)
    times: list[Fraction | None] = []
    ends: list[Any] = []
    with av.open(str(path)) as container:
        stream: Any = container.streams.video[0]
        fits = (stream.width, stream.height) == (clip.width_px, clip.height_px)
        for frame in container.decode(stream):
            times.append(None if frame.pts is None else frame.pts * frame.time_base)
            # Only the first and the last picture: all of a clip would fill the memory.
            ends = [*ends[:1], frame]
            if meter is not None and fits:
                # The first rows of yuv420p are luma; the two chroma planes follow below.
                luma = frame.to_ndarray(format="yuv420p")[: frame.height]
                measured.append(meter.measured_mm(steady(luma, len(measured))[None])[0])
        problems = list(_shape_problems(stream, times, clip))
        if not is_own:
            problems += _timing_problems(stream, times, clip)
    # The slower examination only where nothing is wrong so far.
    if is_own and not problems:
        problems = list(_own_problems(path, clip))
    if not times:
        raise InputError("no frame")
    first, last = (
        float(frame.to_ndarray(format="yuv420p")[: frame.height].mean()) for frame in (ends[0], ends[-1])
    )
    return DecodedClip(np.array(measured), (first, last), problems)


def _steadier(
    clip: Clip | CheckClip, meter: OpeningMeter | None
) -> Callable[[NDArray[np.uint8], int], NDArray[np.uint8]]:
    """Undoes a frame's motion between blinks, so that the eyes are where the meter looks for them."""
    strength = float(clip.inputs.get("life", 0))
    if not strength or meter is None or not isinstance(clip, Clip):
        return lambda luma, _: luma
    life = draw_life(len(clip.closure), strength, int(clip.inputs["life_seed"]))
    regions = meter.eye_regions
    windows = list(frame_windows(len(life), clip.fps, clip.inputs.get("motion_blur") != "false"))

    def steady(luma: NDArray[np.uint8], number: int) -> NDArray[np.uint8]:
        if number >= len(windows):  # a clip longer than its curve, which is reported by its length
            return luma
        moved = regions.moved_from(life, *windows[number])
        still = regions.warped(luma.astype(np.float32), moved, sign=-1)
        return np.asarray(np.clip(np.rint(still), 0, 255), np.uint8)

    return steady


def _shape_problems(stream: Any, times: list[Fraction | None], clip: Clip | CheckClip) -> Iterator[str]:
    if len(times) != clip.frames:
        yield f"expected {clip.frames} frames, got {len(times)}"
    if (stream.width, stream.height) != (clip.width_px, clip.height_px):
        yield f"expected {clip.width_px} x {clip.height_px} px, got {stream.width} x {stream.height}"


def _timing_problems(stream: Any, times: list[Fraction | None], clip: Clip | CheckClip) -> Iterator[str]:
    # 30000/1001 and its kin are exact fractions, but decimals in the manifest.
    due = 1 / Fraction(clip.fps).limit_denominator(1001)
    if any(at is None or abs(at - k * due) > due / 100 for k, at in enumerate(times)):
        yield f"its frames are not spaced evenly at {clip.fps:g} fps"
    if stream.codec_context.has_b_frames:
        yield "it has B-frames"


class _Meters:
    """One opening meter at a time: clips come sorted by character and size."""

    def __init__(self, beside: Path | None) -> None:
        self._beside, self._folder = beside, beside or Path()
        self._key: tuple[str, str, int, int, Movement] | None = None
        self._meter: OpeningMeter | None = None

    def of(self, clip: Clip) -> OpeningMeter | None:
        """The meter of a clip's character; None where it is not here or looks different now."""
        name, sha256 = clip.inputs.get("character", ""), clip.inputs.get("character_sha256", "")
        movement = Movement.of_inputs(clip.inputs)
        key = (name, sha256, clip.width_px, clip.height_px, movement)
        if key != self._key:
            self._key, self._meter = key, self._made(name, sha256, (clip.width_px, clip.height_px), movement)
        return self._meter

    def _made(
        self, name: str, sha256: str, size_px: tuple[int, int], movement: Movement
    ) -> OpeningMeter | None:
        folder_name = name if name in shipped_names() or (self._folder / name).is_dir() else None
        # If the character was baked again, its levels say nothing about this clip.
        if not folder_name or fingerprint(folder_name, self._beside) != sha256:
            return None
        return OpeningMeter(
            kept_levels(folder_name, sha256, size_px, self._beside, movement),
            geometry(folder_name, self._beside).opening_mm,
        )
