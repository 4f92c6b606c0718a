"""What a detector of eyes gives, whichever it is: lid contours as the tracker's points."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, Protocol, Self

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from stimuli_builder.tracking.shapes import Points
from stimuli_builder.video import Picture

UPPER_SHARES = (0.2, 0.4, 0.6, 0.8)
LOWER_SHARES = (0.25, 0.5, 0.75)


@dataclass(frozen=True, eq=False)
class Detection:
    """The eyes of one face in one picture.

    Attributes
    ----------
    points : float64 array
        (18, 2) or, for one eye, (9, 2) in pixels, in the order of label files.
    iris : float64 array (eyes, 5, 2)
        Center and four points of each iris's edge.
    box : float64 array (4,)
        Least x and y, then greatest x and y, of the face; of the eye in a close-up.
    spreads : tuple of float
        Of each eye, how steadily it is read: its `contour_spread` and, for a face, half of its mirror share,
        added in quadrature.
    mirror_shares : tuple of float
        Of each eye of a face, mean distance of its points as read in the picture from those of its mirror
        image, as part of the eye's width; infinite where the mirror image does not show the face.
    surroundings : float32 array (eyes, places, cells) or None
        What lies around each eye, see `survey.surroundings_of`; None where nobody looked.
    """

    points: Points
    iris: Points
    box: Points
    spreads: tuple[float, ...]
    mirror_shares: tuple[float, ...] = ()
    surroundings: NDArray[np.float32] | None = None

    @property
    def area_px2(self) -> float:
        """Area of the box in square pixels."""
        return float(np.prod(self.box[2:] - self.box[:2]))

    def moved(self, x: float, y: float) -> Self:
        """The detection, so many pixels to the right and down."""
        by = np.array([x, y])
        return replace(self, points=self.points + by, iris=self.iris + by, box=self.box + np.tile(by, 2))


class LidDetector(Protocol):
    """Finds the eyes of faces in one picture, without a memory of the one before."""

    eyes: int

    def detect(self, picture: Picture) -> list[Detection]:
        """Return the eyes of each face in an RGB picture (h, w, 3), the largest first."""


def eye_points(upper: Points, lower: Points) -> Points:
    """Nine points of an eye from its contours.

    Parameters
    ----------
    upper, lower : float64 array (k, 2)
        Contours from the outer canthus to the inner, and from the inner to the outer.
    """
    return np.concatenate(
        [upper[:1], along(upper, UPPER_SHARES), upper[-1:], along(lower, LOWER_SHARES)], axis=0
    )


def contour_spread(contours: Points, width: float) -> float:
    """How far an eye's contour moves with the region that it is read in, as part of the eye's width.

    An eye, open or shut, stays where it is. Where there is none a network draws one all the same, in the
    middle of whatever region it is shown.

    Parameters
    ----------
    contours : float64 array (views, k, 2)
        The same points as read in several regions, in pixels of the picture.
    width : float
        Of the eye, in pixels.

    Returns
    -------
    float
        Root mean square distance of the points from their means.
    """
    away = contours - contours.mean(0)
    return float(np.sqrt((away**2).sum(-1).mean()) / width)


def along(curve: Points, shares: Sequence[float]) -> Points:
    """Points of a polyline (k, 2) at shares of its length."""
    steps = np.hypot(*np.diff(curve, axis=0).T)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    targets = np.array(shares) * along[-1]
    return np.stack([np.interp(targets, along, curve[:, axis]) for axis in (0, 1)], axis=1)


# The squares in which the iris network reads an eye, and what it answers with.

SIDE_OF_WIDTH = 2.9
"""Side of the region in which an eye is read, in its widths."""
VIEWS = tuple((dy, turn) for dy in (-0.24, -0.16, -0.08) for turn in (-10, 0, 10))
"""A close-up's eye is read in all of these and the mean taken: shift down in its widths, turn in degrees."""


class Region(NamedTuple):
    """A square that the iris network sees: middle and side in pixels, mirrored or not, turn in degrees."""

    x: float
    y: float
    side: float
    flip: bool
    turn: float = 0.0

    def views(self, width: float) -> "list[Region]":
        """The regions about this one in which an eye of such a width in pixels is read."""
        return [Region(self.x, self.y + dy * width, self.side, self.flip, turn) for dy, turn in VIEWS]


def contours_of(eyes: Sequence[Any]) -> Points:
    """What the iris network answers with, as contours (eyes, 16, 2)."""
    # Both ends of the lower contour are those of the upper one.
    return np.array([[*upper, *lower[1:-1]] for upper, lower, _ in eyes])


# One face through a recording that shows several: which is larger may change, whose track it is may not.

NEAR = 0.5
"""A face is the one before if its middle has moved by less than this part of the wider one's width."""
LIKE = 1.6
"""Faces may be one person's if the wider is at most this many times as wide as the other. Not by height:
a blink or an open mouth changes that."""
TWICE = 0.5
"""Boxes of one frame that share more than this part of the area they cover together show one face."""
MISSED, MAX_MISSED = 0.05, 10
"""For each look at which it was not seen, at most ten, a face counts as this part of a width further away."""
BESIDE = 0.1
"""Two pieces that are both seen in more than this part of the shorter one's frames are two people."""
Face = dict[int, Detection]
"""Frame -> where a face is in it."""


def one_face(seen: Mapping[int, Sequence[Detection]]) -> Face:
    """Frame -> the face to be tracked: the one that is larger over the whole recording.

    Faces are followed from look to look by place and size. Pieces of similar size that are hardly ever seen
    together are joined (a person who moved far, a gap, a cut), then the largest summed area is taken: mean
    area times share of frames. A face of another size never replaces it where this one is not seen.

    Parameters
    ----------
    seen : mapping of int to sequence of Detection
        Frame looked at -> all faces seen in it, boxes in pixels.

    Returns
    -------
    dict of int to Detection
        In order of frames; without those in which the face is not seen.
    """
    pieces = sorted(_followed(seen), key=_summed_area, reverse=True)
    people, left = [], pieces
    while left:
        person, left = _joined(left[0], left[1:])
        people.append(person)
    if not people:
        return {}
    # A smaller person may have got pieces of the larger one first, in frames where only these are seen.
    whole, _ = _joined(max(people, key=_summed_area), pieces)
    return dict(sorted(whole.items()))


def _followed(seen: Mapping[int, Sequence[Detection]]) -> list[Face]:
    """Pieces: every face as its frames for as long as place and size show that it is the same."""
    pieces: list[Face] = []
    last_look: list[int] = []
    for look, number in enumerate(sorted(seen)):
        detections = _each_once(seen[number])
        missed = [look - last - 1 for last in last_look]
        before = [piece[max(piece)] for piece in pieces]
        continued = _continued(before, missed, detections)
        for index, detection in enumerate(detections):
            which = continued.get(index, len(pieces))
            if which == len(pieces):
                pieces.append({})
                last_look.append(look)
            pieces[which][number] = detection
            last_look[which] = look
    return pieces


def _each_once(detections: Sequence[Detection]) -> list[Detection]:
    """The detections of one frame, largest first, without smaller ones of the same face."""
    kept: list[Detection] = []
    for detection in sorted(detections, key=lambda one: one.area_px2, reverse=True):
        if all(overlap(detection, other) <= TWICE for other in kept):
            kept.append(detection)
    return kept


def _continued(
    before: Sequence[Detection], missed: Sequence[int], now: Sequence[Detection]
) -> dict[int, int]:
    """Index of a detection -> index of the face before that it is, by the least total distance."""
    never = NEAR + MISSED * MAX_MISSED
    cost = np.full((len(before), len(now)), never)
    for row, (one, looks) in enumerate(zip(before, missed, strict=True)):
        for column, other in enumerate(now):
            away = _away(one, other)
            if away < NEAR and _like(_width(one), _width(other)):
                cost[row, column] = away + MISSED * min(looks, MAX_MISSED)
    rows, columns = linear_sum_assignment(cost)
    # Pairs at the cost of `never` are those for which nothing else was left.
    pairs = zip(rows.tolist(), columns.tolist(), strict=True)
    return {column: row for row, column in pairs if cost[row, column] < never}


def _joined(first: Face, others: Sequence[Face]) -> tuple[Face, list[Face]]:
    """A piece with all others of its size that are not seen together with it, and the remaining ones."""
    person, left = dict(first), []
    width = _mean_width(first)
    for other in others:
        beside = len(person.keys() & other.keys())
        if _like(width, _mean_width(other)) and beside <= BESIDE * min(len(person), len(other)):
            person = other | person  # only free frames are added
        else:
            left.append(other)
    return person, left


def _away(before: Detection, now: Detection) -> float:
    """Distance of the middles of two faces, as part of the wider one's width."""
    between = (now.box[:2] + now.box[2:] - before.box[:2] - before.box[2:]) / 2
    return float(np.hypot(*between) / max(_width(before), _width(now), 1e-6))


def overlap(one: Detection, other: Detection) -> float:
    """Area that two boxes share, as part of the area they cover together."""
    sides = np.minimum(one.box[2:], other.box[2:]) - np.maximum(one.box[:2], other.box[:2])
    shared = float(np.prod(np.maximum(sides, 0)))
    return shared / max(one.area_px2 + other.area_px2 - shared, 1e-6)


def _like(one: float, other: float) -> bool:
    """Whether two widths in pixels may be of one face."""
    return max(one, other) <= LIKE * min(one, other)


def _summed_area(face: Mapping[int, Detection]) -> float:
    """Area of a face in square pixels, summed over its frames."""
    return sum(detection.area_px2 for detection in face.values())


def _width(detection: Detection) -> float:
    """Width of a face in pixels."""
    return float(detection.box[2] - detection.box[0])


def _mean_width(face: Mapping[int, Detection]) -> float:
    """Mean width of a face in pixels."""
    return sum(_width(detection) for detection in face.values()) / len(face)
