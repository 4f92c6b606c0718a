"""The preview video: the fitted mesh on every frame and the distance trace of the last seconds below it."""

from collections import deque
from collections.abc import Callable
from itertools import islice
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from stimuli_builder.blinks.events.recognise import recognise
from stimuli_builder.blinks.extract import blinks_of
from stimuli_builder.blinks.labelling import DEFAULT_OPTIONS
from stimuli_builder.blinks.plots import save_figure, series_figure
from stimuli_builder.blinks.series import read_series
from stimuli_builder.tracking.model import CoupledModel
from stimuli_builder.tracking.shapes import EYE_POINTS, Points, with_border
from stimuli_builder.tracking.table import distance_columns, numbers, point_columns, track_rows
from stimuli_builder.video import Picture, VideoInfo, VideoWriter, frames, rgb

PANEL_PX = 96
SECONDS = 2.0
MESH, OUTLINE, TEXT = (70, 150, 90), (90, 255, 120), (235, 235, 235)
TRACES = ((90, 170, 255), (255, 180, 70))
# OpenCV draws at fractions of a pixel when coordinates are shifted by this many bits.
SHIFT = 4


def write_preview(
    model: CoupledModel, info: VideoInfo, track: Path, out: Path, advance: Callable[[], None]
) -> None:
    """Draw a finished track on its video.

    The model gives the triangles; the track is read row by row, so memory does not grow with its length.
    """
    names, gaps = point_columns(model.eyes), distance_columns(model.eyes)
    # Even, as yuv420p halves both sides for color.
    width, height = (side - side % 2 for side in info.size_px)
    span = max(2, round(SECONDS * info.fps))
    history: deque[NDArray[np.float64]] = deque(maxlen=span)
    top = 1.0
    with VideoWriter(out, info.fps, (width, height + PANEL_PX)) as writer:
        pictures = islice(frames(info.path, read=rgb), info.frame_count)
        for picture, row in zip(pictures, track_rows(track), strict=True):
            points = numbers(row, names, str(track)).reshape(-1, 2)
            history.append(numbers(row, gaps, str(track)))
            if np.isfinite(history[-1]).all():
                # The scale only grows: a trace that jumps would hide the blinks.
                top = max(top, float(history[-1].max()))
            canvas = np.zeros((height + PANEL_PX, width, 3), np.uint8)
            canvas[:height] = picture[:height, :width]
            _draw_mesh(canvas, points, model.mesh.triangles)
            _draw_trace(canvas[height:], history, span, top)
            _write_text(canvas, f"{row['frame']}  {float(row['time_s']):.3f} s  {_status(row)}")
            writer.write(canvas)
            advance()


def _status(row: dict[str, str]) -> str:
    return f"{row['status']}: {row['reason']}" if row["reason"] else row["status"]


def _draw_mesh(canvas: Picture, points: Points, triangles: NDArray[np.int64]) -> None:
    # A lost frame has nothing to draw.
    if not np.isfinite(points).all():
        return
    vertices = _fixed(with_border(points))
    cv2.polylines(canvas, list(vertices[triangles]), True, MESH, 1, cv2.LINE_AA, SHIFT)
    for start in range(0, len(points), EYE_POINTS):
        outline = _fixed(points[start : start + EYE_POINTS])
        cv2.polylines(canvas, [outline], True, OUTLINE, 1, cv2.LINE_AA, SHIFT)
        for point in outline:
            cv2.circle(canvas, point.tolist(), 2 << SHIFT, OUTLINE, -1, cv2.LINE_AA, SHIFT)


def _fixed(points: Points) -> NDArray[np.int32]:
    """Sixteenths of a pixel, as OpenCV draws them."""
    return np.asarray(np.round(points * (1 << SHIFT)), np.int32)


def _draw_trace(panel: Picture, history: deque[NDArray[np.float64]], span: int, top: float) -> None:
    values = np.array(history)
    height, width = panel.shape[:2]
    # The newest value is always at the right edge.
    x = (np.arange(len(values)) + span - len(values)) / (span - 1) * (width - 1)
    for eye in range(values.shape[1]):
        y = height - 8 - values[:, eye] / top * (height - 30)
        good = np.isfinite(y)
        # A gap interrupts the line instead of being bridged.
        for part in np.split(np.arange(len(y)), np.flatnonzero(np.diff(good.astype(int))) + 1):
            if good[part[0]]:
                cv2.polylines(
                    panel, [_fixed(np.c_[x[part], y[part]])], False, TRACES[eye], 1, cv2.LINE_AA, SHIFT
                )


def _write_text(canvas: Picture, text: str) -> None:
    cv2.putText(
        canvas,
        text,
        (6, canvas.shape[0] - PANEL_PX + 14),
        cv2.FONT_HERSHEY_SIMPLEX,
        0.42,
        TEXT,
        1,
        cv2.LINE_AA,
    )


# The trace of a track with its labeled blinks (the paper's Figure 3).


def plot_track(track: Path, fps: float, figure: Path) -> int:
    """Recognize the blinks of a track, save the figure, return how many there are.

    With two eyes, the number of blinks is that of the eye that shows more.
    """
    given = read_series(track, (), fps)
    eyes = [
        blinks_of(series, DEFAULT_OPTIONS, recognised=recognised)
        for series, recognised in zip(given, recognise(given), strict=True)
    ]
    # No review yet, so nothing is rejected.
    save_figure(series_figure(eyes, set()), figure)
    return max(len(eye.blinks) for eye in eyes)
