"""What a detector sees of a video: at looks spread over it, the eyes of one face, and which are covered."""

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import count, islice
from typing import Any

import numpy as np

from experiments.errors import InputError
from stimuli_builder.tracking.covers import covered_frames
from stimuli_builder.tracking.detector.detection import Detection
from stimuli_builder.tracking.detector.mesh import open_detector
from stimuli_builder.tracking.detector.one_face import one_face
from stimuli_builder.tracking.shapes import EYE_POINTS, Points
from stimuli_builder.tracking.tracker import UNSEEN
from stimuli_builder.video import Picture, VideoInfo, frames, rgb

NOTHING: Picture = np.empty((0, 0, 3), np.uint8)
LOOKED_AT = 400
FEWEST = 6
LEAST_SEEN = 0.3
"""Share of the frames looked at that must show a face: below it, what was found is hardly one."""
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
    seen = _looked(info, one_eye, advance)
    several = sum(len(faces) > 1 for faces in seen.values())
    of_face = {n: one for n, one in one_face(seen).items() if _inside(one.points, info)}
    eyes_seen = {n: one.points for n, one in of_face.items()}
    labels = (
        eyes_seen
        if one_eye
        else {n: points for n, points in eyes_seen.items() if abs(turn_deg(points)) < UPRIGHT_DEG}
    )
    _require_upright(info, eyes_seen, labels)
    _require_face(info, labels, len(seen), one_eye)
    unseen = frozenset(seen.keys() - labels.keys())
    covers = covered_frames(info.path, {n: of_face[n].spreads for n in labels}, FEWEST)
    open_to_view = {n: points for n, points in labels.items() if n not in covers}
    return Survey(open_to_view, len(seen), several, unseen, covers)


def _looked(
    info: VideoInfo, one_eye: bool, advance: Callable[[int], None] | None
) -> dict[int, list[Detection]]:
    """What a detector sees at each look."""
    step = max(1, -(-info.frame_count // LOOKED_AT))
    seen: dict[int, list[Detection]] = {}
    with open_detector(one_eye=one_eye, first=_first(info, step) if one_eye else ()) as detector:
        pictures = frames(info.path, read=_every(step))
        for number, picture in enumerate(islice(pictures, info.frame_count)):
            if not picture.size:
                continue
            seen[number] = detector.detect(picture)
            if advance is not None:
                advance(number)
    return seen


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
