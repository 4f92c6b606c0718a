"""What a detector sees of a video: at looks spread over it, the eyes of one face, and which are covered."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from itertools import count, islice
from typing import Any

import numpy as np

from experiments.errors import InputError
from stimuli_builder.tracking.covers import covered_frames, surroundings_of
from stimuli_builder.tracking.detector.detection import Detection
from stimuli_builder.tracking.detector.face_mesh import FaceMesh
from stimuli_builder.tracking.detector.mesh import open_detector
from stimuli_builder.tracking.detector.one_face import one_face, overlap
from stimuli_builder.tracking.shapes import EYE_POINTS, Points
from stimuli_builder.tracking.tracker import UNSEEN
from stimuli_builder.video import Picture, VideoInfo, frames, rgb

NOTHING: Picture = np.empty((0, 0, 3), np.uint8)
LOOKED_AT = 400
LOOKED_AT_IN_PARTS = 8
FEWEST = 6
LEAST_SEEN = 0.3
"""Share of the frames looked at that must show a face: below it, what was found is hardly one."""
UPRIGHT_DEG = 60
"""A line through both eyes that is turned further against the picture's rows tells a picture on its side or
upside down: left and right, above and below an eye are then not what they are called."""
STEADY = 3.0
"""Eyes' widths over the frames looked at stay within this factor, or they belong to no one face."""
UNSURE_SHARE = 0.075
"""A face is read within this part of its eyes' widths in pictures and their mirror images, as the median of
the frames looked at: 0.02 to 0.05 of a real face and of rendered ones, in noise and blur too; 0.10 of eyes
drawn without a face, whose lids were 5% off."""


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
    further : int
        Faces more than those that are seen at once, too small beside the whole picture for the detector to
        see them there: the second most in a frame looked at in parts, the most of up to two frames.
    unseen : frozenset of int
        Frames looked at in which the eyes of that face were not seen, or not wholly in the picture.
    covered : dict of int to str
        Frames looked at in which one of its eyes is covered, and that in words; they have no points.
    """

    points: dict[int, Points]
    looked_at: int
    several_faces: int
    further: int = 0
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
    seen, further = _looked(info, one_eye, advance)
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
    if not one_eye:
        _require_agreement(info, [of_face[n] for n in labels])
    unseen = frozenset(seen.keys() - labels.keys())
    around = {n: look for n in labels if (look := of_face[n].surroundings) is not None}
    covers = covered_frames(info.path, {n: of_face[n].spreads for n in labels}, FEWEST, around)
    open_to_view = {n: points for n, points in labels.items() if n not in covers}
    return Survey(open_to_view, len(seen), several, further, unseen, covers)


def _looked(
    info: VideoInfo, one_eye: bool, advance: Callable[[int], None] | None
) -> tuple[dict[int, list[Detection]], int]:
    """What a detector sees at each look, and the further faces seen in parts of some of them."""
    step = max(1, -(-info.frame_count // LOOKED_AT))
    seen: dict[int, list[Detection]] = {}
    further, in_parts = [0], step * max(1, -(-info.frame_count // step // LOOKED_AT_IN_PARTS))
    with open_detector(one_eye=one_eye, first=_first(info, step) if one_eye else ()) as detector:
        pictures = frames(info.path, read=_every(step))
        for number, picture in enumerate(islice(pictures, info.frame_count)):
            if not picture.size:
                continue
            seen[number] = [
                replace(one, surroundings=surroundings_of(picture, one.points))
                for one in detector.detect(picture)
            ]
            if isinstance(detector, FaceMesh) and seen[number] and number % in_parts == 0:
                further.append(further_faces(detector, picture, seen[number]))
            if advance is not None:
                advance(number)
    # one frame alone may show what the mesh takes for a face
    return seen, sorted(further)[-2] if len(further) > 2 else max(further)


def further_faces(mesh: FaceMesh, picture: Picture, seen: Sequence[Detection]) -> int:
    """Faces that are seen in parts of a picture only: squares of its shorter side, each half over the next.

    The detector shrinks a picture to a small square first, so that a face below a tenth of it is not found.
    """
    height, width = picture.shape[:2]
    side, long = min(height, width), max(height, width)
    known = list(seen)
    for start in np.linspace(0, long - side, max(2, round(2 * long / side) - 1)).astype(int).tolist():
        x, y = (start, 0) if width >= height else (0, start)
        part = np.ascontiguousarray(picture[y : y + side, x : x + side])
        for face in mesh.faces(part):
            in_picture = face.moved(x, y)
            if all(overlap(in_picture, other) == 0 for other in known):
                known.append(in_picture)
    return len(known) - len(seen)


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


def _require_agreement(info: VideoInfo, detections: Sequence[Detection]) -> None:
    shares = np.array([np.mean(one.mirror_shares) for one in detections])
    known = shares[np.isfinite(shares)]
    if 2 * len(known) < len(shares):
        told = f"is not seen in the mirror image on {len(shares) - len(known)} of {len(shares)} frames"
    elif (share := float(np.median(known))) > UNSURE_SHARE:
        told = (
            f"is read differently in the mirror image (by {share:.0%} of the eyes' width, {UNSURE_SHARE:.1%} "
            "is the most of a face that can be read)"
        )
    else:
        return
    raise InputError(
        f"{info.path}: what looks like a face {told}; for a close-up of one eye add --one-eye; or label "
        "frames by hand (--labels)"
    )
