"""The irises of a tracked recording, frame by frame, and the millimetres in a pixel that follow."""

import csv
from collections.abc import Callable
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np

from experiments.errors import InputError
from experiments.files import whole_text
from stimuli_builder.tracking.iris import IRIS_MM, Iris, measure_iris
from stimuli_builder.tracking.shapes import EYE_POINTS
from stimuli_builder.tracking.table import numbers, point_columns, track_rows
from stimuli_builder.video import VideoInfo, frames

BELIEVED = ("tracked", "reinitialised")
LEAST_FRAMES = 5
"""Irises that must be seen before a scale is told."""


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
        """Millimetres in a pixel if an iris is 11.7 mm wide."""
        return IRIS_MM / self.diameter_px


def write_irises(info: VideoInfo, track: Path, out: Path, advance: Callable[[], None]) -> IrisSummary:
    """Measure the irises of every believed frame of a track into a CSV, and sum them up.

    Raises
    ------
    InputError
        The track has another number of frames than the video, or is none.
    """
    header = next(iter(track_rows(track)), {})
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
            seen = [measure_iris(picture, eye) if believed else None for eye in points]
            diameters += [one.diameter for one in seen if one is not None]
            writer.writerow([row["frame"], row["time_s"], *(cell for one in seen for cell in _cells(one))])
            advance()
        if count != info.frame_count or next(rows, None) is not None:
            raise InputError(
                f"{track}: not a track of {info.path}, which has {info.frame_count} frames; give the video "
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
    low, middle, high = np.percentile(diameters, [25, 50, 75])
    return IrisSummary(count, len(diameters), float(middle), float(high - low) / 2)
