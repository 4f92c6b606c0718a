"""Where the iris is and how wide: the circle across which the picture gets brightest, between the lids."""

import csv
import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from experiments.errors import InputError
from experiments.files import whole_text
from stimuli_builder.compiled import compiled
from stimuli_builder.tracking.mesh import reduce_picture, reduced_points, restored_points
from stimuli_builder.tracking.shapes import EYE_POINTS, Points, eye_axis
from stimuli_builder.tracking.table import numbers, point_columns, track_rows
from stimuli_builder.video import Picture, VideoInfo, frames

Values = NDArray[np.float64]

IRIS_MM = 11.7
"""Horizontal diameter of the visible iris; people differ by some 4% (sd)."""
RADII = (0.165, 0.34)
"""Radii looked at, as parts of the eye's width: usual are 0.2 to 0.26, pupils are less."""
ARC = math.radians(52)
"""Half of each arc, left and right, on which the edge is looked for: above and below are the lids."""
ANGLES = 11
LEAST_OPEN = 0.25
"""Opening, as part of the eye's width, below which lids leave too little of the edge."""
LEAST_STEP = 4.0
"""Gray levels by which the picture must get brighter across the edge."""
LEAST_POINTS = 5
"""Points of either arc that must lie between the lids."""
SOFT = 40.0
"""Gray levels at which a step counts half: a lamp's reflection is worth little more than the white."""
REACHES = (0.012, 0.03)
"""How far inside and outside the edge is compared: near, to locate it, and far, to detect it."""
MARGIN = 0.02
FINE_PX = 100
"""A wider eye is looked at in a reduced picture."""
STAGES = ((0.035, 0.02), (0.015, 0.008), (0.006, 0.004), (0.0025, 0.002))
"""Steps of the search in position and in radius, as parts of the eye's width, coarse to fine."""


@dataclass(frozen=True)
class Iris:
    """One eye's iris: middle and diameter in pixels, and the gray levels its edge is darker by."""

    x: float
    y: float
    diameter: float
    step: float


def measure_iris(picture: Picture, eye: Points) -> Iris | None:
    """Find the iris of an eye between its lids.

    Parameters
    ----------
    picture : uint8 array (h, w)
        Gray.
    eye : float64 array (9, 2)
        Its points in the order of label files, in pixels.

    Returns
    -------
    Iris or None
        None where the eye is too far shut, or no edge is seen on both sides of the iris.
    """
    factor = max(1, int(eye_axis(eye)[2] / FINE_PX))
    if factor == 1:
        return _measured(picture, eye)
    seen = _measured(reduce_picture(picture, factor), reduced_points(eye, factor))
    if seen is None:
        return None
    x, y = restored_points(np.array([seen.x, seen.y]), factor)
    return Iris(float(x), float(y), seen.diameter * factor, seen.step)


def _measured(picture: Picture, eye: Points) -> Iris | None:
    along, down, width = eye_axis(eye)
    middle = (eye[0] + eye[5]) / 2
    # In eye widths from here on, so that every threshold above holds for any resolution.
    upper, lower = _lids(eye, np.array([along, down]) / width)
    opening = float(lower[2, 1] - (upper[2, 1] + upper[3, 1]) / 2)
    if opening < LEAST_OPEN or not _well_ordered(upper) or not _well_ordered(lower):
        return None
    # As wide as the nearer of REACHES: the two sides of the edge are compared, not single lashes.
    smooth = cv2.GaussianBlur(picture, (0, 0), max(0.6, 0.012 * width)).astype(np.float32)
    axes = np.array([*(along * width), *(down * width), *middle])
    best = np.array([0.0, float(upper[2:4, 1].mean() + lower[2, 1]) / 2, sum(RADII) / 2])
    # Gaze moves an iris about twice as far sideways as up and down before the lids follow or hide it.
    reach, step = np.array([0.26, 0.12, (RADII[1] - RADII[0]) / 2]), 0.0
    for shift, radius in STAGES:
        step = _search(smooth, axes, upper, lower, best, reach, shift, radius)
        # Two steps of the stage before: its grid may have taken the neighbor of the best place.
        reach = np.array([2 * shift, 2 * shift, 2 * radius])
    if step < LEAST_STEP:
        return None
    x, y = middle + width * (best[0] * along + best[1] * down)
    return Iris(float(x), float(y), float(2 * best[2] * width), step)


def _lids(eye: Points, axes: Values) -> tuple[Values, Values]:
    """Upper (6, 2) and lower lid (5, 2) from image-left to image-right, in eye widths from the middle."""
    local = (eye - (eye[0] + eye[5]) / 2) @ axes.T
    order = 1 if local[0, 0] < 0 else -1
    return local[[0, 1, 2, 3, 4, 5]][::order], local[[0, 8, 7, 6, 5]][::order]


def _well_ordered(lid: Values) -> bool:
    return bool((np.diff(lid[:, 0]) > 0).all())


@compiled
def _search(
    picture: NDArray[np.float32],
    axes: Values,
    upper: Values,
    lower: Values,
    best: Values,
    reach: Values,
    shift: float,
    radius: float,
) -> float:
    """Move `best` (x, y, radius in eye widths) to the circle with the greatest step; return the step."""
    start, greatest = best.copy(), 0.0
    half_x, half_y, half_r = int(reach[0] / shift), int(reach[1] / shift), int(reach[2] / radius)
    for i in range(-half_x, half_x + 1):
        for j in range(-half_y, half_y + 1):
            for k in range(-half_r, half_r + 1):
                x, y, r = start[0] + i * shift, start[1] + j * shift, start[2] + k * radius
                if not RADII[0] <= r <= RADII[1]:
                    continue
                step = _step_across(picture, axes, upper, lower, x, y, r)
                if step > greatest:
                    greatest = step
                    best[0], best[1], best[2] = x, y, r
    return greatest


@compiled
def _step_across(
    picture: NDArray[np.float32], axes: Values, upper: Values, lower: Values, x: float, y: float, r: float
) -> float:
    """How much brighter it is just outside a circle than just inside: the mean of both arcs' means."""
    total = 0.0
    for side in range(2):
        steps, count = 0.0, 0
        for n in range(ANGLES):
            angle = math.pi * side + ARC * (2 * n / (ANGLES - 1) - 1)
            u, v = x + r * math.cos(angle), y + r * math.sin(angle)
            if v < _height(upper, u) + MARGIN or v > _height(lower, u) - MARGIN:
                continue
            for reach in REACHES:
                near, far = (r - reach) / r, (r + reach) / r
                inside = _grey(picture, axes, x + (u - x) * near, y + (v - y) * near)
                outside = _grey(picture, axes, x + (u - x) * far, y + (v - y) * far)
                # Saturating: a lamp's reflection on the edge may be a hundred levels brighter than the
                # white.
                steps += (outside - inside) / (1 + abs(outside - inside) / SOFT)
            count += 1
        # Both arcs are needed: one edge alone fits circles of any size.
        if count < LEAST_POINTS:
            return 0.0
        total += steps / (count * len(REACHES))
    return total / 2


@compiled
def _height(lid: Values, u: float) -> float:
    """Where a lid (k, 2), ordered by its first coordinate, is at u; beyond its ends the eye is shut."""
    for n in range(len(lid) - 1):
        if lid[n, 0] <= u <= lid[n + 1, 0]:
            share = (u - lid[n, 0]) / (lid[n + 1, 0] - lid[n, 0])
            return float(lid[n, 1] + share * (lid[n + 1, 1] - lid[n, 1]))
    # An upper lid that is infinitely far down leaves the place out.
    return math.inf


@compiled
def _grey(picture: NDArray[np.float32], axes: Values, u: float, v: float) -> float:
    """Bilinear sample at (u, v) of the eye's frame; edges repeated."""
    column = min(max(axes[4] + u * axes[0] + v * axes[2], 0.0), picture.shape[1] - 1.001)
    row = min(max(axes[5] + u * axes[1] + v * axes[3], 0.0), picture.shape[0] - 1.001)
    c, r = int(column), int(row)
    fc, fr = column - c, row - r
    top = picture[r, c] + fc * (picture[r, c + 1] - picture[r, c])
    low = picture[r + 1, c] + fc * (picture[r + 1, c + 1] - picture[r + 1, c])
    return float(top + fr * (low - top))


# The irises of a tracked recording, frame by frame, and the millimeters in a pixel that follow.

BELIEVED = ("tracked", "reinitialised")
LEAST_FRAMES = 5
"""Minimum number of irises for a scale."""


@dataclass(frozen=True)
class IrisSummary:
    """What a recording's irises say.

    Attributes
    ----------
    frames, seen : int
        Frames of the track; irises seen, both eyes counted.
    diameter_px : float
        Median diameter; NaN where fewer than five were seen.
    spread_px : float
        Half of the range that the middle half of the diameters lies in.
    """

    frames: int
    seen: int
    diameter_px: float
    spread_px: float

    @property
    def mm_per_px(self) -> float:
        """Millimeters per pixel if an iris is 11.7 mm wide."""
        return IRIS_MM / self.diameter_px


def write_irises(info: VideoInfo, track: Path, out: Path, advance: Callable[[], None]) -> IrisSummary:
    """Measure the irises of every believed frame of a track into a CSV, and sum them up.

    Raises
    ------
    InputError
        The track has another number of frames than the video, or is none.
    """
    header = next(iter(track_rows(track)), {})
    # Columns are numbered from 1: eighteen points are those of two eyes.
    eyes = 2 if "x18" in header else 1
    names, diameters, count = point_columns(eyes), [], 0
    rows, pictures = track_rows(track), islice(frames(info.path), info.frame_count)
    with whole_text(out) as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(["frame", "time_s", *iris_columns(eyes)])
        for picture in pictures:
            row = next(rows, None)
            if row is None:
                break
            count += 1
            believed = row["status"] in BELIEVED
            points = numbers(row, names, str(track)).reshape(-1, EYE_POINTS, 2)
            # A doubtful frame's lids may be wrong, and the search looks only between them.
            seen = [measure_iris(picture, eye) if believed else None for eye in points]
            diameters += [one.diameter for one in seen if one is not None]
            writer.writerow([row["frame"], row["time_s"], *(cell for one in seen for cell in _cells(one))])
            advance()
        if count != info.frame_count or next(rows, None) is not None:
            raise InputError(
                f"{track}: not a track of {info.path}, which has {info.frame_count} frames; use the video "
                "that was tracked"
            )
    return _summary(count, diameters)


def iris_columns(eyes: int) -> list[str]:
    """Names of the columns: middle and diameter of each iris, image-left eye first."""
    sides = ["left_", "right_"] if eyes == 2 else [""]
    return [f"{side}iris_{what}_px" for side in sides for what in ("x", "y", "diameter")]


def _cells(iris: Iris | None) -> list[str]:
    return [""] * 3 if iris is None else [f"{value:.2f}" for value in (iris.x, iris.y, iris.diameter)]


def _summary(count: int, diameters: list[float]) -> IrisSummary:
    if len(diameters) < LEAST_FRAMES:
        return IrisSummary(count, len(diameters), float("nan"), float("nan"))
    # Quartiles, since some edges found are those of lids or pupils.
    low, middle, high = np.percentile(diameters, [25, 50, 75])
    return IrisSummary(count, len(diameters), float(middle), float(high - low) / 2)
