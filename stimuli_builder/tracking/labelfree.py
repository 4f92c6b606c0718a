"""A model without labels: a detector looks at frames across the video, the most varied ones train the AAM."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from itertools import count, islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.errors import InputError
from stimuli_builder.tracking.covers import covered_frames, textures_of
from stimuli_builder.tracking.detector.detection import Detection
from stimuli_builder.tracking.detector.mesh import open_detector
from stimuli_builder.tracking.detector.one_face import one_face
from stimuli_builder.tracking.labels import Labels, save_labels
from stimuli_builder.tracking.learn import Lesson, lesson_from
from stimuli_builder.tracking.shapes import (
    EYE_POINTS,
    Points,
    default_markers,
    mean_shape,
    moved,
    similarity_between,
    widths,
)
from stimuli_builder.tracking.tracker import UNSEEN
from stimuli_builder.tracking.training import TrainingOptions
from stimuli_builder.video import Picture, VideoInfo, frames, rgb

Values = NDArray[np.float64]

NOTHING: Picture = np.empty((0, 0, 3), np.uint8)
LOOKED_AT = 400
TRAINED_ON = 26
ENOUGH_BY_HAND = 12
FEWEST = 6
LEAST_SEEN = 0.3
"""Share of the frames looked at that must show a face: below it, what was found is hardly one."""
DETECTOR_SHARE = 0.02
"""What the detector's lids may be off that no held-out frame tells, as part of the eye's width. Against
labels they are 2.4% off where those are good to 1%, 2.6% where good to 3%; a part is in held-out frames."""
MODES = 6
SPREADS = 8.0
UNLIKE_SHARE = 0.02
"""A detection is left out where the others leave more of it than 8 spreads and 2% of the eye's width."""
UPRIGHT_DEG = 60
"""A line through both eyes that is turned further against the picture's rows tells a picture on its side or
upside down: left and right, above and below an eye are then not what they are called."""
STEADY = 3.0
"""Eyes' widths over the frames looked at stay within this factor, or they belong to no one face."""


@dataclass(frozen=True)
class Survey:
    """What the detector saw.

    Attributes
    ----------
    points : dict of int to float64 array
        Frame -> (9 * eyes, 2) points in pixels.
    looked_at : int
        Frames looked at.
    several_faces : int
        Frames among them with more than one face; the one larger over the recording was taken.
    unseen : frozenset of int
        Frames looked at in which the eyes of that face were not seen, or not wholly in the picture.
    covered : dict of int to str
        Frames looked at in which one of its eyes is covered, and that in words; they have no points.
    """

    points: dict[int, Points]
    looked_at: int
    several_faces: int
    unseen: frozenset[int] = frozenset()
    covered: dict[int, str] = field(default_factory=dict)

    @property
    def hints(self) -> dict[int, Points | str]:
        """Every frame looked at and what was seen of the eyes there, or why nothing; see `track_video`."""
        return {**self.points, **dict.fromkeys(self.unseen, UNSEEN), **self.covered}


def survey(info: VideoInfo, *, one_eye: bool, advance: Callable[[int], None] | None = None) -> Survey:
    """Detect eyes on up to 400 frames spread over a video.

    Raises
    ------
    InputError
        Too few frames show a face, or what was found is no face.
    """
    step = max(1, -(-info.frame_count // LOOKED_AT))
    seen: dict[int, list[Detection]] = {}
    textures: dict[Detection, Values] = {}
    first = _first(info, step) if one_eye else ()
    with open_detector(one_eye=one_eye, first=first) as detector:
        pictures = frames(info.path, read=_every(step))
        for number, picture in enumerate(islice(pictures, info.frame_count)):
            if not picture.size:
                continue
            seen[number] = detector.detect(picture)
            if not one_eye:
                textures.update((face, textures_of(picture, face.points)) for face in seen[number])
            if advance is not None:
                advance(number)
    several = sum(len(faces) > 1 for faces in seen.values())
    face = {n: one for n, one in one_face(seen).items() if _inside(one.points, info)}
    eyes_seen = {n: one.points for n, one in face.items()}
    labels = (
        eyes_seen
        if one_eye
        else {n: points for n, points in eyes_seen.items() if abs(turn_deg(points)) < UPRIGHT_DEG}
    )
    _require_upright(info, eyes_seen, labels)
    _require_face(info, labels, len(seen), one_eye)
    unseen = frozenset(seen.keys() - labels.keys())
    covers = {} if one_eye else covered_frames(info, {n: textures[face[n]] for n in labels}, FEWEST)
    open_to_view = {n: points for n, points in labels.items() if n not in covers}
    return Survey(open_to_view, len(seen), several, unseen, covers)


def _first(info: VideoInfo, step: int) -> list[Picture]:
    """Pictures across the first minute or so, to find a close-up's eye in."""
    every = max(step, 8)
    pictures = frames(info.path, read=_every(every))
    return list(islice(pictures, 0, min(info.frame_count, 40 * every), every))


def _every(step: int) -> Callable[[Any], Picture]:
    """Read every step-th frame's colours and nothing of the others: turning a frame into RGB costs most."""
    counter = count()

    def read(frame: Any) -> Picture:
        return rgb(frame) if next(counter) % step == 0 else NOTHING

    return read


def _inside(points: Points, info: VideoInfo) -> bool:
    """Whether all points lie in the picture."""
    return bool((points >= 0).all() and (points <= np.array(info.size_px) - 1).all())


def turn_deg(points: Points) -> float:
    """Angle of the line from the first eye's middle to the second's, clockwise in the picture, in degrees."""
    x, y = points[EYE_POINTS:].mean(0) - points[:EYE_POINTS].mean(0)
    return float(np.degrees(np.arctan2(y, x)))


def _require_upright(info: VideoInfo, eyes_seen: dict[int, Points], upright: dict[int, Points]) -> None:
    turned = [points for n, points in eyes_seen.items() if n not in upright]
    if len(turned) <= len(upright):
        return
    quarter = int(np.median([round(turn_deg(points) / 90) % 4 for points in turned]))
    raise InputError(
        f"{info.path}: the face is turned by {90 * quarter} degrees clockwise on {len(turned)} of "
        f"{len(eyes_seen)} frames that show one: the file's rotation is wrong; turn the video upright first"
    )


def _require_face(info: VideoInfo, labels: dict[int, Points], looked: int, one_eye: bool) -> None:
    more = "" if one_eye else "; for a close-up of one eye add --one-eye"
    if len(labels) < max(FEWEST, LEAST_SEEN * looked):
        raise InputError(
            f"{info.path}: a face was found on {len(labels)} of {looked} frames looked at, too few to track "
            f"without labels{more}; or label frames by hand (--labels)"
        )
    wide = np.array([np.hypot(*(points[5] - points[0])) for points in labels.values()])
    low, high = np.percentile(wide, [5, 95])
    if not one_eye and high > STEADY * max(low, 1e-6):
        raise InputError(
            f"{info.path}: what looks like eyes is {low:.0f} to {high:.0f} px wide over the frames looked "
            f"at: no one face{more}; or label frames by hand (--labels)"
        )


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
    labels = Labels(
        out, info.size_px, default_markers(eyes), {n: good[n] for n in most_varied(good, wanted_frames)}
    )
    save_labels(labels, info.path.name, "detector on single frames, not reviewed")
    return labels


def label_free_lesson(
    info: VideoInfo,
    seen: Survey,
    options: TrainingOptions,
    *,
    one_eye: bool,
    by_hand: Labels | None = None,
    refine: bool | None = None,
) -> Lesson:
    """Train the model on the most varied of the detections; frames labelled by hand win.

    Twelve frames by hand or more train alone: a person and a detector mean slightly different points.
    """
    good = plausible(seen.points)
    hand = {} if by_hand is None else by_hand.frames
    room = max(0, TRAINED_ON - len(hand)) if len(hand) < ENOUGH_BY_HAND else 0
    chosen = {n: good[n] for n in most_varied(good, min(room, len(good)))} if room else {}
    markers = default_markers(1 if one_eye else 2) if by_hand is None else by_hand.markers
    labels = Labels(Path("detections"), info.size_px, markers, dict(sorted((chosen | hand).items())))
    lesson = lesson_from(info, labels, options, refine=refine)
    if len(hand) >= ENOUGH_BY_HAND:
        return lesson
    width = np.mean([widths(points) for points in labels.frames.values()])
    errors = np.hypot(lesson.model.point_errors, DETECTOR_SHARE * float(width))
    return replace(lesson, model=replace(lesson.model, point_errors=errors))
