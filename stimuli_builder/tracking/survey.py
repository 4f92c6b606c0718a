"""What a detector sees of a video: at looks spread over it, the eyes of one face, and which are covered."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import count, islice
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from experiments.errors import InputError
from stimuli_builder.tracking.detector.detection import Detection, one_face, overlap
from stimuli_builder.tracking.detector.mesh import FaceMesh, open_detector
from stimuli_builder.tracking.glare import opening_shares
from stimuli_builder.tracking.shapes import EYE_POINTS, Points, eye_axis
from stimuli_builder.tracking.tracker import UNSEEN
from stimuli_builder.video import Picture, VideoInfo, frames, rgb

# Which eyes are covered: lids follow the region they are read in, and what surrounds them is not as usual.
#
# What a detector draws on a hand or a cloth must not train a model, which would then fit covers as eyes.
# An eye that is shut, pressed shut or turned away is read unsteadily too; but brow, cheek and nose still lie
# around it, which a hand, a sheet or a bar over the eye hides.

Values = NDArray[np.float64]
Flags = NDArray[np.bool_]
Looks = NDArray[np.float32]

LEAST_SPREAD, MAX_SPREAD = 0.055, 0.10
"""Contour spreads below which an eye is seen in any recording, and above which none is."""
UNUSUAL = 2.0
"""Contour spread of a cover, in lower quartiles of the recording's: an eye in a poor picture is read less
steadily than in a sharp one, and covers may be there for most of the time."""
BESIDE = 0.75
"""Part of the limit above which a look belongs to a cover that the look before or after it shows: some
textures are read nearly as steadily, at times, as an eye that blinks."""
STEADY_SHARE = 0.75
"""Part of the least limit up to which a look certainly shows the eye, and its surroundings are its own."""
FAMILIAR, ALIKE = (0.86, 0.90), 0.90
"""Correlation with the surroundings of steady looks from which on an eye is not covered, at the spreads of
UNSTEADIER; and next to a covered look. Shut, half-shut and squinting eyes have 0.90 or more at the best of
PLACES; it is 0.75 or less under a hand, paper, wood or cloth, and up to 0.85 under skin or where a hand or a
cheek comes in."""
UNSTEADIER = (0.065, 0.09)
"""Spreads, hardly more than a shut eye's and as a hand's, between which the correlation needed rises."""
FELLOW = 1.25
"""Spread of the other eye, in its lower quartiles, from which on it moved too: eyes shut and turn together.
A small thing over one eye, with familiar surroundings, leaves the other as it was."""
CLOSED = 0.5
"""Opening of the other eye, in its upper quartiles, below which it shut too: one that is read unsteadily when
open is not read less steadily still when shut."""
WITNESSES = 5
"""So many steady looks must be as familiar: one alone may show a cover as it comes in."""
RING_WIDE, RING_HIGH = 0.68, 0.42
"""Half the width and height of the ellipse that lids move in, in eye's widths: surroundings lie outside."""
ACROSS, DOWN = np.linspace(-1.0, 1.0, 33), np.linspace(-0.9, 0.9, 29)
RING = np.array([(x, y) for y in DOWN for x in ACROSS if np.hypot(x / RING_WIDE, y / RING_HIGH) > 1])
"""Where an eye's surroundings are looked at, from the middle of its canthi, in its widths."""
SMOOTHED = 0.03
"""Blur of the surroundings in eye's widths, so that noise and single lashes count little."""
PLACES = np.array([(x, y, size) for size in (1, 0.92) for y in (0, -0.05, -0.1) for x in (0, -0.05, 0.05)])
"""Where surroundings are looked for: shifts along and down, in eye's widths, and size; the first is the eye's
own. Canthi of a shutting eye are read lower and farther apart, by up to a tenth of its width: surroundings
looked at from there correlated by as little as 0.66 with the open eye's, and by 0.9 where they lie."""
IN_PICTURE = 0.4
"""Part of the surroundings that two looks must both show to be compared."""
COVERED = (
    "{} covered: the lids cannot be tracked reliably, and neither the surroundings nor the other eye "
    "suggest closure"
)
UNSTEADY = "{} covered, closed tightly or turned away: the lids cannot be tracked reliably"
"""Possible meanings of an unsteady contour in a recording without steady frames to compare with."""
NAMES = {(True,): "eye", (True, False): "left eye", (False, True): "right eye", (True, True): "both eyes"}


def covered_frames(
    path: Path,
    spreads: Mapping[int, Sequence[float]],
    fewest: int,
    surroundings: Mapping[int, Looks] | None = None,
    openings: Mapping[int, Values] | None = None,
) -> dict[int, str]:
    """Frames that show a covered eye, and that in words.

    Parameters
    ----------
    path : Path
        Of the video, for the message.
    spreads : dict of int to sequence of float
        Frame that shows eyes -> `contour_spread` of each, as part of its width.
    fewest : int
        Frames without a cover that are needed.
    surroundings : dict of int to float32 array (eyes, places, cells), optional
        Frame -> `surroundings_of` its eyes; without them every unsteady eye is covered.
    openings : dict of int to float64 array (eyes,), optional
        Frame -> how wide each eye is open, as part of its width.

    Returns
    -------
    dict of int to str
        Frame -> which eyes are covered, and why.

    Raises
    ------
    InputError
        Fewer than `fewest` of them show all eyes.
    """
    numbers = sorted(spreads)
    looks = None if surroundings is None else np.array([surroundings[n] for n in numbers])
    of_eyes = np.array([spreads[n] for n in numbers])
    wide = None if openings is None else np.array([openings[n] for n in numbers])
    flags = covered(of_eyes, np.array(numbers), looks, wide)
    compared = (_steady(of_eyes).sum(0) >= WITNESSES) & (looks is not None)
    covers = {
        n: (COVERED if compared[flag].all() else UNSTEADY).format(NAMES[tuple(flag.tolist())])
        for n, flag in zip(numbers, flags, strict=True)
        if flag.any()
    }
    if len(numbers) - len(covers) < fewest:
        raise InputError(
            f"{path}: an eye is covered in {len(covers)} of {len(numbers)} frames that show one; too few are "
            "left to track without labels. Label frames by hand (--labels)"
        )
    return covers


def covered(
    spreads: Values,
    numbers: NDArray[np.int64],
    surroundings: Looks | None = None,
    openings: Values | None = None,
) -> Flags:
    """Which eye is covered at which look.

    Parameters
    ----------
    spreads : float64 array (looks, eyes)
        Of each eye, as part of its width.
    numbers : int64 array (looks,)
        Of their frames, ascending.
    surroundings : float32 array (looks, eyes, places, cells), optional
        See `surroundings_of`.
    openings : float64 array (looks, eyes), optional
        Of each eye, as part of its width.

    Returns
    -------
    bool array (looks, eyes)
    """
    # The lower quartile: half of a recording may show a hand without making it usual.
    limits = np.clip(UNUSUAL * np.percentile(spreads, 25, axis=0), LEAST_SPREAD, MAX_SPREAD)
    moved = spreads > FELLOW * np.percentile(spreads, 25, axis=0)
    if openings is not None:
        moved |= openings < CLOSED * np.percentile(openings, 75, axis=0)
    alike = _likeness_to_steady(spreads, BESIDE * limits, surroundings, moved)
    above = (spreads > limits) & (alike < np.interp(spreads, UNSTEADIER, FAMILIAR))
    # Looks with others between them that show no eyes are not adjacent.
    steps = np.diff(numbers)
    neighbours = (steps <= steps.min(initial=numbers[-1] + 1))[:, None]
    beside = np.zeros_like(above)
    beside[1:] |= above[:-1] & neighbours
    beside[:-1] |= above[1:] & neighbours
    return np.asarray(above | (beside & (spreads > BESIDE * limits) & (alike < ALIKE)))


def _steady(spreads: Values) -> Flags:
    """Which looks certainly show the eye."""
    return np.asarray(spreads <= STEADY_SHARE * LEAST_SPREAD)


def _likeness_to_steady(spreads: Values, least: Values, surroundings: Looks | None, moved: Flags) -> Values:
    """How like steady looks' the surroundings of eyes are whose spread is above `least` (looks, eyes).

    -1 where the recording has too few steady looks, or the other eye has not `moved` (looks, eyes).
    """
    alike = np.full(spreads.shape, -1.0)
    if surroundings is None:
        return alike
    for eye in range(spreads.shape[1]):
        steady = surroundings[_steady(spreads)[:, eye], eye, 0]
        if len(steady) >= WITNESSES:
            for look in np.flatnonzero((spreads[:, eye] > least[eye]) & moved.all(1)):
                # The fifth best of them: a single lucky match does not speak for an eye.
                places = (likenesses(one, steady) for one in surroundings[look, eye])
                alike[look, eye] = max(np.sort(likeness)[-WITNESSES] for likeness in places)
    return alike


def likenesses(one: Looks, others: Looks) -> Values:
    """Correlation of one look's surroundings (cells,) with others' (looks, cells), over what both show.

    0 where both show less than 40% of the cells, or one of them is even.
    """
    known = np.isfinite(one) & np.isfinite(others)
    count = np.maximum(known.sum(1), 1)
    first, second = (np.where(known, values, 0.0) for values in (one, others))
    # Freed of its mean, and by the norm of its contrast: light may change, edges stay.
    first = np.where(known, first - (first.sum(1) / count)[:, None], 0.0)
    second = np.where(known, second - (second.sum(1) / count)[:, None], 0.0)
    norm = np.sqrt((first**2).sum(1) * (second**2).sum(1))
    enough = (count >= IN_PICTURE * known.shape[1]) & (norm > 0)
    return np.where(enough, (first * second).sum(1) / np.maximum(norm, 1e-9), 0.0)


def surroundings_of(picture: Picture, points: Points) -> Looks:
    """Gray levels around each eye, free of its place, size and turn, at `PLACES`; NaN beyond the picture.

    Parameters
    ----------
    picture : uint8 array (h, w, 3)
        RGB.
    points : float64 array (9 * eyes, 2)
        In pixels.

    Returns
    -------
    float32 array (eyes, places, cells)
    """
    looks = []
    for eye in points.reshape(-1, EYE_POINTS, 2):
        along, down, width = eye_axis(eye)
        cells = (PLACES[:, None, 2:] * RING + PLACES[:, None, :2]).reshape(-1, 2)
        at = (eye[0] + eye[5]) / 2 + width * (cells[:, :1] * along + cells[:, 1:] * down)
        last = np.array(picture.shape[1::-1]) - 1
        left, top = np.clip(np.floor(at.min(0)), 0, last).astype(int)
        right, bottom = np.clip(np.ceil(at.max(0)), 0, last).astype(int)
        grey = cv2.cvtColor(
            np.ascontiguousarray(picture[top : bottom + 1, left : right + 1]), cv2.COLOR_RGB2GRAY
        )
        smooth = cv2.GaussianBlur(grey.astype(np.float32), (0, 0), max(0.5, SMOOTHED * width))
        inside = ((at >= 0) & (at <= last)).all(1)
        x, y = (at - [left, top]).astype(np.float32).T
        levels = cv2.remap(smooth, x[None], y[None], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)[0]
        looks.append(np.where(inside, levels, np.nan).reshape(len(PLACES), -1).astype(np.float32))
    return np.array(looks)


NOTHING: Picture = np.empty((0, 0, 3), np.uint8)
LOOKED_AT = 400
LOOKED_AT_IN_PARTS = 8
FEWEST = 6
LEAST_SEEN = 0.3
"""Share of the frames looked at that must show a face: below it, what was found is hardly one."""
UPRIGHT_DEG = 60
"""A line through both eyes that is turned further against the picture's rows indicates a picture on its side
or upside down: left and right, above and below an eye are then not what they are called."""
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
        Faces more than those that are seen at once, too small in the whole picture for the detector to
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
        Too few frames show a face, or what was found is not a face.
    """
    # One pass over the video: decoding takes longer than looking.
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
    wide = {n: opening_shares(points) for n, points in labels.items()}
    covers = covered_frames(info.path, {n: of_face[n].spreads for n in labels}, FEWEST, around, wide)
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
        pictures = frames(info.path, read=_read_every(step))
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
    pictures = frames(info.path, read=_read_every(every))
    return list(islice(pictures, 0, min(info.frame_count, 40 * every), every))


def _read_every(step: int) -> Callable[[Any], Picture]:
    """Read every step-th frame's colors and nothing of the others: turning a frame into RGB costs most."""
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
        f"{len(eyes_seen)} frames that show one: the file's rotation is wrong. Turn the video upright first"
    )


def _require_face(info: VideoInfo, labels: dict[int, Points], looked: int, one_eye: bool) -> None:
    more = "" if one_eye else "; for a close-up of one eye add --one-eye"
    if len(labels) < max(FEWEST, LEAST_SEEN * looked):
        raise InputError(
            f"{info.path}: a face was found in {len(labels)} of {looked} frames, too few to track without "
            f"labels{more}; or label frames by hand (--labels)"
        )
    wide = np.array([np.hypot(*(points[5] - points[0])) for points in labels.values()])
    # Without the outermost looks: single misreadings do not make a second face.
    low, high = np.percentile(wide, [5, 95])
    if not one_eye and high > STEADY * max(low, 1e-6):
        raise InputError(
            f"{info.path}: the detected eyes are {low:.0f} to {high:.0f} px wide, which is not one "
            f"face{more}; or label frames by hand (--labels)"
        )


def _require_agreement(info: VideoInfo, detections: Sequence[Detection]) -> None:
    shares = np.array([np.mean(one.mirror_shares) for one in detections])
    known = shares[np.isfinite(shares)]
    if 2 * len(known) < len(shares):
        told = f"is not detected in the mirror image of {len(shares) - len(known)} of {len(shares)} frames"
    elif (share := float(np.median(known))) > UNSURE_SHARE:
        told = (
            f"is read differently in the mirror image (by {share:.0%} of the eyes' width, {UNSURE_SHARE:.1%} "
            "is the most of a face that can be read)"
        )
    else:
        return
    raise InputError(
        f"{info.path}: the detected face {told}; for a close-up of one eye add --one-eye; or label frames by "
        "hand (--labels). Drawn faces always need labels: `stimuli actor --labels` writes them"
    )
