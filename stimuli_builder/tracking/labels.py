"""Label files: landmarks a person placed on a few frames of a video, checked before anything is learned."""

import json
import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from experiments.errors import InputError, counted
from experiments.files import whole_text
from stimuli_builder.tracking.shapes import EYE_POINTS, LidMarkers, Points, default_markers, eye_axis

# Whether the points of a label file can be the lids of eyes.

# As parts of the eye's width.
ORDER_TOLERANCE = 0.06
CROSSING_TOLERANCE = 0.12


def check_frame(where: str, points: Points, eyes: int, size: tuple[int, int]) -> None:
    """Refuse points of a frame that lie outside its picture, or that no eye has.

    Parameters
    ----------
    where : str
        File and frame, to begin the line with.
    points : (9 or 18, 2) float64 array
        In pixels.
    eyes : int
    size : (int, int)
        Width and height of the picture.

    Raises
    ------
    InputError
        One line that names the first wrong point.
    """
    # Pixel centers are whole numbers, so a picture reaches half a pixel beyond them.
    outside = np.flatnonzero(((points < -0.5) | (points > np.array(size) - 0.5)).any(1))
    if len(outside):
        x, y = points[outside[0]]
        raise InputError(
            f"{where}: point {outside[0] + 1} at ({x:g}, {y:g}) is outside the picture "
            f"of {size[0]} x {size[1]}"
        )
    centres = [
        points[start : start + EYE_POINTS].mean(0)[0] for start in range(0, eyes * EYE_POINTS, EYE_POINTS)
    ]
    # By the middle of each eye: single points of a tilted face may overlap.
    if centres != sorted(centres):
        raise InputError(f"{where}: the eyes are swapped; points 1 to 9 belong to the image-left eye")
    for eye in range(eyes):
        _check_eye(where, points[EYE_POINTS * eye : EYE_POINTS * (eye + 1)], EYE_POINTS * eye)


def _check_eye(where: str, eye: Points, first: int) -> None:
    """Refuse an eye whose outline crosses itself by more than the wobble of a closed eye's labels."""
    # Before the axis below, which such canthi do not define.
    if np.hypot(*(eye[5] - eye[0])) < 4:
        raise InputError(
            f"{where}: canthi {first + 1} and {first + 6} are less than 4 px apart; label a larger eye"
        )
    along, down, width = eye_axis(eye)
    x, y = (eye - eye[0]) @ along / width, (eye - eye[0]) @ down / width
    # The image-right eye is mirrored: its points run from right to left.
    sign = 1.0 if x[5] > 0 else -1.0
    # The canthi belong to both lids.
    upper, lower = sign * x[:6], sign * x[[5, 6, 7, 8, 0]]
    for order, names in ((np.diff(upper), range(6)), (-np.diff(lower), (5, 6, 7, 8, 0))):
        wrong = np.flatnonzero(order < -ORDER_TOLERANCE)
        if len(wrong):
            a, b = list(names)[wrong[0]], list(names)[wrong[0] + 1]
            raise InputError(
                f"{where}: points {first + a + 1} and {first + b + 1} cross; check the point order"
            )
    # Sorted, since labels may wobble within the tolerance and `np.interp` needs rising numbers.
    steps = np.argsort(upper)
    upper_y = np.interp(sign * x[6:9], upper[steps], y[:6][steps])
    crossed = np.flatnonzero(upper_y - y[6:9] > CROSSING_TOLERANCE)
    if len(crossed):
        raise InputError(
            f"{where}: lower-lid point {first + 7 + crossed[0]} is above the upper lid; correct the points"
        )


FEWEST_FRAMES = 3
POINT_ORDER = (
    "9 points per eye, image-left eye first: outer canthus, 4 upper-lid points outer to inner, inner "
    "canthus, 3 lower-lid points inner to outer; image-right eye mirrored"
)


@dataclass(frozen=True)
class Labels:
    """Landmarks of labeled frames.

    Attributes
    ----------
    size_px : (int, int)
        (width, height) of the video they belong to.
    frames : dict of int to float64 array
        Frame number -> (18, 2) or, for one eye, (9, 2) points in pixels, x right, y down.
    proposed : dict of int to float64 array or None
        What a program proposed for frames that nobody has accepted since; None where the file does not say.
    origin : str
        Where the points come from, in the words of the file's author.
    """

    path: Path
    size_px: tuple[int, int]
    markers: LidMarkers
    frames: dict[int, Points]
    proposed: dict[int, Points] | None = None
    origin: str = ""

    @property
    def eyes(self) -> int:
        """One or two."""
        return self.markers.eyes


def load_labels(
    path: Path,
    size_px: tuple[int, int] | None = None,
    frame_count: int | None = None,
    fewest: int = FEWEST_FRAMES,
) -> Labels:
    """Read and check a label file.

    Parameters
    ----------
    size_px, frame_count : (int, int), int
        Of the video the labels are to be used with; checked where given.
    fewest : int
        Frames that must be labeled.

    Raises
    ------
    InputError
        One line: what was expected, what came, in which frame.
    """
    document = _document(path)
    width, height = _size(path, document)
    if size_px is not None and (width, height) != tuple(size_px):
        raise InputError(
            f"{path}: labels were made on {width} x {height} pixels, but the video has {size_px[0]} x "
            f"{size_px[1]}; use the labeled video"
        )
    frames = _frames(path, document.get("frames"), fewest)
    # All frames have the same number of points, as `_frames` has checked.
    eyes = len(next(iter(frames.values()))) // EYE_POINTS
    for number, points in frames.items():
        check_frame(f"{path}: frame {number}", points, eyes, (width, height))
        if frame_count is not None and number >= frame_count:
            raise InputError(
                f"{path}: frame {number} is labeled, but the video ends at frame {frame_count - 1}"
            )
    # Only a note for people: another type in its place is not worth an error.
    origin = document.get("origin")
    return Labels(
        path,
        (width, height),
        _markers(path, document, eyes),
        frames,
        _proposed(path, document.get("proposed")),
        origin if isinstance(origin, str) else "",
    )


def _document(path: Path) -> dict[str, Any]:
    # JSON would keep the last of two equal names and say nothing.
    def unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        seen = dict(pairs)
        if len(seen) < len(pairs):
            names = [name for name, _ in pairs]
            twice = next(name for name in names if names.count(name) > 1)
            raise InputError(f"{path}: '{twice}' occurs twice; keep one set of points for each frame")
        return seen

    try:
        document = json.loads(path.read_text(encoding="utf-8"), object_pairs_hook=unique)
    except FileNotFoundError as error:
        raise InputError(f"{path}: expected a label file, found none; check the path") from error
    except (OSError, UnicodeDecodeError, json.JSONDecodeError) as error:
        raise InputError(f"{path}: not a label file in JSON ({error})") from error
    if not isinstance(document, dict):
        raise InputError(f"{path}: expected a JSON object with 'image_size_px' and 'frames'")
    return document


def _size(path: Path, document: dict[str, Any]) -> tuple[int, int]:
    size = document.get("image_size_px")
    # By `type`, since `isinstance` takes true and false for whole numbers.
    whole = isinstance(size, list) and len(size) == 2 and all(type(side) is int and side > 0 for side in size)
    if size is None:
        raise InputError(f"{path}: 'image_size_px' is missing; expected [width, height] of the video")
    if not whole:
        raise InputError(f"{path}: expected 'image_size_px': [width, height], found {size!r}")
    return size[0], size[1]


def _proposed(path: Path, data: object) -> dict[int, Points] | None:
    if data is None:
        return None
    if not isinstance(data, dict):
        raise InputError(
            f"{path}: expected 'proposed': {{frame number: points}}, found {type(data).__name__}"
        )
    return {_number(path, key): _points(f"{path}: proposed frame {key}", data[key]) for key in data}


def _number(path: Path, key: object) -> int:
    # JSON has only texts as keys; decimals and signs are not frames.
    if not str(key).strip().isdecimal():
        raise InputError(f"{path}: expected a frame number from 0, found '{key}'")
    return int(str(key))


def _frames(path: Path, data: object, fewest: int) -> dict[int, Points]:
    if data is None:
        raise InputError(f"{path}: 'frames' is missing; expected the points of each labeled frame")
    if not isinstance(data, dict):
        raise InputError(f"{path}: expected 'frames': {{frame number: points}}, found {type(data).__name__}")
    if len(data) < fewest:
        raise InputError(
            f"{path}: {len(data)} labeled frames, but at least {fewest} are needed and about 20 are "
            "recommended"
        )
    frames: dict[int, Points] = {}
    for key, points in data.items():
        number = _number(path, key)
        # Names such as 7 and 07 are different texts and one number.
        if number in frames:
            raise InputError(f"{path}: frame {number} occurs twice; keep one set of points for each frame")
        frames[number] = _points(f"{path}: frame {number}", points)
    counts = sorted({len(points) for points in frames.values()})
    if len(counts) > 1:
        raise InputError(
            f"{path}: some frames have {counts[0]} points and some {counts[-1]}; use the same number "
            "everywhere"
        )
    # In the order of the video, whatever the order in the file.
    return dict(sorted(frames.items()))


def _points(where: str, data: object) -> Points:
    if not isinstance(data, list) or len(data) not in (EYE_POINTS, 2 * EYE_POINTS):
        count = len(data) if isinstance(data, list) else "no list of"
        raise InputError(f"{where}: expected 18 points (or 9 for one eye), found {count}")
    for index, point in enumerate(data):
        pair = isinstance(point, list) and len(point) == 2
        # By `type`, since true and false are numbers to `isinstance`.
        if not pair or not all(type(v) in (int, float) and math.isfinite(v) for v in point):
            raise InputError(f"{where}: point {index + 1} is {point!r}, expected [x, y] in pixels")
    return np.asarray(data, np.float64)


def _markers(path: Path, document: dict[str, Any], eyes: int) -> LidMarkers:
    default = default_markers(eyes)
    chosen = []
    for key, fallback in (("mid_upper", default.upper), ("mid_lower", default.lower)):
        given = document.get(key, [list(eye) for eye in fallback])
        if not isinstance(given, list) or len(given) != eyes:
            raise InputError(f"{path}: expected '{key}' with one list of points for each of {eyes} eyes")
        for number, eye in enumerate(given):
            # Markers of an eye must be points of that eye.
            allowed = range(EYE_POINTS * number, EYE_POINTS * (number + 1))
            if (
                not isinstance(eye, list)
                or not eye
                or any(type(p) is not int or p not in allowed for p in eye)
            ):
                raise InputError(
                    f"{path}: '{key}' names {eye!r}, expected points {allowed[0]} to {allowed[-1]}"
                )
        chosen.append(tuple(tuple(eye) for eye in given))
    return LidMarkers(chosen[0], chosen[1])


def save_labels(labels: Labels, video: str, origin: str) -> None:
    """Write a label file at `labels.path`, in the form `load_labels` reads; points to 0.001 px."""
    document: dict[str, Any] = {
        "video": video,
        "image_size_px": list(labels.size_px),
        "origin": origin,
        "point_order": POINT_ORDER,
        "mid_upper": [list(eye) for eye in labels.markers.upper],
        "mid_lower": [list(eye) for eye in labels.markers.lower],
        "frames": _rounded(labels.frames),
    }
    # A missing key says that nothing is known of proposals; an empty one that none are left.
    if labels.proposed is not None:
        document["proposed"] = _rounded(labels.proposed)
    with whole_text(labels.path) as stream:
        json.dump(document, stream, indent=1)
        stream.write("\n")


def _rounded(frames: dict[int, Points]) -> dict[str, Any]:
    return {str(number): np.round(points, 3).tolist() for number, points in frames.items()}


# Which frames of a label file somebody has changed or accepted, and which are as a program proposed them.

DETECTED = "detector on single frames, not reviewed"
TRACKED = "proposed by the tracker for correction by hand"
SAME_PX = 0.0006
"""Points are written to 0.001 px: what nobody moved comes back nearer than this."""


def as_proposed(labels: Labels) -> frozenset[int]:
    """Frames whose points are still those proposed, and which nobody has accepted.

    The labeling page keeps accepted frames alone, and leaves no proposal standing for them.
    """
    proposed = labels.proposed or {}
    return frozenset(
        number
        for number, points in labels.frames.items()
        if number in proposed
        and proposed[number].shape == points.shape
        and np.abs(points - proposed[number]).max() < SAME_PX
    )


def by_hand(labels: Labels) -> Labels:
    """The same file with the frames alone that a person changed or accepted; there may be none."""
    waiting = as_proposed(labels)
    return replace(labels, frames={n: points for n, points in labels.frames.items() if n not in waiting})


def unreviewed_note(labels: Labels) -> str:
    """A line where labels given to be learnt from hold frames that nobody saw; empty where none is known."""
    waiting, count = len(as_proposed(labels)), len(labels.frames)
    if waiting:
        return (
            f"{labels.path}: {waiting} of {counted(count, 'frame')} are unreviewed proposals, which are used "
            "for training as they are: correct or accept each on the labeling page"
        )
    # An earlier version wrote such files without their proposals.
    if labels.proposed is None and labels.origin in (DETECTED, TRACKED):
        return (
            f"{labels.path}: its origin is '{labels.origin}' and it has no proposals, so reviewed frames "
            "cannot be identified; save it on the labeling page when they are correct"
        )
    return ""


def unmarked_note(labels: Labels) -> str:
    """A line where a file of `--relabel` is of a version that marked no proposals; empty else."""
    if labels.proposed is not None or labels.origin != TRACKED:
        return ""
    return (
        f"{labels.path}: an earlier version wrote it without proposals, so all its "
        f"{counted(len(labels.frames), 'frame')} count as corrected; if they are not, remove it and run again"
    )
