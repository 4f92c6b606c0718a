"""Dips of a lid series that may be events, and the features by which they are classified."""

from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import percentile_filter
from scipy.signal import find_peaks

from stimuli_builder.blinks.profile import OPEN_PERCENTILE, Array
from stimuli_builder.blinks.series import box_filter

Kind = Literal["blink", "squint", "gaze_shift", "closed_eye"]
KINDS: tuple[Kind, ...] = ("blink", "squint", "gaze_shift", "closed_eye")
CLASSES = (*KINDS, "nothing")
"""What a dip of a series may be."""
CLOSED_EYE_S = 0.5
"""A closed phase of half a second or more is a closed eye, not a blink."""

# The course of the lid about a dip, as means over spans of time that grow away from its deepest frame.

SPANS_S = (0.0, 0.025, 0.06, 0.1, 0.15, 0.2, 0.27, 0.35, 0.45, 0.6, 0.8, 1.1, 1.5, 2.1)
"""Ends of the spans on either side of the deepest frame: as fine as a blink moves, then coarser."""
EDGES_S = np.concatenate([-np.array(SPANS_S[:0:-1]), SPANS_S])
COURSE = tuple(f"from {a:g} to {b:g} s" for a, b in pairwise(EDGES_S))


def courses(values: Array, peaks: NDArray[np.int64], fps: float) -> Array:
    """Mean of a series (n,) over each span about each peak (p,): (p, spans); see `span_means`."""
    return span_means(values, peaks.astype(np.float64), EDGES_S * fps)


def span_means(values: Array, centres: Array, edges: Array) -> Array:
    """Mean of a series (n,) between edges (s + 1,) about each center (p,), both in frames: (p, s).

    Samples are joined by straight lines, so that a span shorter than a frame has a mean too and the same
    lid gives the same means at every rate. Beyond its ends the series keeps its last value.
    """
    reach = int(np.ceil(np.abs(edges).max())) + 2
    long = np.pad(values, reach, mode="edge")
    # The integral of straight lines between samples: a span's mean is a difference of two of its values.
    areas = np.concatenate([[0.0], np.cumsum((long[1:] + long[:-1]) / 2)])
    places = np.clip(centres, 0, values.size - 1)[:, None] + reach + edges
    left = np.floor(places).astype(np.int64)
    part = places - left
    area = areas[left] + long[left] * part + (long[left + 1] - long[left]) * part**2 / 2
    return np.asarray(np.diff(area, axis=1) / np.diff(edges))


# Depth of a lid series: how far the eye is closed, as part of how far it is open about then.

OPEN_REACH_S = 5.0
LEAST_OPEN = 0.6
"""The local opening is at least this part of the recording's: else a long closed eye would count as open."""
SMOOTHING_S = 0.033
NOISE_FLOOR = 0.004


@dataclass(frozen=True, eq=False)
class Depth:
    """A gapless piece of a series as depth r = 1 - d / opening.

    Parameters
    ----------
    raw, smooth : (n,) arrays
        Depth as measured and after a zero-phase average over 33 ms; 0 open.
    opening : (n,) array
        Opening taken as r = 0, in the unit of the series.
    noise : float
        Standard deviation of `raw` from frame to frame, as depth.
    fps : float
    """

    raw: Array
    smooth: Array
    opening: Array
    noise: float
    fps: float


def depth_of(distance: Array, fps: float) -> Depth:
    """Return the depth of a gapless series (n,), its opening following a head that comes nearer."""
    opening = local_opening(distance, fps)
    raw = 1 - distance / opening
    smooth = box_filter(raw, max(1.0, SMOOTHING_S * fps))
    return Depth(raw, smooth, opening, frame_noise(raw), fps)


def local_opening(distance: Array, fps: float) -> Array:
    """Opening about each frame: the 85th percentile within 5 s, not below 0.6 of the recording's."""
    stride = max(1, int(fps / 10))
    # Ten values a second are enough for a percentile over ten seconds, whose cost grows with the square
    # of their number.
    coarse = distance[::stride]
    reach = max(1, round(OPEN_REACH_S * fps / stride))
    level = percentile_filter(coarse, OPEN_PERCENTILE, size=2 * reach + 1, mode="nearest")
    whole = float(np.percentile(coarse, OPEN_PERCENTILE))
    level = np.maximum(level, LEAST_OPEN * whole)
    frames = np.arange(coarse.size) * stride
    return np.maximum(np.interp(np.arange(distance.size), frames, level), 1e-9)


def frame_noise(raw: Array) -> float:
    """Noise of one frame from second differences, which lids moving smoothly hardly touch."""
    if raw.size < 4:
        return NOISE_FLOOR
    # White noise of variance s^2 has second differences of variance (1 + 4 + 1) s^2: hence the root of 6
    # below.
    second = np.diff(raw, 2)
    spread = float(np.median(np.abs(second - np.median(second))))
    return max(NOISE_FLOOR, 1.4826 * spread / 6**0.5)


LEAST_PROMINENCE = 0.06
NOISES = 2.5
RIPPLE = 0.25
"""A dip that rises by less than this part of its height above the open eye is a ripple of a larger one."""
REACH_S = 8.0
SHALLOWEST = 0.05
"""Courses are divided by a dip's depth, or by this where it is less."""
FEATURES = (
    "log depth", "depth to the recording's deep", "prominence to depth", "prominence to deep",
    "log width at half", "log width at 0.85", "log width at 0.2", "log closing time", "log opening time",
    "log prominence to noise", "step of the base", "base before", "share of like depth about",
    "roughness about", "log frames in width", "other eye", "has other eye", "log fps",
    *(f"depth {span}" for span in COURSE), *(f"other eye {span}" for span in COURSE),
)  # fmt: skip


@dataclass(frozen=True)
class Candidate:
    """One dip: its deepest frame and where it crosses parts of its prominence (frames, fractions of one).

    `left` and `right` hold the crossings at 0.2, 0.5 and 0.85 of the prominence, outwards from the peak.
    """

    peak: int
    depth: float
    prominence: float
    left: tuple[float, float, float]
    right: tuple[float, float, float]


LEVELS = (0.2, 0.5, 0.85)


def find_candidates(depth: Depth) -> list[Candidate]:
    """Every dip that rises clearly above noise and is not a ripple of a larger one, in order of time."""
    least = max(LEAST_PROMINENCE, NOISES * depth.noise)
    # A dip cut off by the edge of a piece has a prominence as well.
    padded = np.concatenate([[depth.smooth.min()], depth.smooth, [depth.smooth.min()]])
    wide = 2 * int(REACH_S * depth.fps) + 1
    peaks, facts = find_peaks(padded, prominence=least, wlen=wide)
    candidates = []
    for peak, prominence in zip(peaks - 1, facts["prominences"], strict=True):
        height = float(depth.smooth[peak])
        if prominence >= RIPPLE * height:
            candidates.append(candidate_at(depth, int(peak), float(prominence)))
    return candidates


def candidate_at(depth: Depth, peak: int, prominence: float) -> Candidate:
    """The dip whose deepest frame is `peak`, as it rises by `prominence` (a depth) above its surroundings."""
    height = float(depth.smooth[peak])
    levels = [height - prominence + part * prominence for part in LEVELS]
    left, right = ([level_crossing(depth, peak, level, step) for level in levels] for step in (-1, 1))
    return Candidate(peak, height, prominence, (left[0], left[1], left[2]), (right[0], right[1], right[2]))


def level_crossing(depth: Depth, peak: int, level: float, step: int) -> float:
    """Where the depth first falls below a level on one side of the peak, between frames."""
    reach = int(REACH_S * depth.fps) + 1
    first = max(0, peak - reach)
    side = depth.smooth[first : peak + 1][::-1] if step < 0 else depth.smooth[peak : peak + reach]
    below = np.flatnonzero(side < level)
    if not below.size:
        # The depth never falls so low: the crossing is put at the end of what was searched.
        return float(peak + step * (side.size - 1))
    frame = int(below[0])
    rise = side[frame - 1] - side[frame]
    part = (side[frame - 1] - level) / rise if rise > 0 else 0.0
    return peak + step * (frame - 1 + float(part))


def deep_level(candidates: list[Candidate], depth: Depth) -> float:
    """How deep this recording's blinks go: the upper quintile of its dips as short as blinks are."""
    # Longer dips are closed eyes or squints, shallower ones partial blinks: neither shows how deep a blink
    # goes.
    short = [
        c.depth for c in candidates if 0.03 <= (c.right[1] - c.left[1]) / depth.fps <= 0.5 and c.depth >= 0.15
    ]
    if len(short) >= 2:
        return float(np.percentile(short, 80))
    return max(0.3, float(np.percentile(depth.smooth, 99.5)))


def features_of(candidates: list[Candidate], depth: Depth, other: Array | None = None) -> NDArray[np.float64]:
    """One row of `FEATURES` for each candidate.

    Parameters
    ----------
    other : (n,) array, optional
        Smoothed depth of the other eye, divided by its own deep level; NaN where unknown.
    """
    if not candidates:
        return np.empty((0, len(FEATURES)))
    deep = deep_level(candidates, depth)
    rows = np.array([_row(c, depth, deep, other) for c in candidates], np.float64)
    return np.concatenate([rows, _courses(candidates, depth, deep, other)], axis=1)


def _courses(candidates: list[Candidate], depth: Depth, deep: float, other: Array | None) -> Array:
    """Course of this eye and of the other about each dip, as parts of the dip's own depth.

    In a gap of the other eye it is taken to do what this one does; without another eye its course is 0.
    """
    peaks = np.array([c.peak for c in candidates])
    heights = np.array([max(c.depth, SHALLOWEST) for c in candidates])[:, None]
    own = courses(depth.smooth, peaks, depth.fps) / heights
    if other is None:
        return np.concatenate([np.clip(own, -2, 2), np.zeros_like(own)], axis=1)
    # Of the same depth as this eye's own blinks: the features compare the two eyes, whatever the size of
    # either.
    beside = np.where(np.isfinite(other), other * deep, depth.smooth)
    across = courses(beside, peaks, depth.fps) / heights
    return np.concatenate([np.clip(own, -2, 2), np.clip(across, -2, 2.5)], axis=1)


def _row(c: Candidate, depth: Depth, deep: float, other: Array | None) -> list[float]:
    fps, smooth = depth.fps, depth.smooth
    # Logarithms need a positive length, and no crossing is known to better than a third of a frame.
    least = 0.3 / fps
    wide, half, narrow = ((right - left) / fps for left, right in zip(c.left, c.right, strict=True))
    closing = (c.left[2] - c.left[0]) / fps
    opening = (c.right[0] - c.right[2]) / fps
    before, after = _base(smooth, c.left[0], -1, fps), _base(smooth, c.right[0], 1, fps)
    like, rough = _surroundings(c, depth)
    beside, has_other = _other_eye_depths(c, other, deep)
    return [
        np.log(max(c.depth, 0.02)), min(c.depth / deep, 3.0), c.prominence / max(c.depth, 0.02),
        min(c.prominence / deep, 3.0), np.log(max(half, least)), np.log(max(narrow, least)),
        np.log(max(wide, least)), np.log(max(closing, least)), np.log(max(opening, least)),
        np.log(c.prominence / depth.noise), np.clip((before - after) / c.prominence, -3, 3),
        np.clip(before / max(c.depth, 0.02), -1, 1), like, min(rough / c.prominence, 1.0),
        np.log(max(half * fps, 0.3)), beside, has_other, np.log(fps),
    ]  # fmt: skip


def _base(smooth: Array, edge: float, step: int, fps: float) -> float:
    """Median depth of the 0.4 s beyond an edge."""
    near, far = edge + step * 0.03 * fps, edge + step * 0.43 * fps
    first, last = sorted((round(near), round(far)))
    part = smooth[max(0, first) : max(0, last + 1)]
    return float(np.median(part)) if part.size else float(smooth[0 if step < 0 else -1])


def _surroundings(c: Candidate, depth: Depth) -> tuple[float, float]:
    """Share of the 3 s on either side as deep as half the candidate, and the roughness of 1 s on either."""
    fps, smooth = depth.fps, depth.smooth
    start, stop = int(c.left[0] - 0.05 * fps), int(c.right[0] + 0.05 * fps) + 1
    reach = int(3 * fps)
    about = np.concatenate([smooth[max(0, start - reach) : max(0, start)], smooth[stop : stop + reach]])
    like = float((about > 0.5 * c.depth).mean()) if about.size else 0.0
    reach = int(fps)
    near = np.concatenate([smooth[max(0, start - reach) : max(0, start)], smooth[stop : stop + reach]])
    rough = float(np.median(np.abs(near - np.median(near)))) if near.size else 0.0
    return like, rough


def _other_eye_depths(c: Candidate, other: Array | None, deep: float) -> tuple[float, float]:
    if other is None:
        return 0.0, 0.0
    # One frame either way, as both eyes need not be lowest in the same one.
    part = other[max(0, c.peak - 1) : c.peak + 2]
    if not np.isfinite(part).any():
        return 0.0, 0.0
    return float(np.clip(np.nanmax(part) / max(c.depth / deep, 0.05), -0.5, 2.0)), 1.0
