"""Levels of a recorded character: recorded frames, pictures between them, and openings by the tracker."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import isotonic_regression

from stimuli_builder.characters.atlas import write_level_video
from stimuli_builder.characters.declaration import (
    Declaration,
    Level,
    PictureOrFrame,
    write_declaration,
    write_picture,
)
from stimuli_builder.characters.recording import (
    LUMA,
    Image,
    StillFrames,
    Values,
    decibels,
    gray_codes,
)
from stimuli_builder.tracking.mesh import reduce_picture
from stimuli_builder.tracking.model import CoupledModel, with_residual_limits
from stimuli_builder.tracking.shapes import CANTHI, EYE_POINTS, Points, eye_axis
from stimuli_builder.tracking.tracker import Tracker
from stimuli_builder.video import Picture

# A picture between two: the content of both moves along the optical flow, and meets.

Flow = NDArray[np.float32]
INVERSION_ROUNDS = 5


def optical_flow(one: Picture, other: Picture) -> Flow:
    """Where each pixel of a gray picture is found in another, relative to itself."""
    engine = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
    # Lashes are one or two pixels wide: the finest scale counts.
    engine.setFinestScale(0)
    engine.setVariationalRefinementIterations(5)
    return np.asarray(engine.calc(one, other, None), np.float32)


class FramePair:
    """Two frames of an opening, and pictures between them.

    With F the flow from `first` to `second`, a pixel x of the picture at share t shows what `first` has at
    x + u, where u = -t F(x + u) is solved by repeated substitution: where lids move by many pixels the flow
    at x itself belongs to other skin, and lashes would double. The same goes for `second` with 1 - t.
    """

    def __init__(self, first: Image, second: Image) -> None:
        self._first, self._second = first, second

    @cached_property
    def _flows(self) -> tuple[Flow, Flow]:
        one, other = (gray_codes(picture) for picture in (self._first, self._second))
        return optical_flow(one, other), optical_flow(other, one)

    def between(self, share: float) -> Image:
        """The picture at a share of the way, float32 (h, w, 3)."""
        if share <= 0 or share >= 1:
            return self._second if share >= 1 else self._first
        onward, back = self._flows
        from_first = _moved(self._first, _taken_from(onward, share))
        from_second = _moved(self._second, _taken_from(back, 1 - share))
        return np.asarray((1 - np.float32(share)) * from_first + np.float32(share) * from_second, np.float32)


def _taken_from(flow: Flow, share: float) -> Flow:
    """Where each pixel at a share of the way takes its content from, relative to itself."""
    away = -np.float32(share) * flow
    for _ in range(INVERSION_ROUNDS):
        away = -np.float32(share) * _sampled(flow, away, cv2.INTER_LINEAR)
    return away


def _moved(picture: Image, away: Flow) -> Image:
    return _sampled(picture, away, cv2.INTER_CUBIC)


def _sampled(picture: NDArray[np.float32], away: Flow, how: int) -> NDArray[np.float32]:
    height, width = picture.shape[:2]
    y, x = np.mgrid[0:height, 0:width].astype(np.float32)
    return np.asarray(
        cv2.remap(picture, x + away[..., 0], y + away[..., 1], how, borderMode=cv2.BORDER_REPLICATE),
        np.float32,
    )


# What a blink may change: a crop about the eyes, whose rim is that of the open frame.

AROUND, ABOVE, BELOW = 1.0, 0.9, 0.6
"""How far a blink moves skin from the middle of an eye, in eye widths: lashes and the fold reach that far."""
RIM = 0.03


def moving_crop(points: Points, size_px: tuple[int, int]) -> tuple[int, int, int, int]:
    """(x, y, width, height) of the eyes and their lids within the frame, with even sides."""
    corners = []
    for eye in points.reshape(-1, EYE_POINTS, 2):
        along, down, width = eye_axis(eye)
        middle = (eye[CANTHI[0]] + eye[CANTHI[1]]) / 2
        corners += [
            middle + width * (x * along + y * down) for x in (-AROUND, AROUND) for y in (-ABOVE, BELOW)
        ]
    low = np.clip(np.floor(np.min(corners, 0) / 2) * 2, 0, size_px).astype(int)
    high = np.clip(np.ceil(np.max(corners, 0) / 2) * 2, 0, size_px).astype(int)
    return int(low[0]), int(low[1]), int(high[0] - low[0]), int(high[1] - low[1])


def rim_weight(crop: tuple[int, int, int, int]) -> NDArray[np.float32]:
    """(h, w, 1) share of a level: 1 inside the crop, falling to 0 at its rim."""
    _, _, width, height = crop
    rim = max(4.0, RIM * width)
    across = np.minimum(np.arange(width), np.arange(width)[::-1]) / rim
    down = np.minimum(np.arange(height), np.arange(height)[::-1]) / rim
    edge = np.clip(np.minimum(down[:, None], across[None]), 0, 1).astype(np.float32)
    # A cubic, which has no kink at either end of the rim.
    return (edge * edge * (3 - 2 * edge))[..., None]


# Levels from open to shut.

MIN_LEVELS, MAX_LEVELS = 33, 129
STEP_PX = 0.8
"""Lid margins move about so far from level to level; wider steps would show lashes twice in a blend."""


@dataclass(frozen=True, eq=False)
class BuiltLevel:
    """One level: a recorded frame, or a picture between two recorded frames.

    Attributes
    ----------
    crop : uint8 array (h, w, 3)
    track_closure : float
        Closure by the recording's track.
    first, second : int
        Indices of the recorded frames; equal for a recorded one.
    """

    crop: NDArray[np.uint8]
    track_closure: float
    first: int
    second: int


def build_levels(
    frames: StillFrames, crop: tuple[int, int, int, int], advance: Callable[[], None]
) -> list[BuiltLevel]:
    """Every recorded frame as a level, and as many between as lids that move in small steps take."""
    x, y, width, height = crop
    base = frames.pictures[0][y : y + height, x : x + width]
    rim = rim_weight(crop)
    opening_px = float(np.linalg.norm(frames.points[0, 7] - (frames.points[0, 2] + frames.points[0, 3]) / 2))
    steps = int(np.clip(np.ceil(opening_px / STEP_PX), MIN_LEVELS - 1, MAX_LEVELS - 1))
    levels = []
    for k in range(len(frames.pictures)):
        shares = [0.0]
        if k + 1 < len(frames.pictures):
            gap = frames.closures[k + 1] - frames.closures[k]
            parts = max(1, round(gap * steps))
            shares = [part / parts for part in range(parts)]
            pair = FramePair(*(one[y : y + height, x : x + width] for one in frames.pictures[k : k + 2]))
        for share in shares:
            picture = pair.between(share) if share else frames.pictures[k][y : y + height, x : x + width]
            code = np.clip(np.rint(base + rim * (picture - base)), 0, 255).astype(np.uint8)
            track_closure = float(frames.closures[k] + (share * gap if share else 0.0))
            levels.append(BuiltLevel(code, track_closure, k, k + (share > 0)))
        advance()
    return levels


def left_out_db(frames: StillFrames, crop: tuple[int, int, int, int], advance: Callable[[], None]) -> Values:
    """Each recorded frame against the one built from its two neighbors, over the crop; NaN at both ends."""
    values = np.full(len(frames.pictures), np.nan)
    for k in range(1, len(values) - 1):
        rebuilt, recorded = rebuilt_frame(frames, k, crop)
        values[k] = decibels(float(((rebuilt - recorded) ** 2).mean()))
        advance()
    return values


GOOD_DB = 38.0
NEAR = 0.03
"""Where recorded frames lie so near on both sides, a left-out frame must come back with `GOOD_DB`."""
MAX_DROPPED = 0.25


def without_strangers(
    frames: StillFrames, crop: tuple[int, int, int, int], advance: Callable[[], None]
) -> tuple[StillFrames, Values, int]:
    """Drop frames that do not fit between near neighbors: the eye or the light had moved, not the lid alone.

    Returns
    -------
    The frames that are left, their `left_out_db`, and how many were dropped, at most a quarter.
    """
    values = left_out_db(frames, crop, advance)
    dropped = 0
    while dropped < MAX_DROPPED * len(frames.numbers):
        odd = np.flatnonzero(near_both_sides(frames.closures) & (values < GOOD_DB))
        if not len(odd):
            break
        worst = int(odd[np.argmin(values[odd])])
        frames = frames.without(worst)
        values = np.delete(values, worst)
        # Only the two neighbors of the gap are rebuilt from other frames now.
        for k in (worst - 1, worst):
            if 0 < k < len(values) - 1:
                rebuilt, recorded = rebuilt_frame(frames, k, crop)
                values[k] = decibels(float(((rebuilt - recorded) ** 2).mean()))
        dropped += 1
    return frames, values, dropped


def near_both_sides(closures: Values) -> NDArray[np.bool_]:
    """Which frames have recorded neighbors within `NEAR` on both sides."""
    near = np.diff(closures) <= NEAR
    return np.concatenate([[False], near[:-1] & near[1:], [False]])


def rebuilt_frame(frames: StillFrames, k: int, crop: tuple[int, int, int, int]) -> tuple[Image, Image]:
    """A recorded frame built from its neighbors as if it were not there, and the frame, both (h, w, 3)."""
    x, y, width, height = crop
    before, recorded, after = (one[y : y + height, x : x + width] for one in frames.pictures[k - 1 : k + 2])
    low, closure, high = frames.closures[k - 1 : k + 2]
    return FramePair(before, after).between(float((closure - low) / (high - low))), recorded


# The opening of every level, measured by the tracker; without labels, see `recording_lids`.

STRICT = 0.02
"""Share of a closure that comes from its track, so that no two levels have the same."""
TOLERANCE_MM = 0.2


@dataclass(frozen=True)
class MeasuredLevels:
    """Closures of levels, and what is measured of them.

    Attributes
    ----------
    closures : float64 array (n,)
        Declared: ascending from 0 to 1. A recorded frame has the mean of two measurements, in the recording
        and in the level; a picture between has the one at which recorded frames are measured like it.
    off_mm : float64 array (n,)
        Opening by the declared closure minus opening as the tracker measures it in the level, NaN where it
        finds no eyes; or the error of an opening by motion.
    opening_px : float
        Of the open eye, minus what is measured of the shut one, in pixels of the video.
    """

    closures: Values
    off_mm: Values
    opening_px: float

    @property
    def worst_mm(self) -> float:
        """The largest difference; NaN where nothing was measured."""
        return float(np.nanmax(np.abs(self.off_mm))) if np.isfinite(self.off_mm).any() else float("nan")


def tracked_openings(
    model: CoupledModel,
    frames: StillFrames,
    levels: Sequence[BuiltLevel],
    crop: tuple[int, int, int, int],
    whole: Picture,
    advance: Callable[[], None],
) -> Values:
    """Track the eyes in every level, shown within the open frame of the video: pixels of the video.

    Parameters
    ----------
    whole : uint8 array (height, width)
        Luma of the open frame of the video.
    """
    # Made of this very recording, a level cannot show covered or other eyes, which the limits are for.
    tracker = Tracker(with_residual_limits(model, np.full(model.eyes, np.inf)))
    tones = _luma_of_gray(frames, whole)
    openings = []
    for level in levels:
        shown = _in_video(level, frames, crop, whole, *tones)
        fitted = tracker.step(reduce_picture(shown, model.reduction))
        openings.append(np.nan if fitted.distances is None else float(fitted.distances.mean()))
        advance()
    return np.array(openings)


def measure_levels(levels: Sequence[BuiltLevel], seen: Values, video_px_per_mm: float) -> MeasuredLevels:
    """Give every level its closure.

    Parameters
    ----------
    seen : float64 array (n,)
        Measured openings in pixels of the video; NaN where unknown.
    """
    places = np.array([level.track_closure for level in levels])
    recorded = np.array([level.first == level.second for level in levels]) & np.isfinite(seen)
    # Without an open and a shut frame that were measured there is no scale.
    if not (recorded[0] and recorded[-1]):
        return MeasuredLevels(places, np.full(len(levels), np.nan), float("nan"))
    opening_px = float(seen[0] - seen[-1])
    measured = (seen[0] - seen) / opening_px
    closures = _placed(places, measured, recorded)
    return MeasuredLevels(closures, (measured - closures) * opening_px / video_px_per_mm, opening_px)


def _placed(places: Values, measured: Values, recorded: NDArray[np.bool_]) -> Values:
    """Declared closures; see `MeasuredLevels`."""
    known = np.isfinite(measured)
    declared = places.copy()
    declared[known] = (places[known] + measured[known]) / 2
    # What recorded frames measure, a picture between them that measures the same is declared as.
    curve = isotonic_regression(measured[recorded]).x
    curve = (1 - STRICT) * curve + STRICT * places[recorded]
    between = known & ~recorded
    declared[between] = np.interp(measured[between], curve, declared[recorded])
    closures = (1 - STRICT) * isotonic_regression(declared).x + STRICT * places
    closures = np.clip(closures, 0.0, 1.0)
    closures[0], closures[-1] = 0.0, 1.0
    return np.asarray(np.round(closures, 5))


def _luma_of_gray(frames: StillFrames, whole: Picture) -> tuple[float, float]:
    """Slope and offset from gray code values to the video's luma, which may have 16 for black."""
    region = frames.region
    luma = region.cut(whole)[..., 0]
    slope, offset = np.polyfit((frames.pictures[0] @ LUMA).ravel(), luma.ravel(), 1)
    return float(slope), float(offset)


def _in_video(
    level: BuiltLevel,
    frames: StillFrames,
    crop: tuple[int, int, int, int],
    whole: Picture,
    slope: float,
    offset: float,
) -> Picture:
    """A level as the video would show it, gray."""
    region, (x, y, width, height) = frames.region, crop
    part = np.clip(frames.pictures[0], 0, 255).astype(np.uint8)
    part[y : y + height, x : x + width] = level.crop
    gray = part.astype(np.float32) @ LUMA
    if region.scale != 1:
        gray = cv2.resize(gray, (region.width, region.height), interpolation=cv2.INTER_CUBIC)
    rows, columns = slice(region.y, region.y + region.height), slice(region.x, region.x + region.width)
    shown = whole.copy()
    shown[rows, columns] = np.clip(np.rint(slope * gray + offset), 0, 255)
    return shown


def write_recorded_character(
    folder: Path,
    label: str,
    frames: StillFrames,
    levels: Sequence[BuiltLevel],
    measured: MeasuredLevels,
    crop: tuple[int, int, int, int],
    scale: tuple[float, float, float],
    provenance: dict[str, object],
) -> Declaration:
    """Write the character's folder; its declaration comes last.

    Parameters
    ----------
    scale : (float, float, float)
        Pixels of the character per mm, distance between the eyes in mm, and opening in mm.
    """
    open_picture = np.clip(np.rint(frames.pictures[0]), 0, 255).astype(np.uint8)
    base = write_picture(folder, "open.webp", open_picture)
    # Closures must rise: of levels that have the same one after rounding, the first is kept.
    kept = [k for k in range(len(levels)) if k == 0 or measured.closures[k] > measured.closures[:k].max()]
    video = write_level_video(folder, "levels.mkv", [levels[k].crop for k in kept])
    declaration = Declaration(
        name=folder.name,
        label=label,
        size_px=frames.region.size_px,
        px_per_mm=round(scale[0], 4),
        inter_ocular_mm=round(scale[1], 2),
        opening_mm=round(scale[2], 3),
        crop=crop,
        base=PictureOrFrame(**base.model_dump()),
        levels=tuple(
            Level(closure=float(measured.closures[k]), frame=number, **video.model_dump())
            for number, k in enumerate(kept)
        ),
        provenance=provenance,
    )
    write_declaration(folder, declaration)
    return declaration
