"""Openings of a recorded character without labels: the margins of its lids, followed and seen.

A detector draws the lids of shut and of wide eyes in the wrong place, by up to a fifth of the opening. Two
other instruments replace it. The motion of the skin between two pictures gives the travel of the upper lid,
with an error that grows on the way. The edge between skin and eye, seen below it, gives the place of its
margin, with an error that lashes cause. The mean of both is nearer to the truth than either.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from experiments.errors import InputError
from stimuli_builder.characters.recording import (
    StillFrames,
    Values,
    distinct_frames,
    gray_codes,
    widened_iris,
)
from stimuli_builder.characters.recording_levels import BuiltLevel, Flow, MeasuredLevels, optical_flow
from stimuli_builder.tracking.shapes import CANTHI, EYE_POINTS, Points, eye_axis
from stimuli_builder.video import Picture

# The motion of the skin at the margin of the upper lid.

LID_ROWS = np.linspace(-0.25, 0.15, 81)
"""Rows of points over both lids of the shut eye, from the middle of its detected lids, in eye widths."""
LID_COLUMNS = np.linspace(-0.1, 0.1, 21)
MARGIN_ROWS = 5
MARGIN_SHARE = 0.97
"""The skin moves nearly as far as the margin over this many rows above it; below lie lashes and the eye."""
NOT_FOLLOWED = "the motion of the lids cannot be followed in the blink; label frames by hand"


class LidMotion:
    """Rows of points followed through aligned gray pictures, from picture to picture."""

    def __init__(self, pictures: Sequence[Picture]) -> None:
        self._pictures = pictures
        self._flows: dict[tuple[int, int], Flow] = {}

    def places(self, start: int, grid: Points | Flow) -> NDArray[np.float32]:
        """Where a grid (rows, columns, 2) on picture `start` is in each: (pictures, rows, columns, 2)."""
        places = {start: np.asarray(grid, np.float32)}
        for step, stop in ((-1, -1), (1, len(self._pictures))):
            for number in range(start + step, stop, step):
                before = places[number - step]
                flow = self._flow(number - step, number)
                x, y = np.moveaxis(before, -1, 0)
                places[number] = before + cv2.remap(
                    flow, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
                )
        return np.array([places[number] for number in range(len(self._pictures))])

    def _flow(self, one: int, other: int) -> Flow:
        if (one, other) not in self._flows:
            self._flows[one, other] = optical_flow(self._pictures[one], self._pictures[other])
        return self._flows[one, other]


@dataclass(frozen=True, eq=False)
class LidTravel:
    """How far an upper lid is above its lowest place, in pixels.

    Attributes
    ----------
    upper : float64 array (pictures,)
    drift : float64 array (pictures,)
        Followed from shut to open and back: how far it is from its place on the way there.
    """

    upper: Values
    drift: Values


def lid_travel(pictures: Sequence[Picture], eye: Points, shut_eye: Points, start: int) -> LidTravel:
    """Follow the skin at the margin of an upper lid.

    Parameters
    ----------
    pictures : sequence of uint8 array (h, w)
        Aligned, gray; the first is the open one.
    eye, shut_eye : float64 array (9, 2)
        Detected points in the first picture, and in picture `start`, whose eyes are nearly shut.

    Raises
    ------
    InputError
        No upper lid rises.
    """
    along, down, width = eye_axis(eye)
    middle = eye[list(CANTHI)].mean(0)
    last = np.array(pictures[0].shape[1::-1])
    left, top = np.clip((middle - 0.8 * width).astype(int), 0, last)
    right, bottom = np.clip((middle + 0.8 * width).astype(int), 0, last)
    motion = LidMotion([np.ascontiguousarray(picture[top:bottom, left:right]) for picture in pictures])
    center = (shut_eye[[2, 3]].mean(0) + shut_eye[7]) / 2 - [left, top]
    deepest = start
    # The second time from the picture in which the lid is lowest, about where it meets the other.
    for _ in range(2):
        grid = center + width * (LID_ROWS[:, None, None] * down + LID_COLUMNS[:, None] * along)
        places = motion.places(deepest, grid)
        moved = np.median((places - grid) @ down, axis=2)
        highest = int(np.argmin(moved[0]))
        if not moved[0, highest] < 0:
            raise InputError(NOT_FOLLOWED)
        meets = highest + int(np.argmax(moved[0, highest:] > 0.5 * moved[0, highest]))
        last_row = int(np.flatnonzero(moved[0] <= MARGIN_SHARE * moved[0, highest])[-1])
        margin = slice(max(highest, last_row - MARGIN_ROWS + 1), last_row + 1)
        rows = moved[:, margin].mean(1)
        deepest = int(np.argmax(rows))
        center = center + (LID_ROWS[meets] * width + moved[deepest, meets]) * down
    back = motion.places(0, places[0, margin]) - places[:, margin]
    return LidTravel(rows[deepest] - rows, np.median(back @ down, axis=2).mean(1))


# The edges of both lids, as they are seen about the pupil.

EDGE_STEP = 0.002
EDGE_ROWS = np.arange(-0.45, 0.35, EDGE_STEP)
"""Rows that are looked at, from the middle of the canthi, in eye widths."""
EDGE_COLUMNS = np.linspace(-0.08, 0.08, 29)
"""About the pupil; their median leaves out single lashes and highlights."""
NEAR_ROWS, FAR_ROWS, STEP_ROWS = (round(share / EDGE_STEP) for share in (0.015, 0.04, 0.02))
"""How far above and below an edge the skin and the eye are looked at, and its step is measured."""
SMOOTH_ROWS = 2.5
REACH = round(0.02 / EDGE_STEP)
"""In a single picture, the edge is looked for this many rows around where the motion has it."""
NEARLY_SHUT, LOW_REACH = 0.2, round(0.06 / EDGE_STEP)
"""Below this share of the travel the motion counts less and less, and edges are looked for farther away."""
HALF_SHUT = (0.05, 0.5)
"""Share of the travel at which lashes stand neither before the skin of the lid nor before the lower lid."""
LEAST_OPENING = 0.05
"""The lower lid is looked for so far below the upper one of open eyes, in eye widths."""
LEAST_CONTRAST = 1.3
"""Where skin is not this many times brighter than the eye, its edge cannot be trusted."""
DARK_CODE = 10.0
"""Added before logarithms: what is darker is noise."""


@dataclass(frozen=True, eq=False)
class SeenMargins:
    """Where the margins of an eye's lids are, in pixels below the middle of its canthi.

    Attributes
    ----------
    upper : float64 array (pictures,)
        Mean of what the edges and the motion say.
    lower : float
        In open eyes.
    """

    upper: Values
    lower: float


def seen_margins(profiles: Values, travel: Values, width: float) -> SeenMargins | None:
    """Find the lids' edges in the columns about the pupil.

    Parameters
    ----------
    profiles : float64 array (pictures, rows)
        Code values at `EDGE_ROWS`; the first picture is the open one.
    travel : float64 array (pictures,)
        How far the upper lid is above its lowest place by the motion of its skin, in pixels.
    width : float
        Of the eye, in pixels.

    Returns
    -------
    None where skin is hardly brighter than the eye.
    """
    share = travel / travel[0]
    half_shut = (share > HALF_SHUT[0]) & (share < HALF_SHUT[1])
    if not half_shut.any():
        half_shut = share > HALF_SHUT[0]
    # Highlights have edges as well: nothing is brighter than the usual skin of the shut lid.
    skin = float(np.median(profiles[int(np.argmin(travel))]))
    dull = np.minimum(profiles, skin)
    rises = travel / width / EDGE_STEP
    lowest = int(np.argmax(_steps(_followed_mean(dull, rises, half_shut))))
    top = max(0, round(lowest - rises[0]))
    opened = np.median(dull[share > HALF_SHUT[1]], axis=0)
    below = -_steps(opened)
    below[: top + round(LEAST_OPENING / EDGE_STEP)] = 0
    bottom = int(np.argmax(below))
    if bottom <= top:
        return None
    # Looked at upside down, the lower lid's edge is one from skin to eye, too.
    lower = len(opened) - 1 - _crossing(opened[::-1], len(opened) - 1 - bottom)
    eye = float(np.median(profiles[0, top:bottom]))
    if skin + DARK_CODE < LEAST_CONTRAST * (eye + DARK_CODE):
        return None
    # By ratio, and no darker than the eye: lash roots, pupil and shadow are one.
    tones = np.log(np.clip(profiles, eye, skin) + DARK_CODE)
    steps = _steps(_followed_mean(tones, rises, half_shut))
    low, high = max(0, lowest - NEAR_ROWS), lowest + NEAR_ROWS + 1
    lowest = low + int(np.argmax(steps[low:high]))
    offsets = [_crossing(tones[k], lowest - rises[k]) + rises[k] for k in np.flatnonzero(half_shut)]
    followed = float(np.median(offsets)) - rises
    low_share = np.clip(1 - share / NEARLY_SHUT, 0, 1)
    reaches = np.rint(REACH + low_share * (LOW_REACH - REACH)).astype(int).tolist()
    edges = np.array([_edge_near(*one) for one in zip(tones, followed, reaches, strict=True)])
    # Lashes move the edges, and the motion drifts: the mean is nearer to the truth than either. The skin of
    # lids that are pressed together moves less than their margins.
    weight = (1 + low_share) / 2
    upper = weight * edges + (1 - weight) * followed
    return SeenMargins(*((EDGE_ROWS[0] + EDGE_STEP * rows) * width for rows in (upper, lower)))


def eye_profiles(pictures: Sequence[Picture], eye: Points) -> Values:
    """(pictures, rows) median code values of the columns about the pupil."""
    along, down, width = eye_axis(eye)
    middle = eye[list(CANTHI)].mean(0)
    # The detector's canthi may be a tenth of the eye's width off to the side.
    iris = widened_iris(pictures[0], eye)
    across = 0.0 if iris is None else float((np.array([iris.x, iris.y]) - middle) @ along / width)
    grid = middle + width * (EDGE_ROWS[:, None, None] * down + (across + EDGE_COLUMNS)[:, None] * along)
    x, y = np.moveaxis(grid.astype(np.float32), -1, 0)
    looks = [cv2.remap(one, x, y, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE) for one in pictures]
    return np.asarray(np.median(looks, axis=2), np.float64)


def _followed_mean(profiles: Values, rises: Values, kept: NDArray[np.bool_]) -> Values:
    """(rows,) mean of the kept profiles, each moved down to where its upper lid is lowest."""
    rows = np.arange(profiles.shape[1])
    return np.asarray(
        np.mean([np.interp(rows - rises[k], rows, profiles[k]) for k in np.flatnonzero(kept)], 0)
    )


def _steps(profile: Values) -> Values:
    """(rows,) how much brighter it is above each row than below."""
    smooth = gaussian_filter1d(profile, SMOOTH_ROWS)
    steps = np.zeros_like(smooth)
    steps[STEP_ROWS:-STEP_ROWS] = smooth[: -2 * STEP_ROWS] - smooth[2 * STEP_ROWS :]
    return steps


def _edge_near(profile: Values, row: float, reach: int) -> float:
    """The row of the clearest edge from skin to eye next to an expected one."""
    rows = np.clip(round(row) + np.arange(-reach, reach + 1), 0, len(profile) - 1)
    return _crossing(profile, float(rows[int(np.argmax(_steps(profile)[rows]))]))


def _crossing(profile: Values, row: float) -> float:
    """The middle of the transition from skin to eye at a row, which is found again around itself."""
    for _ in range(4):
        near = round(row)
        above = profile[max(0, near - FAR_ROWS) : max(1, near - NEAR_ROWS)]
        below = profile[min(len(profile) - 1, near + NEAR_ROWS) : near + FAR_ROWS]
        over = profile - (np.median(above) + np.median(below)) / 2
        falls = np.flatnonzero((over[:-1] > 0) & (over[1:] <= 0))
        falls = falls[abs(falls - near) <= NEAR_ROWS]
        if not len(falls):
            break
        places = falls + over[falls] / (over[falls] - over[falls + 1])
        row = float(places[int(np.argmin(abs(places - row)))])
    return row


# The openings that follow.

SHUT_SHARE = 0.002
"""Eyes that are open by less of the widest opening are shut."""
OPEN_SHARE = 0.005
"""Eyes that miss less than this of the widest opening are open."""
MIN_FRAMES = 2
"""Fewest frames of an opening, after the open one, that show a lid on its way."""
RIM_MM = 0.25
"""Lids that touch at their lashes have met behind them: so much of the motion closes no gap that is seen."""


def lid_opening(travel: Values, margins: SeenMargins | None, px_per_mm: float) -> Values:
    """(pictures,) opening of an eye in pixels."""
    upper = -travel if margins is None else margins.upper
    lowest = float(upper.max())
    # A shut lid goes on over the edge of the lower one. Where they have met is between both places.
    shut_at = lowest if margins is None else (lowest + min(lowest, margins.lower)) / 2
    apart = np.maximum(shut_at - upper, 0.0)
    rim = RIM_MM * px_per_mm
    return np.asarray(apart - rim * (1 - np.exp(-apart / rim)))


@dataclass(frozen=True, eq=False)
class MotionOpenings:
    """Openings by the motion and the edges of the lids.

    Attributes
    ----------
    frames : StillFrames
        The distinct frames from open to shut, with these closures.
    opening_px : float
        Of the open eye, in pixels of the region.
    error_px : float64 array (n,)
        Of the frames' openings: half of the drift from shut to open and back.
    """

    frames: StillFrames
    opening_px: float
    error_px: Values


def frames_by_motion(frames: StillFrames, start: int, px_per_mm: float) -> MotionOpenings:
    """Measure the openings of frames and keep those that differ.

    Parameters
    ----------
    frames : StillFrames
        All frames from after the open one back to before the last shut one.
    start : int
        The frame that the track calls shut.
    px_per_mm : float
        Of the region.

    Raises
    ------
    InputError
        The lids do not move as in an opening.
    """
    pictures = [gray_codes(picture) for picture in frames.pictures]
    openings, drifts = [], []
    for eye, shut_eye in zip(*(frames.points[k].reshape(-1, EYE_POINTS, 2) for k in (0, start)), strict=True):
        travel = lid_travel(pictures, eye, shut_eye, start)
        margins = seen_margins(eye_profiles(pictures, eye), travel.upper, eye_axis(eye)[2])
        openings.append(lid_opening(travel.upper, margins, px_per_mm))
        drifts.append(travel.drift)
    opening, drift = np.mean(openings, axis=0), np.mean(drifts, axis=0)
    opening = opening - opening.min()
    touching = int(np.argmax(opening <= SHUT_SHARE * opening.max()))
    # The first in time that is as open as any: frames run backward.
    widest = int(np.flatnonzero(opening >= (1 - OPEN_SHARE) * opening.max())[-1])
    if touching - widest < MIN_FRAMES:
        raise InputError(NOT_FOLLOWED)
    closures = 1 - opening / opening[widest]
    kept = range(widest, touching + 1)
    distinct = distinct_frames(frames.only(kept, closures), closures[kept])
    errors = [drift[frames.numbers.index(number)] / 2 for number in distinct.numbers]
    return MotionOpenings(distinct, float(opening[widest]), np.array(errors))


def moved_levels(motion: MotionOpenings, levels: Sequence[BuiltLevel], px_per_mm: float) -> MeasuredLevels:
    """Closures of levels by the motion of the lids.

    Parameters
    ----------
    px_per_mm : float
        Of the region.
    """
    closures = np.round([level.track_closure for level in levels], 5)
    errors = np.interp(closures, motion.frames.closures, motion.error_px)
    scale = motion.frames.region.scale
    return MeasuredLevels(closures, errors / px_per_mm, motion.opening_px / scale)
