"""A model without labels: a detector looks at frames across the video, the most varied ones train the AAM."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from experiments.errors import InputError
from stimuli_builder.tracking.accuracy import Advance
from stimuli_builder.tracking.labels import Labels, save_labels
from stimuli_builder.tracking.learn import Lesson, lesson_from
from stimuli_builder.tracking.proposals import DETECTED
from stimuli_builder.tracking.shapes import (
    EYE_POINTS,
    Points,
    default_markers,
    mean_shape,
    moved,
    similarity_between,
    widths,
)
from stimuli_builder.tracking.survey import Survey
from stimuli_builder.tracking.training import TrainingOptions
from stimuli_builder.video import VideoInfo

Values = NDArray[np.float64]

TRAINED_ON = 26
ENOUGH_BY_HAND = 12
FACE_SHARE, CLOSE_UP_SHARE = 0.02, 0.03
"""What the detector's lids may be off that no held-out frame tells, as part of the eye's width, in faces and
in close-ups: a stated error is then right within a factor of 1.7 on rendered faces (exact truth) and on the
recordings with labels (tests/bench/bench_rendered_tracks.py and bench_stated_error.py)."""
MODES = 6
SPREADS = 8.0
UNLIKE_SHARE = 0.02
"""A detection is left out where the others leave more of it than 8 spreads and 2% of the eye's width."""


def plausible(labels: dict[int, Points]) -> dict[int, Points]:
    """Leave out detections that the shapes of all the others (six components) explain badly."""
    numbers = sorted(labels)
    shapes = np.array([labels[n] for n in numbers])
    mean = mean_shape(shapes)
    rows = np.array([moved(shape, similarity_between(shape, mean)) for shape in shapes])
    rows = rows.reshape(len(rows), -1)
    rest = np.array([_unexplained(np.delete(rows, k, axis=0), rows[k]) for k in range(len(rows))])
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
    rows = np.array([moved(shapes[n], similarity_between(shapes[n], first)).ravel() for n in numbers])
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
            f"{info.path}: eyes were found on {len(good)} frames, {wanted_frames} are wanted; "
            "ask for fewer (--frames)"
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
    """Train the model on the most varied of the detections; frames labelled by hand (all of `by_hand`) win.

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
    errors = np.hypot(lesson.model.point_errors, share * float(width))
    return replace(lesson, model=replace(lesson.model, point_errors=errors))
