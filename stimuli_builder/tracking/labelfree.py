"""A model without labels: a detector looks at frames across the video, the most varied ones train the AAM."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from experiments.errors import InputError
from stimuli_builder.tracking.accuracy import Advance
from stimuli_builder.tracking.labels import DETECTED, TRACKED, Labels, save_labels
from stimuli_builder.tracking.learn import Lesson, lesson_from
from stimuli_builder.tracking.model import TrainingOptions
from stimuli_builder.tracking.shapes import (
    EYE_POINTS,
    LidMarkers,
    Points,
    apply_pose,
    default_markers,
    mean_shape,
    similarity_between,
    widths,
)
from stimuli_builder.tracking.survey import Survey
from stimuli_builder.tracking.table import numbers, point_columns, track_rows
from stimuli_builder.video import VideoInfo

Values = NDArray[np.float64]

TRAINED_ON = 26
ENOUGH_BY_HAND = 12
FACE_SHARE, CLOSE_UP_SHARE = 0.02, 0.03
"""Error of the detector's lids that no held-out frame reveals, as a fraction of the eye's width, in faces and
in close-ups: a stated error is then right within a factor of 1.7 on rendered faces (exact truth) and on the
recordings with labels (bench/rendered_tracks.py and stated_error.py)."""
MODES = 6
SPREADS = 8.0
UNLIKE_SHARE = 0.02
"""A detection is left out where the others leave more of it than 8 spreads and 2% of the eye's width."""


def plausible(labels: dict[int, Points]) -> dict[int, Points]:
    """Leave out detections that the shapes of all the others (six components) explain badly."""
    numbers = sorted(labels)
    shapes = np.array([labels[n] for n in numbers])
    mean = mean_shape(shapes)
    rows = np.array([apply_pose(shape, similarity_between(shape, mean)) for shape in shapes])
    rows = rows.reshape(len(rows), -1)
    # Each by the others alone: a bad detection must not help to explain itself.
    rest = np.array([_unexplained(np.delete(rows, k, axis=0), rows[k]) for k in range(len(rows))])
    # A robust limit, by the median and its deviations: the bad detections sought must not set it.
    limit = max(
        float(np.median(rest) + SPREADS * 1.4826 * np.median(np.abs(rest - np.median(rest)))),
        UNLIKE_SHARE * widths(mean),
    )
    return {n: labels[n] for n, far in zip(numbers, rest, strict=True) if far <= limit}


def _unexplained(others: Values, row: Values) -> float:
    """Root mean square of what the first components of `others` (n, d) leave of `row` (d,)."""
    mean = others.mean(0)
    basis = np.linalg.svd(others - mean, full_matrices=False)[2][:MODES]
    rest = (row - mean) - (row - mean) @ basis.T @ basis
    return float(np.sqrt((rest**2).mean()))


def most_varied(shapes: dict[int, Points], count: int) -> list[int]:
    """Frames whose shapes, freed of position, size and turn, lie farthest from one another; ascending."""
    numbers = sorted(shapes)
    first = shapes[numbers[0]]
    rows = np.array([apply_pose(shapes[n], similarity_between(shapes[n], first)).ravel() for n in numbers])
    # The most usual shape first; every next one is the farthest from those chosen, so that blinks are among
    # them.
    chosen = [int(((rows - np.median(rows, axis=0)) ** 2).sum(1).argmin())]
    distance: NDArray[np.float64] = np.full(len(numbers), np.inf)
    while len(chosen) < min(count, len(numbers)):
        distance = np.minimum(distance, ((rows - rows[chosen[-1]]) ** 2).sum(1))
        chosen.append(int(distance.argmax()))
    return sorted(numbers[index] for index in chosen)


def proposed_labels(info: VideoInfo, seen: Survey, out: Path, wanted_frames: int) -> Labels:
    """Save the most varied of the detections as a label file, to be corrected by hand.

    Raises
    ------
    InputError
        Fewer frames than wanted show eyes.
    """
    good = plausible(seen.points)
    if len(good) < wanted_frames:
        raise InputError(
            f"{info.path}: eyes were found in {len(good)} frames, but {wanted_frames} are required; use a "
            "smaller --frames"
        )
    eyes = len(next(iter(good.values()))) // EYE_POINTS
    chosen = {n: good[n] for n in most_varied(good, wanted_frames)}
    labels = Labels(out, info.size_px, default_markers(eyes), chosen, chosen)
    save_labels(labels, info.path.name, DETECTED)
    return labels


def label_free_lesson(
    info: VideoInfo,
    seen: Survey,
    options: TrainingOptions,
    *,
    one_eye: bool,
    by_hand: Labels | None = None,
    refine: bool | None = None,
    advance: Advance = None,
) -> Lesson:
    """Train the model on the most varied of the detections; frames labeled by hand (all of `by_hand`) win.

    Twelve frames by hand or more train alone: a person and a detector mean slightly different points.
    `advance` is called after each of `training_steps`.
    """
    good = plausible(seen.points)
    hand = {} if by_hand is None else by_hand.frames
    room = max(0, TRAINED_ON - len(hand)) if len(hand) < ENOUGH_BY_HAND else 0
    chosen = {n: good[n] for n in most_varied(good, min(room, len(good)))} if room else {}
    markers = default_markers(1 if one_eye else 2) if by_hand is None else by_hand.markers
    labels = Labels(Path("detections"), info.size_px, markers, dict(sorted((chosen | hand).items())))
    lesson = lesson_from(info, labels, options, refine=refine, advance=advance)
    if len(hand) >= ENOUGH_BY_HAND:
        return lesson
    width = np.mean([widths(points) for points in labels.frames.values()])
    share = CLOSE_UP_SHARE if one_eye else FACE_SHARE
    # Held-out frames are compared with the detector that trained the model: its own error has to be added.
    errors = np.hypot(lesson.model.point_errors, share * float(width))
    return replace(lesson, model=replace(lesson.model, point_errors=errors))


# The worst frames of a track as a label file: to be corrected on the labeling page and taken in again.

WORST = 12
APART_S = 0.1
"""Frames nearer to one another than this show the same; a fast camera's neighbors would fill the list."""


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
                # Above every doubtful frame, which has 1e6 and its error.
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
    """Write the frames to correct as proposals, in addition to those corrected before; return how many are
    proposed.

    Parameters
    ----------
    by_hand : mapping of int to float64 array
        Frames that a person changed or accepted, see `labels.by_hand`.
    """
    inside = {n: np.clip(points, 0, np.array(info.size_px) - 1) for n, points in worst.items()}
    new = {n: points for n, points in inside.items() if n not in by_hand}
    frames = dict(sorted((new | dict(by_hand)).items()))
    save_labels(Labels(path, info.size_px, markers, frames, new), info.path.name, TRACKED)
    return len(new)
