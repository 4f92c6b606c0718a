"""The worst frames of a track as a label file: to be corrected on the labelling page and taken in again."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from stimuli_builder.tracking.labels import Labels, save_labels
from stimuli_builder.tracking.proposals import TRACKED
from stimuli_builder.tracking.shapes import LidMarkers, Points
from stimuli_builder.tracking.table import numbers, point_columns, track_rows
from stimuli_builder.video import VideoInfo

WORST = 12
APART_S = 0.1
"""Frames nearer to one another than this show the same; a fast camera's neighbours would fill the list."""


def worst_frames(track: Path, eyes: int, fps: float, hints: Mapping[int, Points | str]) -> dict[int, Points]:
    """Return up to twelve frames that need a person most, with the points to begin from.

    Lost frames with a detection come first, then doubtful ones, then the largest stated errors.
    """
    ranked: list[tuple[float, int, Points]] = []
    for row in track_rows(track):
        frame = int(row["frame"])
        points = numbers(row, point_columns(eyes), str(track)).reshape(-1, 2)
        if row["status"] == "lost":
            seen = hints.get(frame)
            if seen is not None and not isinstance(seen, str):
                ranked.append((2e6, frame, seen))
        else:
            error = float(row["error_px"] or 0.0)
            ranked.append((error + 1e6 * (row["status"] == "doubtful"), frame, points))
    chosen: dict[int, Points] = {}
    for _, frame, points in sorted(ranked, key=lambda entry: (-entry[0], entry[1])):
        if len(chosen) == WORST:
            break
        if all(abs(frame - other) >= APART_S * fps for other in chosen):
            chosen[frame] = points
    return dict(sorted(chosen.items()))


def write_relabel(
    path: Path,
    info: VideoInfo,
    markers: LidMarkers,
    worst: Mapping[int, Points],
    by_hand: Mapping[int, Points],
) -> int:
    """Write the frames to correct as proposals, beside those corrected before; return how many are proposed.

    Parameters
    ----------
    by_hand : mapping of int to float64 array
        Frames that a person changed or accepted, see `proposals.by_hand`.
    """
    inside = {n: np.clip(points, 0, np.array(info.size_px) - 1) for n, points in worst.items()}
    new = {n: points for n, points in inside.items() if n not in by_hand}
    frames = dict(sorted((new | dict(by_hand)).items()))
    save_labels(Labels(path, info.size_px, markers, frames, new), info.path.name, TRACKED)
    return len(new)
