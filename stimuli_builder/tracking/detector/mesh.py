"""The detector that ships: MediaPipe's face mesh with refined lids, or its iris network on a close-up."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from experiments.errors import InputError
from stimuli_builder.tracking.detector.detection import Detection, LidDetector, contour_spread, eye_points
from stimuli_builder.tracking.detector.mesh_client import MeshClient, detector_environment
from stimuli_builder.tracking.shapes import Points, eye_axis, widths
from stimuli_builder.video import Picture

LEAST_EYE_PX = 10
FACES_ASKED = 5
"""Pictures of a close-up in which a whole face is looked for: what is no close-up gives lids of a cheek."""
SAME_FACE = 0.2
"""Parts of an eye's width within which a face lies where its mirror image does: 0.03 or less in a recording
of a face, 0.3 or more where the mesh saw faces in a close-up."""
REGION_SIDES = (0.9, 1.2, 1.5, 1.9, 2.4)
"""Sides of the regions tried in a close-up, as parts of the picture's height."""
REGION_SHIFTS = (-0.18, 0.0, 0.18)
JITTERS = ((0, 0, 0.9), (0, 0, 1.1), (0.05, 0, 1.0), (0, 0.05, 1.0))
SIDE_OF_WIDTH = 2.9
"""Side of the region in which a close-up's eye is read, in widths of the eye as found."""
VIEWS = tuple((dy, turn) for dy in (-0.24, -0.16, -0.08) for turn in (-10, 0, 10))
"""The eye is read in all of these and the mean is taken: shift down in its widths, turn in degrees."""
FACE_VIEWS = ((-0.2, 1.0), (0.2, 1.0), (0.0, 0.8), (0.0, 1.25))
"""A face's eye is read in these besides, to tell whether one is there: shift along it in widths, and size.
Those of another size tell an eye of which a half is covered too."""
JITTERED = 4
"""Pictures in which the regions tried are jittered."""
LAID_ON = 9
"""Pictures over which the region is laid on the eye."""


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


def views_of(eye: Points, *, flip: bool) -> list[Region]:
    """The regions in which a face's eye (9, 2) is read; the iris network knows one side's eyes."""
    along, _, width = eye_axis(eye)
    turn = float(np.degrees(np.arctan2(along[1], along[0])))
    middles = [(eye[0] + eye[5]) / 2 + shift * width * along for shift, _ in FACE_VIEWS]
    sides = [SIDE_OF_WIDTH * width * size for _, size in FACE_VIEWS]
    return [Region(float(x), float(y), side, flip, turn) for (x, y), side in zip(middles, sides, strict=True)]


def _about(picture: Picture, views: Sequence[Region]) -> tuple[Picture, list[Region]]:
    """The part of a picture that views see, a side wide about each, and the views in it."""
    at, side = np.array([[view.y, view.x] for view in views]), max(view.side for view in views)
    last = np.array(picture.shape[:2]) - 1
    # At least a pixel, where a face's eyes are thought beyond the picture.
    top, left = np.clip((at.min(0) - side).astype(np.int64), 0, last).tolist()
    bottom, right = np.clip((at.max(0) + side).astype(np.int64), 0, last).tolist()
    part = np.ascontiguousarray(picture[top : bottom + 1, left : right + 1])
    return part, [view._replace(x=view.x - left, y=view.y - top) for view in views]


def contours_of(eyes: Sequence[Any]) -> Points:
    """What the iris network answers with, as contours (eyes, 16, 2)."""
    return np.array([[*upper, *lower[1:-1]] for upper, lower, _ in eyes])


class FaceMesh:
    """Both eyes of every face in a picture."""

    eyes = 2

    def __init__(self, client: MeshClient):
        self._client = client

    def detect(self, picture: Picture) -> list[Detection]:
        """Return the eyes of the faces whose eyes are 10 px wide or more, the largest face first."""
        faces = self.faces(picture)
        return [replace(one, spreads=self._spreads(picture, one.points.reshape(2, -1, 2))) for one in faces]

    def faces(self, picture: Picture) -> list[Detection]:
        """The same without the eyes' `spreads`, which take longest."""
        eyes_of_faces = []
        for face in self._client.ask("faces", picture)["faces"]:
            eyes = [eye_points(np.array(upper), np.array(lower)) for upper, lower, _ in face["eyes"]]
            if min(eye_axis(eye)[2] for eye in eyes) >= LEAST_EYE_PX:
                iris = np.array([iris for _, _, iris in face["eyes"]])
                eyes_of_faces.append(Detection(np.concatenate(eyes), iris, np.array(face["box"]), ()))
        return sorted(eyes_of_faces, key=lambda one: one.area_px2, reverse=True)

    def _spreads(self, picture: Picture, eyes: Points) -> tuple[float, ...]:
        """Each eye's `contour_spread`; `eyes` is (2, 9, 2)."""
        views = [view for number, eye in enumerate(eyes) for view in views_of(eye, flip=number == 1)]
        part, within = _about(picture, views)
        seen = self._client.ask("eye", part, regions=within)["eyes"]
        contours = contours_of(seen).reshape(len(eyes), len(FACE_VIEWS), -1, 2)
        return tuple(contour_spread(one, eye_axis(eye)[2]) for one, eye in zip(contours, eyes, strict=True))


def spread_out(pictures: Sequence[Picture], count: int) -> list[Picture]:
    """So many of the pictures, or all where they are fewer, from the first to the last and evenly apart."""
    chosen = np.linspace(0, len(pictures) - 1, min(count, len(pictures))).round()
    return [pictures[int(number)] for number in chosen]


class CloseUp:
    """One eye that fills the picture, read in regions that `look_for` lays on it once."""

    eyes = 1

    def __init__(self, client: MeshClient):
        self._client = client
        self._views: list[Region] = []

    def look_for(self, pictures: Sequence[Picture]) -> None:
        """Lay the regions on the eye.

        A first region is the one whose contour moves least when it is moved, and opens and closes most. Those
        that the eye is read in are laid, in two rounds, on the eye as they see it.

        Raises
        ------
        InputError
            The eye is seen less than 10 px wide.
        """
        height, width = pictures[0].shape[:2]
        regions = [
            Region(width / 2 + dx * width, height / 2 + dy * height, side * height, flip)
            for side in REGION_SIDES
            for dx in REGION_SHIFTS
            for dy in REGION_SHIFTS
            for flip in (False, True)
        ]
        spread = np.mean([self._spread(p, regions) for p in spread_out(pictures, JITTERED)], axis=0)
        best = np.argsort(spread)[:6]
        heights = np.array([self._heights(p, [regions[k] for k in best]) for p in pictures])
        low, high = np.percentile(heights, [3, 90], axis=0)
        travel = (high - low) / np.maximum(high, 1e-6)
        region = regions[int(best[int(np.argmax(travel - 2 * spread[best]))])]
        self._views = region.views(region.side / SIDE_OF_WIDTH)
        for _ in range(2):
            self._lay(spread_out(pictures, LAID_ON), region.flip)

    def _lay(self, pictures: Sequence[Picture], flip: bool) -> None:
        """Lay the views on the eye's middle, in the median of pictures, with sides by its width."""
        canthi = np.array([self._points(picture)[0][[0, 5]] for picture in pictures])
        width = float(np.median(np.hypot(*(canthi[:, 1] - canthi[:, 0]).T)))
        if width < LEAST_EYE_PX:
            raise InputError(
                f"the eye of this close-up is seen {width:.0f} px wide, and {LEAST_EYE_PX} are needed; "
                "leave out --one-eye if the video shows a face"
            )
        x, y = np.median(canthi.mean(1), axis=0).tolist()
        self._views = Region(x, y, SIDE_OF_WIDTH * width, flip).views(width)

    def _spread(self, picture: Picture, regions: Sequence[Region]) -> Points:
        """How far the canthi move, as part of the eye's width, when each region is jittered."""
        moved = [
            Region(x + dx * side, y + dy * side, side * scale, flip)
            for x, y, side, flip, _ in regions
            for dx, dy, scale in ((0, 0, 1.0), *JITTERS)
        ]
        answers = self._client.ask("eye", picture, regions=moved)["eyes"]
        canthi = np.array([(upper[0], upper[-1]) for upper, _, _ in answers])
        canthi = canthi.reshape(len(regions), len(JITTERS) + 1, 2, 2)
        width = np.hypot(*(canthi[:, 0, 1] - canthi[:, 0, 0]).T)
        away = np.sqrt(((canthi[:, 1:] - canthi[:, :1]) ** 2).sum(-1)).mean((1, 2))
        return np.asarray(away / np.maximum(width, 1e-6))

    def _heights(self, picture: Picture, regions: Sequence[Region]) -> list[float]:
        answers = self._client.ask("eye", picture, regions=list(regions))["eyes"]
        return [
            float(np.mean(np.array(lower)[3:6, 1]) - np.mean(np.array(upper)[3:6, 1]))
            for upper, lower, _ in answers
        ]

    def _points(self, picture: Picture) -> tuple[Points, Points, float]:
        """Nine points and the iris's five, the mean of all views, and the `contour_spread`."""
        eyes = self._client.ask("eye", picture, regions=self._views)["eyes"]
        spread = contour_spread(contours_of(eyes), self._views[0].side / SIDE_OF_WIDTH)
        up, low, iris = (np.mean([eye[part] for eye in eyes], axis=0) for part in range(3))
        # One-eye files begin at the image-left canthus, whichever that is.
        if up[0, 0] > up[-1, 0]:
            up, low = up[::-1], low[::-1]
        return eye_points(up, low[::-1]), iris, spread

    def detect(self, picture: Picture) -> list[Detection]:
        """Return the eye in the regions found before."""
        if not self._views:
            return []
        points, iris, spread = self._points(picture)
        box = np.concatenate([points.min(0), points.max(0)])
        return [Detection(points, iris[None], box, (spread,))]


@contextmanager
def open_detector(*, one_eye: bool, first: Sequence[Picture] = ()) -> Iterator[LidDetector]:
    """Start the detector; for a close-up of one eye `first` holds pictures (h, w, 3) to find the eye in.

    Raises
    ------
    InputError
        Most pictures meant as close-ups show a whole face, or an eye less than 10 px wide.
    """
    with MeshClient(detector_environment()) as client:
        if not one_eye:
            yield FaceMesh(client)
            return
        _refuse_faces(FaceMesh(client), first)
        close_up = CloseUp(client)
        close_up.look_for(first)
        yield close_up


def _refuse_faces(mesh: FaceMesh, pictures: Sequence[Picture]) -> None:
    few = spread_out(pictures, FACES_ASKED)
    faces = sum(_shows_a_face(mesh, picture) for picture in few)
    if 2 * faces > len(few):
        raise InputError(
            f"a whole face is seen on {faces} of {len(few)} frames looked at, and --one-eye is for close-ups "
            "of one eye; leave it out"
        )


def _shows_a_face(mesh: FaceMesh, picture: Picture) -> bool:
    """Whether a face is seen in a picture and, at the same place, in its mirror image.

    In the iris and lashes of a close-up the mesh sees small faces, somewhere else in the mirror image.
    """
    seen, mirrored = mesh.faces(picture), mesh.faces(np.ascontiguousarray(picture[:, ::-1]))
    if not seen or not mirrored:
        return False
    one = seen[0].points.reshape(2, -1, 2)
    other = mirrored[0].points.reshape(2, -1, 2)[::-1] * [-1, 1] + [picture.shape[1] - 1, 0]
    return bool(np.hypot(*(one - other).T).mean() < SAME_FACE * widths(seen[0].points))
